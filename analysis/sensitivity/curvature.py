"""Likelihood of ordered answers with its gradient and curvature, at many points at once."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array
from scipy.special import erfcx

from analysis.estimates import BoolArray, FloatArray, IntArray

LOG_ROOT_2_PI = np.log(2 * np.pi) / 2
# Beyond it a normal distribution has no probability that a number of this machine can tell from 0.
# Mills' ratio there is 1e297, and overflows soon after.
BEYOND = -37.0
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

    def curvature(self, slopes: "EdgeSlopes", residual_sd: FloatArray) -> "Slopes":
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
class Slopes:
    """First and negative second derivatives of a likelihood by shared and own parameters.

    The first axis of each is that of the points: `shared_gradient` (points, G), `own_gradient`
    (points, subjects, 2), `own_precision` (points, subjects, 2, 2), `cross` (points, subjects, 2,
    G), `whole` (points, G, G).
    """

    shared_gradient: FloatArray
    own_gradient: FloatArray
    own_precision: FloatArray
    cross: FloatArray
    whole: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Curvature(Slopes):
    """Derivatives of a log posterior by shared parameters and by own ones in units of their prior.

    Own parameters are L z, T = L L' being their covariance and `root` (points, 2, 2) being L; the
    derivatives are those by z, whose prior precision is I. So nothing is divided by T, which may be
    singular, and no term of a determinant cancels another.
    """

    root: FloatArray

    @cached_property
    def _own_inverse(self) -> tuple[FloatArray, FloatArray]:
        """Inverse of `own_precision` and the logarithm of its determinant, per subject."""
        a, b, d = (self.own_precision[..., i, j] for i, j in ((0, 0), (0, 1), (1, 1)))
        # (24), mathematics/sensitivity.
        # With I + Q in place of the precision: 1 + tr Q + |Q|, each of which is positive.
        size = 1 + (a - 1) + (d - 1) + np.maximum((a - 1) * (d - 1) - b * b, 0.0)
        inverse = np.stack([np.stack([d, -b], axis=-1), np.stack([-b, a], axis=-1)], axis=-2)
        return np.asarray(inverse / size[..., None, None]), np.log(size)

    @cached_property
    def own_covariance(self) -> FloatArray:
        """Covariance of each subject's own parameters, given the shared ones."""
        root = self.root[:, None]
        return np.asarray(root @ self._own_inverse[0] @ np.swapaxes(root, -1, -2))

    @cached_property
    def _response(self) -> FloatArray:
        return np.asarray(self._own_inverse[0] @ self.cross)

    @cached_property
    def response(self) -> FloatArray:
        """How far the own parameters move against the shared ones, (points, subjects, 2, G)."""
        return np.asarray(self.root[:, None] @ self._response)

    @cached_property
    def _scaled(self) -> tuple[FloatArray, FloatArray]:
        """Shared parameters' precision, the own ones eliminated, with a diagonal of 1; its scale.

        This is one step of Cholesky's factorisation of the whole matrix, so that rounding hurts it
        no more than that.
        """
        size = self.whole.shape[-1]
        cross = self.cross.reshape(len(self.cross), -1, size)
        precision = self.whole - np.swapaxes(cross, 1, 2) @ self._response.reshape(cross.shape)
        # Where rounding leaves nothing of a positive number, the point has no weight.
        scale = np.sqrt(np.maximum(np.diagonal(precision, axis1=1, axis2=2), 1e-300))
        return precision / (scale[:, :, None] * scale[:, None, :]), scale

    @cached_property
    def shared_covariance(self) -> FloatArray:
        """Covariance of the shared parameters, (points, G, G)."""
        scaled, scale = self._scaled
        return np.asarray(np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :]))

    @cached_property
    def log_determinant(self) -> FloatArray:
        """Logarithm of the determinant of the whole curvature, (points,); NaN if it is lost."""
        scaled, scale = self._scaled
        sign, size = np.linalg.slogdet(scaled)
        shared = np.where(sign > 0, size, np.nan) + 2 * np.log(scale).sum(axis=1)
        return np.asarray(self._own_inverse[1].sum(axis=1) + shared)

    def newton_step(self) -> tuple[FloatArray, FloatArray]:
        """Return the step of shared parameters and z to the parabola's peak, (25)."""
        pulled = np.einsum("psig,psi->pg", self._response, self.own_gradient)
        gap = (self.shared_gradient - pulled)[..., None]
        shared = (self.shared_covariance @ gap)[..., 0]
        own = (self._own_inverse[0] @ self.own_gradient[..., None])[..., 0]
        own = own - (self._response @ shared[:, None, :, None])[..., 0]
        return np.asarray(shared, dtype=np.float64), np.asarray(own, dtype=np.float64)

    @classmethod
    def of_posterior(
        cls,
        likelihood: Slopes,
        at: tuple[FloatArray, FloatArray],
        shared_precision: FloatArray,
        root: FloatArray,
    ) -> "Curvature":
        """Return derivatives with normal priors about 0, at shared parameters and z."""
        diagonal = np.arange(shared_precision.shape[-1])
        whole = likelihood.whole.copy()
        whole[:, diagonal, diagonal] += shared_precision
        turned = np.swapaxes(root, -1, -2)[:, None]
        gradient = (turned @ likelihood.own_gradient[..., None])[..., 0]
        return cls(
            shared_gradient=likelihood.shared_gradient - shared_precision * at[0],
            own_gradient=gradient - at[1],
            own_precision=turned @ likelihood.own_precision @ root[:, None] + np.eye(2),
            cross=turned @ likelihood.cross,
            whole=whole,
            root=root,
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
    """Return log(Φ(upper) - Φ(lower)) and its slopes; each lower edge is below its upper one.

    With Mills' ratio R(x) = (1 - Φ(x)) / φ(x), the probability between a and b, |a| <= b, is
    φ(a) (R(a) - R(b) exp(-(b - a)(b + a) / 2)). So the slopes φ(a) / P and φ(b) / P need neither a
    probability, which far out is 0, nor the difference of large squares: (11) and (12) of
    docs/mathematics/sensitivity.md.
    """
    mirrored = lower + upper < 0
    near = np.maximum(np.where(mirrored, -upper, lower), BEYOND)
    far = np.where(mirrored, -lower, upper)
    fall = np.exp(-(far - near) * (far + near) / 2)
    gap = mills_ratio(near) - mills_ratio(far) * fall
    at_near, at_far = 1 / gap, fall / gap
    return EdgeSlopes(
        lower=np.where(np.isinf(lower), 0.0, lower),
        upper=np.where(np.isinf(upper), 0.0, upper),
        log_p=np.log(gap) - near * near / 2 - LOG_ROOT_2_PI,
        up=np.where(mirrored, at_near, at_far),
        down=-np.where(mirrored, at_far, at_near),
    )


def mills_ratio(x: FloatArray) -> FloatArray:
    """Return (1 - Φ(x)) / φ(x) of numbers that are not below `BEYOND`."""
    return np.asarray(np.sqrt(np.pi / 2) * erfcx(x / np.sqrt(2)))


def curvature_of(trials: OrdinalTrials, slopes: EdgeSlopes, residual_sd: FloatArray) -> Slopes:
    """Return the likelihood's derivatives with respect to the parameters.

    A trial depends on two thresholds, one subject's line and one condition, so the derivatives are
    sums over the cells of those classifications.
    """
    # (13) to (15), mathematics/sensitivity
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
    return Slopes(
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
