"""Likelihood of ordered answers with its gradient and curvature, at many points at once."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import ClassVar, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.special import erfcx

from analysis.estimates import BoolArray, FloatArray, IntArray

SmallInts: TypeAlias = NDArray[np.int32]

LOG_ROOT_2_PI = np.log(2 * np.pi) / 2
# Prior SD of thresholds and population line, in SDs of the ratings. It is so wide that it only
# keeps them finite if the answers do not overlap.
WIDE = 10.0
# A determinant of a positive matrix that is below 0 by no more than this part of its terms is 0.
ROUNDING = 1e-9
# Beyond it a normal distribution has no probability that a number of this machine can tell from 0.
# Mills' ratio there is 1e297, and overflows soon after.
BEYOND = -37.0


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentTrials(ABC):
    """Trials whose answers are intervals between edges that are linear in the parameters.

    They are sorted by subject; equal trials are listed once, with their number as `weight`. Of the
    shared parameters those of edges and of other columns come first, then the population's line,
    then discrepancies.

    Parameters:
        subjects, conditions: their number; with 0 conditions the model has no discrepancies.
        subject, condition, x, weight: shape (trials,); x is the contrast in standard units.
        answers: names of the fields, shape (trials,), that hold what was answered.
    """

    subjects: int
    conditions: int
    subject: IntArray
    condition: IntArray
    x: FloatArray
    weight: FloatArray
    answers: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def shared_start(self) -> FloatArray:
        """Initial values of the shared parameters, (G,)."""

    @property
    @abstractmethod
    def line_columns(self) -> slice:
        """Positions of the population's line among the shared parameters; discrepancies follow."""

    @property
    def shared_sd(self) -> FloatArray:
        """Prior SD of each shared parameter but discrepancies."""
        return np.full(self.line_columns.stop, WIDE)

    @property
    def without_lapses(self) -> Self | None:
        """The trials as if no answer were a lapse, None if their likelihood is that already."""
        return None

    @property
    @abstractmethod
    def loadings(self) -> tuple[FloatArray, FloatArray]:
        """How upper and lower edge depend on the shared parameters, (trials, G) each.

        On a subject's own line they depend as on the population's.
        """

    @abstractmethod
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

    def slopes(self, lower: FloatArray, upper: FloatArray) -> "EdgeSlopes":
        """Return log P of each answer with its slopes by the edges, which are in order."""
        return edge_slopes(lower, upper)

    def some(self, step: int) -> Self:
        """Return the trials of each `step`-th subject."""
        chosen = self.subject % step == 0
        names = ("condition", "x", "weight", *self.answers)
        parts = {name: getattr(self, name)[chosen] for name in names}
        subjects, subject = -(-self.subjects // step), self.subject[chosen] // step
        return replace(self, subjects=subjects, subject=subject, **parts)


@dataclass(frozen=True, kw_only=True, eq=False)
class OrdinalTrials(LatentTrials):
    """Trials rated in categories between thresholds, (3).

    Parameters:
        category: shape (trials,), from 0.
        thresholds: shape (categories - 1,), in standard units of the ratings: the values of fixed
            thresholds and the initial values of free ones.
        free: shape (categories - 1,), which thresholds are estimated. At least two are fixed: they
            set the zero and the unit of the latent scale.
        extra: shape (trials, columns), each of which adds its coefficient times its value to the
            place of a trial.
        extra_sd: shape (columns,), prior SD of each coefficient, which is 0 on average.
    """

    category: IntArray
    thresholds: FloatArray
    free: BoolArray
    extra: FloatArray
    extra_sd: FloatArray
    answers: ClassVar = ("category", "extra")

    @property
    def extra_columns(self) -> slice:
        """Positions of the coefficients of `extra`: those after the free thresholds."""
        free = int(self.free.sum())
        return slice(free, free + self.extra.shape[1])

    @property
    def line_columns(self) -> slice:
        """Those after the coefficients of `extra`."""
        first = self.extra_columns.stop
        return slice(first, first + 2)

    @property
    def shared_start(self) -> FloatArray:
        """Thresholds as given, all else 0."""
        others = self.extra.shape[1] + 2 + self.conditions
        return np.concatenate([self.thresholds[self.free], np.zeros(others)])

    @property
    def shared_sd(self) -> FloatArray:
        """`WIDE` for thresholds and line, `extra_sd` between them."""
        found = np.full(self.line_columns.stop, WIDE)
        found[self.extra_columns] = self.extra_sd
        return found

    def edges(self, shared: FloatArray) -> FloatArray:
        """Return all thresholds, with an infinite one at either end, of `shared` (points, G)."""
        edges = np.tile(np.concatenate([[-np.inf], self.thresholds, [np.inf]]), (len(shared), 1))
        edges[:, 1:-1][:, self.free] = shared[:, : self.extra_columns.start]
        return edges

    def bounds(
        self, shared: FloatArray, own: FloatArray, sd: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return (3), each edge less the place."""
        edges = np.ascontiguousarray(self.edges(shared).T)
        biases, gains = np.ascontiguousarray((own + shared[:, None, self.line_columns]).T)
        # `take` copies whole rows: a third of the time of an index.
        place = gains.take(self.subject, axis=0)
        place *= self.x[:, None]
        place += biases.take(self.subject, axis=0)
        if self.conditions:
            effects = np.ascontiguousarray(shared.T[self.line_columns.stop :])
            place += effects.take(self.condition, axis=0)
        if self.extra.shape[1]:
            place += self.extra @ shared[:, self.extra_columns].T
        lower, upper = (edges.take(self.category + above, axis=0) for above in (0, 1))
        for edge in (lower, upper):
            np.divide(np.subtract(edge, place, out=edge), sd, out=edge)
        return lower, upper

    @cached_property
    def loadings(self) -> tuple[FloatArray, FloatArray]:
        """U and V, mathematics/sensitivity: 1 for the threshold, less those of the place."""
        of_thresholds = np.zeros((len(self.thresholds) + 2, len(self.shared_start)))
        free = np.flatnonzero(self.free)
        of_thresholds[1 + free, np.arange(len(free))] = 1.0
        upper, lower = of_thresholds[self.category + 1], of_thresholds[self.category]
        for loading in (upper, lower):
            loading[:, self.extra_columns] = -self.extra
            loading[:, self.line_columns] = -np.stack([np.ones_like(self.x), self.x], axis=1)
            if self.conditions:
                at = self.line_columns.stop + self.condition
                loading[np.arange(len(self.x)), at] = -1.0
        return upper, lower


def counted(columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the distinct rows, sorted, and the number of times each occurs."""
    rows, counts = np.unique(columns, axis=0, return_counts=True)
    return rows, counts.astype(np.float64)


class Slopes(NamedTuple):
    """First and negative second derivatives of a likelihood by shared and own parameters.

    Shapes are (G, points), (2, subjects, points), (2, subjects, G, points) and (G, G, points). The
    own parameters' second derivatives are the columns of the population's line in `cross`.
    """

    shared_gradient: FloatArray
    own_gradient: FloatArray
    cross: FloatArray
    whole: FloatArray


class DerivativeSums:
    """Sums over trials that make derivatives by parameters of derivatives by edges.

    The edges of a trial are linear in the parameters, with the loadings U and V. So the sums are
    (7) of docs/mathematics/sensitivity.md.
    """

    def __init__(self, trials: LatentTrials) -> None:
        upper, lower = trials.loadings
        (self._trials, size), subjects = upper.shape, trials.subjects
        self._line, self._shape = trials.line_columns, (2, subjects, size)
        weight = trials.weight[:, None]
        # The row of each trial's derivative by each parameter: by lines, they are each subject's.
        # 32 bits take half the memory, and less time.
        numbers = np.arange(size, dtype=np.int32)
        rows = np.tile(2 * subjects + numbers, (self._trials, 1))
        rows[:, self._line] = trials.subject[:, None] + np.arange(2) * subjects
        height = 2 * subjects + size
        of_line = (numbers >= self._line.start) & (numbers < self._line.stop)

        def products(edge: FloatArray, sign: float) -> Iterable[tuple[FloatArray, SmallInts]]:
            for one in range(size):
                # `of` copies the other half, which is equal.
                wanted = numbers >= one
                wanted = wanted | ~of_line if of_line[one] else wanted & ~of_line
                by = rows[:, [one]] * size + numbers
                yield sign * weight * edge[:, [one]] * (edge * wanted), by

        self._first = _sparse([[(weight * edge, rows)] for edge in (upper, lower)], height)
        self._second = _sparse(
            [products(upper, 1.0), products(lower, 1.0), products(upper - lower, -1.0)],
            height * size,
        )

    def of(
        self, slopes: "EdgeSlopes", residual_sd: FloatArray, share: FloatArray | None = None
    ) -> Slopes:
        """Return the likelihood's derivatives with respect to the parameters.

        With a `share` (trials, points) they are each trial's times it.
        """
        parts = np.empty((5, self._trials, len(residual_sd)))
        up, down, by_upper, by_lower, mixed = parts
        np.divide(slopes.up, residual_sd, out=up)
        np.divide(slopes.down, residual_sd, out=down)
        # up_up + up_down = up (u + up + down)
        np.add(up, down, out=mixed)
        for edge, of, by in ((slopes.upper, up, by_upper), (slopes.lower, down, by_lower)):
            np.divide(edge, residual_sd, out=by)
            np.multiply(np.add(by, mixed, out=by), of, out=by)
        np.multiply(up, down, out=mixed)
        if share is not None:
            parts *= share
        points, (lines, subjects, size) = len(residual_sd), self._shape
        own = lines * subjects
        first = self._first @ parts[:2].reshape(-1, points)
        second = self._second @ parts[2:].reshape(-1, points)
        own_gradient = first[:own].reshape(lines, subjects, points)
        cross = second[: own * size].reshape(lines, subjects, size, points)
        shared_gradient, whole = first[own:], second[own * size :].reshape(size, size, points)
        level, slope = range(size)[self._line]
        cross[1, :, level] = cross[0, :, slope]
        shared_gradient[self._line] = own_gradient.sum(axis=1)
        whole[self._line] = cross.sum(axis=1)
        whole[:, self._line] = np.swapaxes(whole[self._line], 0, 1)
        below = np.tril_indices(size, -1)
        whole[below] = whole[below[::-1]]
        return Slopes(shared_gradient, own_gradient, cross, whole)


def _sparse(blocks: Sequence[Iterable[tuple[FloatArray, SmallInts]]], height: int) -> csr_array:
    """Return the matrix of blocks side by side, of a column per trial: values and their rows."""
    data, rows, columns = [], [], []
    for number, block in enumerate(blocks):
        for values, to in block:
            trial, which = np.nonzero(values)
            data.append(values[trial, which])
            rows.append(to[trial, which])
            columns.append((number * len(values) + trial).astype(np.int32))
    places = np.concatenate(rows), np.concatenate(columns)
    return csr_array((np.concatenate(data), places), shape=(height, len(blocks) * len(values)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Curvature:
    """Derivatives of a log posterior by shared parameters and by own ones in units of their prior.

    Own parameters are L z, T = L L' being their covariance and `root` (2, 2, points) being L; the
    derivatives are those by z, whose prior precision is I. So nothing is divided by T, which may be
    singular, and no term of a determinant cancels another. The last axis is that of the points:
    `own_precision` (3, subjects, points) has its first, mixed and second element; for the others
    see `Slopes`.
    """

    shared_gradient: FloatArray
    own_gradient: FloatArray
    own_precision: FloatArray
    cross: FloatArray
    whole: FloatArray
    root: FloatArray

    @cached_property
    def _own_size(self) -> FloatArray:
        """Determinants of `own_precision`, (subjects, points)."""
        a, b, d = self.own_precision
        # (10), mathematics/sensitivity: each term is positive if the likelihood is concave.
        beyond = (a - 1) * (d - 1) - b * b
        beyond = np.where((beyond < 0) & (beyond > -ROUNDING * (1 + b * b)), 0.0, beyond)
        return np.asarray(1 + (a - 1) + (d - 1) + beyond)

    @cached_property
    def _own_root(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Cholesky's factor of `own_precision`, 1 over its diagonal; (subjects, points) each."""
        a, b, _ = self.own_precision
        first = 1 / np.sqrt(a)
        return first, b * first, 1 / (np.sqrt(self._own_size) * first)

    def _white(self, values: FloatArray, own: tuple[FloatArray, ...]) -> FloatArray:
        """Return values (2, subjects, ..., points) over the factor of `own_precision`."""
        first, below, second = own
        found = np.empty_like(values)
        np.multiply(values[0], first, out=found[0])
        np.multiply(below, found[0], out=found[1])
        np.subtract(values[1], found[1], out=found[1])
        found[1] *= second
        return found

    @cached_property
    def _white_cross(self) -> FloatArray:
        first, below, second = (each[:, None] for each in self._own_root)
        return self._white(self.cross, (first, below, second))

    @cached_property
    def _scaled(self) -> tuple[FloatArray, FloatArray]:
        """Shared parameters' precision, the own ones eliminated, with a diagonal of 1; its scale.

        This is one step of Cholesky's factorisation of the whole matrix, so that rounding hurts it
        no more than that. Shapes (points, G, G) and (points, G).
        """
        size, points = self.whole.shape[1:]
        white = self._white_cross.reshape(-1, size, points).transpose(2, 0, 1).copy()
        precision = self.whole.transpose(2, 0, 1) - white.transpose(0, 2, 1) @ white
        # Where rounding leaves nothing of a positive number, the point has no weight.
        scale = np.sqrt(np.maximum(np.diagonal(precision, axis1=1, axis2=2), 1e-300))
        return precision / (scale[:, :, None] * scale[:, None, :]), scale

    @cached_property
    def log_determinant(self) -> FloatArray:
        """Logarithm of the determinant of the whole curvature, (9), (points,); NaN if lost."""
        scaled, scale = self._scaled
        sign, size = np.linalg.slogdet(scaled)
        shared = np.where(sign > 0, size, np.nan) + 2 * np.log(scale).sum(axis=1)
        return np.asarray(np.log(self._own_size).sum(axis=0) + shared)

    def newton_step(self) -> tuple[FloatArray, FloatArray]:
        """Return the step of shared parameters and z to the parabola's peak, (11)."""
        own = self._white(self.own_gradient, self._own_root)
        gap = self.shared_gradient - np.einsum("asgp,asp->gp", self._white_cross, own)
        scaled, scale = self._scaled
        shared = np.linalg.solve(scaled, (gap.T / scale)[..., None])[..., 0] / scale
        own -= np.einsum("asgp,gp->asp", self._white_cross, shared.T)
        return shared, self._unwhite(own).T

    def _unwhite(self, values: FloatArray) -> FloatArray:
        """Return values over the transposed factor of `own_precision`."""
        first, below, second = (
            each[(slice(None), *[None] * (values.ndim - 3))] for each in self._own_root
        )
        last = values[1] * second
        return np.array([(values[0] - below * last) * first, last])

    @cached_property
    def own_covariance(self) -> FloatArray:
        """Covariance of each subject's own parameters, given the shared ones: (10)."""
        a, b, d = self.own_precision / self._own_size
        inverse = np.array([[d, -b], [-b, a]]).transpose(3, 2, 0, 1)
        root = self.root.transpose(2, 0, 1)[:, None]
        return np.asarray(root @ inverse @ np.swapaxes(root, -1, -2))

    @cached_property
    def response(self) -> FloatArray:
        """How far the own parameters move against the shared ones, (points, subjects, 2, G)."""
        found = self._unwhite(self._white_cross)
        p, r, s = self.root[0, 0], self.root[1, 0], self.root[1, 1]
        return np.ascontiguousarray(
            np.array([p * found[0], r * found[0] + s * found[1]]).transpose(3, 1, 0, 2)
        )

    @cached_property
    def shared_covariance(self) -> FloatArray:
        """Covariance of the shared parameters, (9), (points, G, G)."""
        scaled, scale = self._scaled
        return np.asarray(np.linalg.inv(scaled) / (scale[:, :, None] * scale[:, None, :]))

    @classmethod
    def of_posterior(
        cls,
        likelihood: Slopes,
        at: tuple[FloatArray, FloatArray],
        shared_precision: FloatArray,
        root: FloatArray,
        line: slice,
    ) -> "Curvature":
        """Return derivatives with normal priors about 0, at shared parameters and z."""
        diagonal = np.arange(shared_precision.shape[-1])
        whole = likelihood.whole.copy()
        whole[diagonal, diagonal] += shared_precision.T
        root = np.ascontiguousarray(root.transpose(1, 2, 0))
        p, r, s = root[0, 0], root[1, 0], root[1, 1]

        def turned(values: FloatArray) -> FloatArray:
            """Return L' times values (2, ..., points)."""
            found = np.empty_like(values)
            np.multiply(r, values[1], out=found[0])
            found[0] += p * values[0]
            np.multiply(s, values[1], out=found[1])
            return found

        cross = turned(likelihood.cross)
        bias, gain = cross[:, :, line].transpose(2, 0, 1, 3)
        precision = np.array([1 + p * bias[0] + r * gain[0], s * gain[0], 1 + s * gain[1]])
        return cls(
            shared_gradient=likelihood.shared_gradient - (shared_precision * at[0]).T,
            own_gradient=turned(likelihood.own_gradient) - at[1].T,
            own_precision=precision,
            cross=cross,
            whole=whole,
            root=root,
        )

    @property
    def parts(self) -> dict[str, FloatArray]:
        """The derivatives by their names."""
        return {part.name: getattr(self, part.name) for part in fields(self)}

    def at(self, points: BoolArray | IntArray | slice) -> "Curvature":
        """Return the curvature at some of the points."""
        return Curvature(**{name: values[..., points] for name, values in self.parts.items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class EdgeSlopes:
    """Each trial's log P and the derivatives of it by upper and by lower edge, (trials, points).

    `attended` (trials, points) is the probability that an answer was no lapse, None without lapses.
    """

    lower: FloatArray
    upper: FloatArray
    log_p: FloatArray
    up: FloatArray
    down: FloatArray
    attended: FloatArray | None = None

    def with_lapses(self, lapse: float, log_random: FloatArray) -> "EdgeSlopes":
        """Return the slopes if a share `lapse` of the answers is given at random.

        `log_random` (trials,) is the log probability of a trial's answer at random. As only the
        probability between the edges depends on them, (5) stays with all of the probability, and
        with it (6).
        """
        log_p = np.logaddexp(self.log_p + np.log1p(-lapse), np.log(lapse) + log_random[:, None])
        attended = np.exp(self.log_p + np.log1p(-lapse) - log_p)
        up, down = attended * self.up, attended * self.down
        return replace(self, log_p=log_p, up=up, down=down, attended=attended)


def edge_slopes(lower: FloatArray, upper: FloatArray) -> EdgeSlopes:
    """Return log(Φ(upper) - Φ(lower)) and its slopes; each lower edge is below its upper one.

    With Mills' ratio R(x) = (1 - Φ(x)) / φ(x), the probability between a and b, |a| <= b, is
    φ(a) (R(a) - R(b) exp(-(b - a)(b + a) / 2)). So the slopes φ(a) / P and φ(b) / P need neither a
    probability, which far out is 0, nor the difference of large squares: (4) and (5) of
    docs/mathematics/sensitivity.md.
    """
    mirrored = lower + upper < 0
    near, far = np.maximum(lower, -upper), np.maximum(upper, -lower)
    np.maximum(near, BEYOND, out=near)
    fall = near - far
    fall *= near + far
    fall /= 2
    np.exp(fall, out=fall)
    gap = mills_ratio(far)
    gap *= fall
    np.subtract(mills_ratio(near), gap, out=gap)
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
    found = np.asarray(erfcx(x / np.sqrt(2)))
    found *= np.sqrt(np.pi / 2)
    return found
