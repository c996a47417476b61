"""Laplace's approximation of ordered answers with partially pooled latent lines.

Numbers of equations are those of docs/mathematics/sensitivity.md.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.sensitivity.curvature import Curvature, DerivativeSums, LatentTrials

# After so many steps a point counts as unknown.
STEPS = 200
# Newton's method has found a mode where twice the rise of the log posterior that it expects of its
# next step, (11), is less. The step, about the root of it long in SDs, is taken unseen.
# In a large study, whose components are known well, more of it changes no weight that counts.
RISE, LARGE_RISE = 1e-4, 1e-2
# If it moves edges by a larger part of the noise, curvature may be another where it ends, and the
# rise must be as small as that of a step which changes nothing.
SHORT, LEAST_RISE = 0.03, 1e-8
# A step that does not rise when it is so many times shorter is not the posterior's, but rounding's.
SHORTEST = 1e-9
# From so many different trials on a study is large.
LARGE = 8_000
# Trials times points whose derivatives are in memory at once: of many trials as many as make
# MOST_CELLS, up to LEAST_POINTS.
CELLS, LEAST_POINTS, MOST_CELLS = 30_000, 32, 300_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Components:
    """σ (points,), L of T = L L' (points, 2, 2) and the SD of discrepancies (points,)."""

    residual_sd: FloatArray
    root: FloatArray
    discrepancy_sd: FloatArray

    def at(self, points: BoolArray | IntArray) -> "Components":
        """Return the components at some of the points."""
        return Components(**{part.name: getattr(self, part.name)[points] for part in fields(self)})


@dataclass(frozen=True, eq=False)
class LatentModes:
    """At each point the mode of the latent parameters, its log posterior and curvature.

    `shared` (points, G): free thresholds, population line, discrepancies; `z` (points, subjects,
    2): each subject's departure from that line, in units of its prior; `value` (points,), NaN where
    the mode was not found; `log_evidence` (points,), log marginal likelihood at these components,
    up to a constant, NaN if it is unknown.
    """

    shared: FloatArray
    z: FloatArray
    value: FloatArray
    log_evidence: FloatArray
    curvature: Curvature

    def at(self, points: BoolArray | IntArray) -> "LatentModes":
        """Return the modes at some of the points."""
        parts = {name: getattr(self, name)[points] for name in _OF_POINTS}
        return LatentModes(**parts, curvature=self.curvature.at(points))

    def kept(self, points: BoolArray) -> "LatentModes":
        """Return the modes at some of the points in the memory of all, which are lost."""

        def moved(values: FloatArray) -> FloatArray:
            for to, at in enumerate(np.flatnonzero(points)):
                values[to] = values[at]
            return values[: points.sum()]

        parts = {name: moved(getattr(self, name)) for name in _OF_POINTS}
        own = {
            name: np.moveaxis(moved(np.moveaxis(values, -1, 0)), 0, -1)
            for name, values in self.curvature.parts.items()
        }
        return LatentModes(**parts, curvature=Curvature(**own))

    @classmethod
    def joined(cls, count: int, parts: Iterable[tuple[IntArray, "LatentModes"]]) -> "LatentModes":
        """Return `count` modes of parts, each with the numbers of its points; later ones count."""
        found: dict[str, FloatArray] = {}
        # Part by part, because a list of them and what is made of it would take twice the memory.
        for points, part in parts:
            for name in _OF_POINTS:
                values = getattr(part, name)
                found.setdefault(name, np.empty((count, *values.shape[1:])))[points] = values
            for name, values in part.curvature.parts.items():
                # A point's values lie together in memory, as `at` leaves them, too.
                room = np.moveaxis(np.empty((count, *values.shape[:-1])), 0, -1)
                found.setdefault(name, room)[..., points] = values
        of_points = {name: found.pop(name) for name in _OF_POINTS}
        return cls(**of_points, curvature=Curvature(**found))

    @property
    def own(self) -> FloatArray:
        """Each subject's departure from the population's line, (points, subjects, 2)."""
        return departures(self.curvature.root.transpose(2, 0, 1), self.z)

    @property
    def parameters(self) -> FloatArray:
        """Shared parameters, then each subject's own, in one row per point."""
        return np.concatenate([self.shared, self.z.reshape(len(self.z), -1)], axis=1)


_OF_POINTS = ("shared", "z", "value", "log_evidence")


def departures(root: FloatArray, z: FloatArray) -> FloatArray:
    """Return L z of each subject, (points, subjects, 2)."""
    return np.asarray(np.einsum("pij,psj->psi", root, z))


class LatentField:
    """The log posterior of the latent parameters of a set of trials, and its mode.

    The log posterior is concave, and the subjects are independent given the shared parameters, so
    that a Newton step costs one small system per subject and one for the shared parameters. With
    lapses it is not concave: the search then begins at the mode without them. Where Newton's step
    is not one that rises, another is taken, for which it is supposed that answers were lapses with
    the probability that they have at the present place (a step of the EM algorithm).
    """

    def __init__(self, trials: LatentTrials) -> None:
        self.trials = trials
        others = trials.without_lapses
        self._without_lapses = None if others is None else LatentField(others)
        self._sums = DerivativeSums(trials)
        self._farthest = 1 + np.abs(trials.x).max()
        self._rise = RISE if len(trials.x) <= LARGE else LARGE_RISE

    def start(self, points: int) -> tuple[FloatArray, FloatArray]:
        """Return the initial shared parameters and z at each point."""
        shared = np.tile(self.trials.shared_start, (points, 1))
        return shared, np.zeros((points, self.trials.subjects, 2))

    def modes(self, components: Components, start: tuple[FloatArray, FloatArray]) -> LatentModes:
        """Return the mode at each of the given components by Newton's method from `start`."""
        if self._without_lapses is not None:
            near = self._without_lapses.modes(components, start)
            start = near.shared, near.z
            del near  # it takes much memory
        trials, every = len(self.trials.x), np.arange(len(start[0]))
        at_once = max(CELLS // trials, min(LEAST_POINTS, MOST_CELLS // trials + 1))
        parts = (every[first : first + at_once] for first in every[::at_once])
        return LatentModes.joined(
            len(every),
            (
                (part, self._modes(components.at(part), (start[0][part], start[1][part])))
                for part in parts
            ),
        )

    def _modes(self, components: Components, start: tuple[FloatArray, FloatArray]) -> LatentModes:
        current, points = self.evaluated(*start, components), np.arange(len(start[0]))
        lost = np.flatnonzero(np.isinf(current.value))
        if lost.size:  # edges that were foreseen out of order
            again = self.evaluated(*self.start(len(lost)), components.at(lost))
            current = LatentModes.joined(len(points), [(points, current), (lost, again)])
        found, length = [], np.ones(len(points))
        shared, z, rise = self._step(current, components)
        for left in reversed(range(STEPS + 1)):
            near = self._near(shared, z, rise, components.at(points))
            # A rise that is no number has not converged either: such a point stays unknown.
            active = ~near & (rise > 0) & (length > SHORTEST) & (left > 0)
            over = ~active
            if over.any():
                found.append((points[over], _known(current, (shared, z, rise), near).at(over)))
                if over.all():
                    break
                current, points, length = current.at(active), points[active], length[active]
                shared, z, rise = shared[active], z[active], rise[active]
            moved = self.evaluated(
                current.shared + length[:, None] * shared,
                current.z + length[:, None, None] * z,
                components.at(points),
            )
            risen = moved.value > current.value
            # A short enough step rises, as the log posterior is concave: factors cost time alone.
            length = np.where(risen, np.minimum(2 * length, 1.0), length / 4)
            if risen.all():
                current = moved
            elif risen.any():
                every, up = np.arange(len(points)), np.flatnonzero(risen)
                current = LatentModes.joined(len(points), [(every, current), (up, moved.at(up))])
            shared, z, rise = self._step(current, components.at(points))
        return LatentModes.joined(len(start[0]), found)

    def _step(
        self, current: LatentModes, components: Components
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return a step that rises, and twice the rise that it expects."""
        if self._without_lapses is None:
            return _newton(current)
        # Where the curvature is no precision, its root is no number, and nor is the rise.
        with np.errstate(all="ignore"):
            shared, z, rise = _newton(current)
        falls = np.flatnonzero(~(rise >= 0))
        if falls.size:
            of_falls = current.at(falls)
            again = self.evaluated(
                of_falls.shared, of_falls.z, components.at(falls), supposed_lapses=True
            )
            shared[falls], z[falls], rise[falls] = _newton(again)
            # However small the rise, here is no mode: the search must not end.
            rise[falls] = np.maximum(rise[falls], 2 * self._rise)
        return shared, z, rise

    def _near(
        self, shared: FloatArray, z: FloatArray, rise: FloatArray, components: Components
    ) -> BoolArray:
        """Return at which points Newton's next step ends at the mode."""
        own = np.abs(departures(components.root, z)).max(axis=(1, 2))
        # An estimate of how far edges move, no bound: their parts seldom all move the same way.
        moved = (np.abs(shared).max(axis=1) + own) * self._farthest / components.residual_sd
        return np.asarray(rise < np.where(moved < SHORT, self._rise, LEAST_RISE))

    def evaluated(
        self,
        shared: FloatArray,
        z: FloatArray,
        components: Components,
        *,
        supposed_lapses: bool = False,
    ) -> LatentModes:
        """Return log posterior, gradient and curvature, -inf if edges are not in order.

        The evidence is left unknown: only that of modes is needed. With `supposed_lapses` the
        curvature is that of answers which are lapses with a known probability: it is positive.
        """
        lower, upper = self.trials.bounds(
            shared, departures(components.root, z), components.residual_sd
        )
        rising = upper > lower
        # All at once, because to look at each point takes several times as long.
        in_order = np.ones(len(shared), np.bool_) if rising.all() else rising.all(axis=0)
        if not in_order.all():
            # There is no likelihood; any edges in order will do.
            lower, upper = np.where(in_order, lower, -1.0), np.where(in_order, upper, 1.0)
        slopes = self.trials.slopes(lower, upper)
        if supposed_lapses and self._without_lapses is not None:
            attentive = self._without_lapses.trials.slopes(lower, upper)
            likelihood = self._sums.of(attentive, components.residual_sd, slopes.attended)
        else:
            likelihood = self._sums.of(slopes, components.residual_sd)
        away = shared - self.trials.shared_start
        precision = np.empty(shared.shape)
        precision[:, : self.trials.line_columns.stop] = self.trials.shared_sd**-2
        precision[:, self.trials.line_columns.stop :] = components.discrepancy_sd[:, None] ** -2
        # (8)
        squares = (z**2).sum(axis=(1, 2)) + (precision * away**2).sum(axis=1)
        value = self.trials.weight @ slopes.log_p - (squares - np.log(precision).sum(axis=1)) / 2
        curvature = Curvature.of_posterior(
            likelihood, (away, z), precision, components.root, self.trials.line_columns
        )
        value = np.where(in_order, value, -np.inf)
        unknown = np.full(len(value), np.nan)
        return LatentModes(shared, z, value, unknown, curvature)


def _known(
    at: LatentModes, step: tuple[FloatArray, FloatArray, FloatArray], near: BoolArray
) -> LatentModes:
    """Return the modes a last step away, unknown where the search has not come near."""
    shared, z, rise = step
    value = at.value + np.where(near, rise / 2, np.nan)
    # Where a search with lapses has not ended at a mode, the determinant may be below 0.
    with np.errstate(invalid="ignore"):
        log_determinant = at.curvature.log_determinant
    return replace(
        at,
        shared=at.shared + np.where(near[:, None], shared, 0.0),
        z=at.z + np.where(near[:, None, None], z, 0.0),
        value=value,
        log_evidence=value - log_determinant / 2,  # (12)
    )


def _newton(found: LatentModes) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (11): the step of shared parameters and z, and twice the rise that it expects."""
    curvature = found.curvature
    shared, z = curvature.newton_step()
    rise = (curvature.shared_gradient.T * shared).sum(axis=1)
    return shared, z, rise + (curvature.own_gradient.T * z).sum(axis=(1, 2))
