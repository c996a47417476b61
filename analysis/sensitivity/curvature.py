"""Likelihood of ordered answers with its gradient and curvature, at many points at once."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array
from scipy.special import ndtr

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.statistics.ordinal_likelihood import log_interval

# Below this probability its logarithm is computed in the tail, which costs more.
SMALLEST = 1e-280
LOG_ROOT_2_PI = np.log(2 * np.pi) / 2
Loadings: TypeAlias = tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]


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
        """Return all thresholds, with an infinite one at either end, of `shared` (points, G)."""
        edges = np.tile(np.concatenate([[-np.inf], self.thresholds, [np.inf]]), (len(shared), 1))
        edges[:, 1:-1][:, self.free] = shared[:, self.threshold_columns]
        return edges

    def bounds(
        self, shared: FloatArray, own: FloatArray, sd: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the trials' lower and upper edges about their place on the latent scale, over σ.

        Parameters:
            shared: shape (points, G).
            own: shape (points, subjects, 2), added to the population's line.
            sd: shape (points,), σ.

        Returns:
            Two arrays of shape (trials, points).
        """
        edges, lines = self.edges(shared).T, (own + shared[:, None, self.line_columns]).T
        place = lines[0][self.subject] + lines[1][self.subject] * self.x[:, None]
        if self.conditions:
            place += shared.T[self.line_columns.stop :][self.condition]
        return (edges[self.category] - place) / sd, (edges[self.category + 1] - place) / sd

    @cached_property
    def loadings(self) -> "Loadings":
        """How upper and lower edge depend on shared (trials, G) and own (trials, 2) parameters."""
        size, trials = len(self.shared_start), np.arange(len(self.x))
        own = -np.stack([np.ones_like(self.x), self.x], axis=1)
        found = []
        for category in (self.category + 1, self.category):
            edges = np.zeros((self.categories + 1, size))
            edges[1:-1][self.free, self.threshold_columns] = np.eye(int(self.free.sum()))
            shared = edges[category]
            shared[:, self.line_columns] = own
            if self.conditions:
                shared[trials, self.line_columns.stop + self.condition] = -1.0
            found.append((shared, own))
        return found[0], found[1]

    def curvature(self, slopes: "EdgeSlopes", residual_sd: FloatArray) -> "Curvature":
        """Return the likelihood's derivatives with respect to the parameters."""
        return curvature_of(self, slopes, residual_sd)

    def some(self, step: int) -> "OrdinalTrials":
        """Return the trials of each `step`-th subject."""
        chosen = self.subject % step == 0
        names = ("condition", "x", "category", "weight")
        parts = {name: getattr(self, name)[chosen] for name in names}
        subjects, subject = -(-self.subjects // step), self.subject[chosen] // step
        return replace(self, subjects=subjects, subject=subject, **parts)

    def totals(self, group: IntArray, groups: int, powers: int) -> csr_array:
        """Return the matrix that sums values of trials, times x^0, x^1, …, in each group."""
        return sums(group, groups, self.weight, self.x, powers)

    @cached_property
    def by_category(self) -> csr_array:
        """Sums per category."""
        return self.totals(self.category, self.categories, 1)

    @cached_property
    def by_subject(self) -> csr_array:
        """Sums per subject, times 1, x and x²."""
        return self.totals(self.subject, self.subjects, 3)

    @cached_property
    def by_answer(self) -> csr_array:
        """Sums per subject and category, times 1 and x."""
        cell = self.subject * self.categories + self.category
        return self.totals(cell, self.subjects * self.categories, 2)

    @cached_property
    def by_cell(self) -> csr_array:
        """Sums per subject and condition, times 1 and x."""
        cell = self.subject * self.conditions + self.condition
        return self.totals(cell, self.subjects * self.conditions, 2)

    @cached_property
    def by_condition(self) -> csr_array:
        """Sums per condition and category."""
        cell = self.condition * self.categories + self.category
        return self.totals(cell, self.conditions * self.categories, 1)


def sums(group: IntArray, groups: int, weight: FloatArray, x: FloatArray, powers: int) -> csr_array:
    """Return the matrix that sums weighted values, times x^0, x^1, …, in each group."""
    trials = np.arange(len(x))
    if not groups:
        return csr_array((0, len(trials)))
    parts = [weight * x**power for power in range(powers)]
    rows = np.concatenate([group * powers + power for power in range(powers)])
    return csr_array(
        (np.concatenate(parts), (rows, np.tile(trials, powers))),
        shape=(groups * powers, len(trials)),
    )


def counted(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distinct rows, sorted, and the number of times each occurs."""
    rows, counts = np.unique(columns, axis=0, return_counts=True)
    return rows, counts.astype(np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Curvature:
    """First and negative second derivatives with respect to shared and own parameters.

    The first axis of each is that of the points: `shared_gradient` (points, G), `own_gradient`
    (points, subjects, 2), `own_precision` (points, subjects, 2, 2), `cross` (points, subjects, 2,
    G), `whole` (points, G, G).
    """

    shared_gradient: FloatArray
    own_gradient: FloatArray
    own_precision: FloatArray
    cross: FloatArray
    whole: FloatArray

    @cached_property
    def own_covariance(self) -> FloatArray:
        """Inverse of `own_precision`."""
        a, b, d = (self.own_precision[..., i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
        inverse = np.stack([np.stack([d, -b], axis=-1), np.stack([-b, a], axis=-1)], axis=-2)
        return np.asarray(inverse / (a * d - b * b)[..., None, None])

    @cached_property
    def response(self) -> FloatArray:
        """How far the own parameters move against the shared ones, (points, subjects, 2, G)."""
        return np.asarray(self.own_covariance @ self.cross)

    @cached_property
    def shared_precision(self) -> FloatArray:
        """Curvature with respect to the shared parameters, the subjects' own eliminated."""
        size = self.whole.shape[-1]
        cross = self.cross.reshape(len(self.cross), -1, size)
        response = self.response.reshape(cross.shape)
        return np.asarray(self.whole - np.swapaxes(cross, 1, 2) @ response)

    @cached_property
    def log_determinant(self) -> FloatArray:
        """Logarithm of the determinant of the whole curvature, (points,)."""
        own = self.own_precision
        blocks = own[..., 0, 0] * own[..., 1, 1] - own[..., 0, 1] ** 2
        shared: FloatArray = np.linalg.slogdet(self.shared_precision)[1]
        return np.asarray(np.log(blocks).sum(axis=1) + shared)

    def newton_step(self) -> tuple[FloatArray, FloatArray]:
        """Return the step of shared and own parameters to the peak of the parabola."""
        pulled = np.einsum("psig,psi->pg", self.response, self.own_gradient)
        gap = (self.shared_gradient - pulled)[..., None]
        shared = np.linalg.solve(self.shared_precision, gap)[..., 0]
        own = (self.own_covariance @ self.own_gradient[..., None])[..., 0]
        own = own - (self.response @ shared[:, None, :, None])[..., 0]
        return np.asarray(shared, dtype=np.float64), np.asarray(own, dtype=np.float64)

    def with_prior(
        self, at: tuple[FloatArray, FloatArray], shared: FloatArray, own: FloatArray
    ) -> "Curvature":
        """Add normal priors about 0 with these precisions, at the given parameters."""
        diagonal = np.arange(shared.shape[-1])
        whole = self.whole.copy()
        whole[:, diagonal, diagonal] += shared
        return replace(
            self,
            shared_gradient=self.shared_gradient - shared * at[0],
            own_gradient=self.own_gradient - at[1] @ own,
            own_precision=self.own_precision + own[:, None],
            whole=whole,
        )

    def at(self, points: BoolArray | IntArray) -> "Curvature":
        """Return the curvature at some of the points."""
        return Curvature(**{part.name: getattr(self, part.name)[points] for part in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class EdgeSlopes:
    """Each trial's log P and the derivatives of it by upper and by lower edge, (trials, points)."""

    lower: FloatArray
    upper: FloatArray
    log_p: FloatArray
    up: FloatArray
    down: FloatArray


def edge_slopes(lower: FloatArray, upper: FloatArray) -> EdgeSlopes:
    """Return log(Φ(upper) - Φ(lower)) and its slopes."""
    mirrored = np.where(lower > 0, -1.0, 1.0)
    p = mirrored * (ndtr(mirrored * upper) - ndtr(mirrored * lower))
    far = p < SMALLEST
    log_p = np.log(np.maximum(p, SMALLEST))
    if far.any():
        log_p[far] = log_interval(lower[far], upper[far], "probit")
    log_scale = -LOG_ROOT_2_PI - log_p
    return EdgeSlopes(
        lower=np.where(np.isinf(lower), 0.0, lower),
        upper=np.where(np.isinf(upper), 0.0, upper),
        log_p=log_p,
        up=np.exp(log_scale - upper * upper / 2),
        down=-np.exp(log_scale - lower * lower / 2),
    )


def curvature_of(trials: OrdinalTrials, slopes: EdgeSlopes, residual_sd: FloatArray) -> Curvature:
    """Return the likelihood's derivatives with respect to the parameters.

    A trial depends on two thresholds, one subject's line and one condition, so the derivatives are
    sums over the cells of those classifications.
    """
    up, down = slopes.up / residual_sd, slopes.down / residual_sd
    up_up = up * (slopes.upper / residual_sd + up)
    down_down = down * (slopes.lower / residual_sd + down)
    up_down = up * down
    by_upper, by_lower = up_up + up_down, down_down + up_down
    stiff, pull = by_upper + by_lower, -(up + down)
    points, subjects, free = len(residual_sd), trials.subjects, trials.free
    sums = (trials.by_subject @ stiff).T.reshape(points, subjects, 3)
    own = np.stack([sums[..., :2], sums[..., 1:]], axis=-1)
    pulls = (trials.by_subject @ pull).T.reshape(points, subjects, 3)[..., :2]
    answers = (points, subjects, trials.categories, 2)
    to_thresholds = -_between_thresholds(
        (trials.by_answer @ by_upper).T.reshape(answers),
        (trials.by_answer @ by_lower).T.reshape(answers),
    )[:, :, free]
    cells = (trials.by_cell @ stiff).T.reshape(points, subjects, trials.conditions, 2)
    cross = np.concatenate(
        [np.swapaxes(to_thresholds, 2, 3), own, np.swapaxes(cells, 2, 3)], axis=3
    )
    by_category = trials.by_category
    gradient = _between_thresholds((by_category @ up).T, (by_category @ down).T)
    answered = (points, trials.conditions, trials.categories)
    pulled = (trials.by_condition @ pull).T.reshape(answered).sum(axis=2)
    coupling = -_between_thresholds(
        (trials.by_condition @ by_upper).T.reshape(answered)[..., None],
        (trials.by_condition @ by_lower).T.reshape(answered)[..., None],
    )[:, :, free, 0]

    line, thresholds = trials.line_columns, trials.threshold_columns
    rest = np.arange(line.stop, cross.shape[3])
    whole = np.zeros((points, cross.shape[3], cross.shape[3]))
    whole[:, line] = cross.sum(axis=1)
    whole[:, :, line] = np.swapaxes(whole[:, line], 1, 2)
    block = _threshold_block(*((by_category @ part).T for part in (up_up, down_down, up_down)))
    whole[:, thresholds, thresholds] = block[:, free][:, :, free]
    whole[:, rest, rest] = cells[..., 0].sum(axis=1)
    whole[:, line.stop :, thresholds] = coupling
    whole[:, thresholds, line.stop :] = np.swapaxes(coupling, 1, 2)
    return Curvature(
        shared_gradient=np.concatenate([gradient[:, free], pulls.sum(axis=1), pulled], axis=1),
        own_gradient=pulls,
        own_precision=own,
        cross=cross,
        whole=whole,
    )


def _between_thresholds(by_upper: FloatArray, by_lower: FloatArray) -> FloatArray:
    """Return sums per threshold, the upper edge of one category and the lower of the next.

    The axis of the categories is the last of two or the third of four.
    """
    if by_upper.ndim == 2:
        return np.asarray(by_upper[:, :-1] + by_lower[:, 1:])
    return np.asarray(by_upper[:, :, :-1] + by_lower[:, :, 1:])


def _threshold_block(up_up: FloatArray, down_down: FloatArray, up_down: FloatArray) -> FloatArray:
    size = up_up.shape[1] - 1
    block = np.zeros((len(up_up), size, size))
    place, next_to = np.arange(size), np.arange(size - 1)
    block[:, place, place] = _between_thresholds(up_up, down_down)
    block[:, next_to, next_to + 1] = block[:, next_to + 1, next_to] = up_down[:, 1:-1]
    return block
