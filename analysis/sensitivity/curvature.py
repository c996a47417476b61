"""Gradient and curvature of the likelihood of ordered answers."""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.statistics.ordinal_likelihood import log_density_of, log_interval


@dataclass(frozen=True, kw_only=True, eq=False)
class OrdinalTrials:
    """Trials sorted by subject; equal trials are listed once, with their number as `weight`.

    Parameters:
        subjects, conditions: their number; with 0 conditions the model has no discrepancies.
        subject, condition, x, category, weight: shape (trials,); x in standard units.
        thresholds: shape (categories - 1,), in standard units of the ratings: the values of fixed
            thresholds and the initial values of free ones.
        free: shape (categories - 1,), which thresholds are estimated. At least two are fixed: they
            set the zero and the unit of the latent scale.
    """

    subjects: int
    conditions: int
    subject: IntArray
    condition: IntArray
    x: FloatArray
    category: IntArray
    weight: FloatArray
    thresholds: FloatArray
    free: BoolArray

    @property
    def categories(self) -> int:
        """Number of categories."""
        return len(self.thresholds) + 1

    @property
    def threshold_columns(self) -> slice:
        """Positions of the free thresholds among the shared parameters; the line follows."""
        return slice(0, int(self.free.sum()))

    @property
    def line_columns(self) -> slice:
        """Positions of the population's line among the shared parameters; discrepancies follow."""
        return slice(self.threshold_columns.stop, self.threshold_columns.stop + 2)

    @property
    def shared_start(self) -> FloatArray:
        """Initial values of the shared parameters."""
        return np.concatenate([self.thresholds[self.free], np.zeros(2 + self.conditions)])

    def edges(self, shared: FloatArray) -> FloatArray:
        """Return all thresholds at these shared parameters, with an infinite one at either end."""
        thresholds = self.thresholds.copy()
        thresholds[self.free] = shared[self.threshold_columns]
        return np.concatenate([[-np.inf], thresholds, [np.inf]])

    def location(self, shared: FloatArray, own: FloatArray) -> FloatArray:
        """Return each trial's place on the latent scale; `own` (subjects, 2) adds to the line."""
        lines = (own + shared[self.line_columns])[self.subject]
        discrepancies = shared[self.line_columns.stop :]
        added = discrepancies[self.condition] if self.conditions else 0.0
        return np.asarray(lines[:, 0] + lines[:, 1] * self.x + added)


def counted(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distinct rows, sorted, and the number of times each occurs."""
    rows, counts = np.unique(columns, axis=0, return_counts=True)
    return rows, counts.astype(np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Curvature:
    """First and negative second derivatives with respect to shared and own parameters.

    `shared_gradient` (G,), `own_gradient` (subjects, 2), `own_precision` (subjects, 2, 2), `cross`
    (subjects, 2, G), `whole` (G, G).
    """

    shared_gradient: FloatArray
    own_gradient: FloatArray
    own_precision: FloatArray
    cross: FloatArray
    whole: FloatArray

    @property
    def shared_precision(self) -> FloatArray:
        """Curvature with respect to the shared parameters, the subjects' own eliminated."""
        solved = np.linalg.solve(self.own_precision, self.cross)
        return np.asarray(self.whole - np.tensordot(self.cross, solved, axes=([0, 1], [0, 1])))

    def newton_step(self) -> tuple[FloatArray, FloatArray]:
        """Return the step of shared and own parameters to the peak of the parabola."""
        alone = np.linalg.solve(self.own_precision, self.own_gradient[..., None])
        pulled = np.tensordot(self.cross, alone[..., 0], axes=([0, 1], [0, 1]))
        shared = np.linalg.solve(self.shared_precision, self.shared_gradient - pulled)
        rest = self.own_gradient - self.cross @ shared
        own = np.linalg.solve(self.own_precision, rest[..., None])[..., 0]
        return np.asarray(shared, dtype=np.float64), np.asarray(own, dtype=np.float64)

    def with_prior(
        self, at: tuple[FloatArray, FloatArray], shared: FloatArray, own: FloatArray
    ) -> "Curvature":
        """Add normal priors about 0 with these precisions, at the given parameters."""
        return replace(
            self,
            shared_gradient=self.shared_gradient - shared * at[0],
            own_gradient=self.own_gradient - at[1] @ own,
            own_precision=self.own_precision + own,
            whole=self.whole + np.diag(shared),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class _EdgeDerivatives:
    """Derivatives of each trial's log-likelihood by its upper and lower edge (second: negated)."""

    up: FloatArray
    down: FloatArray
    up_up: FloatArray
    down_down: FloatArray
    up_down: FloatArray


def curvature_of(
    trials: OrdinalTrials, bounds: tuple[FloatArray, FloatArray], residual_sd: float
) -> Curvature:
    """Return the likelihood's derivatives where the trials' lower and upper edges are `bounds`.

    A trial depends on two thresholds, one subject's line and one condition, so the derivatives are
    sums over the cells of those classifications.
    """
    slopes = _edge_derivatives(*bounds, trials.weight, residual_sd)
    pull = -(slopes.up + slopes.down)
    stiff = slopes.up_up + slopes.down_down + 2 * slopes.up_down
    by_upper, by_lower = slopes.up_up + slopes.up_down, slopes.down_down + slopes.up_down

    weighted = (pull, pull * trials.x)
    own_gradient = np.stack(
        [_totals(trials.subject, part, trials.subjects) for part in weighted], axis=-1
    )
    own = _own_precision(trials, stiff)
    to_thresholds = -_between_thresholds(
        _line_sums(trials, by_upper, trials.category, trials.categories),
        _line_sums(trials, by_lower, trials.category, trials.categories),
    )[:, :, trials.free]
    to_conditions = _line_sums(trials, stiff, trials.condition, trials.conditions)
    cross = np.concatenate([to_thresholds, own, to_conditions], axis=2)

    line, thresholds = trials.line_columns, trials.threshold_columns
    whole = np.zeros((cross.shape[2], cross.shape[2]))
    whole[line] = cross.sum(axis=0)
    whole[:, line] = whole[line].T
    whole[thresholds, thresholds] = _threshold_block(trials, slopes)
    whole[line.stop :, line.stop :] = np.diag(to_conditions[:, 0].sum(axis=0))
    up, down = (
        _totals(trials.category, slope, trials.categories) for slope in (slopes.up, slopes.down)
    )
    by_threshold = _between_thresholds(up, down)[trials.free]
    by_condition = _totals(trials.condition, pull, trials.conditions)
    coupling = -_condition_block(trials, by_upper, by_lower)
    whole[line.stop :, thresholds] = coupling
    whole[thresholds, line.stop :] = coupling.T
    return Curvature(
        shared_gradient=np.concatenate([by_threshold, own_gradient.sum(axis=0), by_condition]),
        own_gradient=own_gradient,
        own_precision=own,
        cross=cross,
        whole=whole,
    )


def _edge_derivatives(
    lower: FloatArray, upper: FloatArray, weight: FloatArray, residual_sd: float
) -> _EdgeDerivatives:
    log_p = log_interval(lower, upper, "probit")
    up = np.exp(log_density_of(upper, "probit") - log_p)
    down = -np.exp(log_density_of(lower, "probit") - log_p)
    first, second = weight / residual_sd, weight / residual_sd**2
    return _EdgeDerivatives(
        up=up * first,
        down=down * first,
        up_up=(np.where(np.isinf(upper), 0.0, upper) * up + up**2) * second,
        down_down=(np.where(np.isinf(lower), 0.0, lower) * down + down**2) * second,
        up_down=up * down * second,
    )


def _totals(group: IntArray, values: FloatArray, groups: int) -> FloatArray:
    """Return the sum of the values in each group."""
    if groups == 0:
        return np.zeros(0)
    return np.bincount(group, weights=values, minlength=groups).astype(np.float64)


def _own_precision(trials: OrdinalTrials, stiff: FloatArray) -> FloatArray:
    parts = [
        _totals(trials.subject, stiff * trials.x**power, trials.subjects) for power in range(3)
    ]
    return np.moveaxis(np.array([parts[:2], parts[1:]]), -1, 0)


def _line_sums(
    trials: OrdinalTrials, values: FloatArray, group: IntArray, groups: int
) -> FloatArray:
    """Return sums of values times (1, x) per subject and group, shape (subjects, 2, groups)."""
    cell = trials.subject * groups + group
    parts = [
        _totals(cell, part, trials.subjects * groups).reshape(trials.subjects, groups)
        for part in (values, values * trials.x)
    ]
    return np.stack(parts, axis=1)


def _between_thresholds(by_upper: FloatArray, by_lower: FloatArray) -> FloatArray:
    """Return sums per threshold, the upper edge of one category and the lower of the next."""
    return np.asarray(by_upper[..., :-1] + by_lower[..., 1:])


def _threshold_block(trials: OrdinalTrials, slopes: _EdgeDerivatives) -> FloatArray:
    up_up = _totals(trials.category, slopes.up_up, trials.categories)
    down_down = _totals(trials.category, slopes.down_down, trials.categories)
    neighbours = _totals(trials.category, slopes.up_down, trials.categories)[1:-1]
    block = np.diag(_between_thresholds(up_up, down_down))
    block += np.diag(neighbours, 1) + np.diag(neighbours, -1)
    return np.asarray(block[np.ix_(trials.free, trials.free)])


def _condition_block(
    trials: OrdinalTrials, by_upper: FloatArray, by_lower: FloatArray
) -> FloatArray:
    """Return sums per condition and free threshold."""
    cell = trials.condition * trials.categories + trials.category
    cells = trials.conditions * trials.categories
    upper, lower = (
        _totals(cell, values, cells).reshape(-1, trials.categories)
        for values in (by_upper, by_lower)
    )
    return _between_thresholds(upper, lower)[:, trials.free]
