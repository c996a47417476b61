"""Laplace's approximation of ordered answers with partially pooled latent lines."""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Protocol, Self

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.sensitivity.curvature import Curvature, EdgeSlopes, Loadings, Slopes, edge_slopes

STEPS = 200
# Prior SD of thresholds and population line, in SDs of the ratings. It is so wide that it only
# keeps them finite if the answers do not overlap.
WIDE = 10.0
# Newton's method has found a mode where its next step is expected to raise the log posterior by
# less. The step before was about the root of it long, in SDs, so that flipping it changes nothing.
RISE = 1e-8
# A step that does not rise when it is so many times shorter is not the posterior's, but rounding's.
SHORTEST = 1e-9
# From so many different trials on a study is large.
LARGE = 8_000
# Trials times points whose derivatives are in memory at once.
CELLS = 200_000


class LatentTrials(Protocol):
    """Trials whose answers are intervals between edges that are linear in the parameters.

    See `OrdinalTrials`. The line's columns follow those of other shared parameters, and the
    discrepancies of conditions follow the line.
    """

    @property
    def subjects(self) -> int:
        """Their number."""
        ...

    @property
    def subject(self) -> IntArray:
        """Position of each trial's subject; the trials are sorted by it."""
        ...

    @property
    def weight(self) -> FloatArray:
        """How often each trial occurs."""
        ...

    @property
    def x(self) -> FloatArray:
        """Contrast of each trial."""
        ...

    @property
    def shared_start(self) -> FloatArray:
        """Initial values of the shared parameters."""
        ...

    @property
    def line_columns(self) -> slice:
        """Positions of the population's line among the shared parameters."""
        ...

    @property
    def loadings(self) -> Loadings:
        """How upper and lower edge depend on shared (trials, G) and own (trials, 2) parameters."""
        ...

    def some(self, step: int) -> Self:
        """Return the trials of each `step`-th subject."""
        ...

    def bounds(
        self, shared: FloatArray, own: FloatArray, sd: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return lower and upper edges about the trials' place over σ, (trials, points)."""
        ...

    def curvature(self, slopes: EdgeSlopes, residual_sd: FloatArray) -> Slopes:
        """Return the likelihood's derivatives with respect to the parameters."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Components:
    """σ (points,), L of T = L L' (points, 2, 2) and the SD of discrepancies (points,)."""

    residual_sd: FloatArray
    root: FloatArray
    discrepancy_sd: FloatArray

    def at(self, points: IntArray) -> "Components":
        """Return the components at some of the points."""
        return Components(**{part.name: getattr(self, part.name)[points] for part in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentModes:
    """At each point the mode of the latent parameters, its log posterior and curvature.

    `shared` (points, G): free thresholds, population line, discrepancies; `z` (points, subjects,
    2): each subject's departure from that line, in units of its prior; `value` (points,), NaN where
    the mode was not found.
    """

    shared: FloatArray
    z: FloatArray
    value: FloatArray
    curvature: Curvature

    def at(self, points: BoolArray) -> "LatentModes":
        """Return the modes at some of the points."""
        return LatentModes(
            shared=self.shared[points],
            z=self.z[points],
            value=self.value[points],
            curvature=self.curvature.at(points),
        )

    def replaced(self, points: IntArray, others: "LatentModes") -> "LatentModes":
        """Return these modes, with others at some of the points."""
        return LatentModes(
            shared=_with(self.shared, points, others.shared),
            z=_with(self.z, points, others.z),
            value=_with(self.value, points, others.value),
            curvature=Curvature(
                **{
                    part.name: _with(
                        getattr(self.curvature, part.name),
                        points,
                        getattr(others.curvature, part.name),
                    )
                    for part in fields(Curvature)
                }
            ),
        )

    @classmethod
    def joined(cls, parts: Iterable["LatentModes"]) -> "LatentModes":
        """Return the modes at the points of all parts."""
        every = list(parts)
        if len(every) == 1:
            return every[0]
        return cls(
            **{
                name: np.concatenate([getattr(part, name) for part in every])
                for name in ("shared", "z", "value")
            },
            curvature=Curvature(
                **{
                    part.name: np.concatenate([getattr(one.curvature, part.name) for one in every])
                    for part in fields(Curvature)
                }
            ),
        )

    @property
    def own(self) -> FloatArray:
        """Each subject's departure from the population's line, (points, subjects, 2)."""
        return departures(self.curvature.root, self.z)

    @property
    def log_evidence(self) -> FloatArray:
        """Log marginal likelihood at these components, up to a constant; NaN if it is unknown."""
        # (26), mathematics/sensitivity
        return self.value - self.curvature.log_determinant / 2

    @property
    def parameters(self) -> FloatArray:
        """Shared parameters, then each subject's own, in one row per point."""
        return np.concatenate([self.shared, self.z.reshape(len(self.z), -1)], axis=1)


def departures(root: FloatArray, z: FloatArray) -> FloatArray:
    """Return L z of each subject, (points, subjects, 2)."""
    return np.asarray(np.einsum("pij,psj->psi", root, z))


def _with(values: FloatArray, points: IntArray, others: FloatArray) -> FloatArray:
    changed = values.copy()
    changed[points] = others
    return changed


class LatentField:
    """The log posterior of the latent parameters of a set of trials, and its mode.

    The log posterior is concave, and the subjects are independent given the shared parameters, so
    that a Newton step costs one small system per subject and one for the shared parameters.
    """

    def __init__(self, trials: LatentTrials) -> None:
        self.trials = trials

    def start(self, points: int) -> tuple[FloatArray, FloatArray]:
        """Return the initial shared parameters and z at each point."""
        shared = np.tile(self.trials.shared_start, (points, 1))
        return shared, np.zeros((points, self.trials.subjects, 2))

    def modes(self, components: Components, start: tuple[FloatArray, FloatArray]) -> LatentModes:
        """Return the mode at each of the given components by Newton's method from `start`."""
        at_once = max(CELLS // len(self.trials.x), 1)
        every = np.arange(len(start[0]))
        return LatentModes.joined(
            self._modes(components.at(part), (start[0][part], start[1][part]))
            for part in (every[first : first + at_once] for first in every[::at_once])
        )

    def _modes(self, components: Components, start: tuple[FloatArray, FloatArray]) -> LatentModes:
        current = self.evaluated(*start, components)
        lost = np.flatnonzero(np.isinf(current.value))
        if lost.size:  # edges that were foreseen out of order
            again = self.evaluated(*self.start(len(lost)), components.at(lost))
            current = current.replaced(lost, again)
        (shared, z), rise = _newton(current)
        length = np.ones(len(rise))
        for _ in range(STEPS):
            # A rise that is no number has not converged either: such a point stays unknown.
            active = np.flatnonzero((rise >= RISE) & (length > SHORTEST))
            if not active.size:
                break
            size = length[active]
            moved = self.evaluated(
                current.shared[active] + size[:, None] * shared[active],
                current.z[active] + size[:, None, None] * z[active],
                components.at(active),
            )
            risen = moved.value > current.value[active]
            length[active] = np.where(risen, np.minimum(2 * size, 1.0), size / 4)
            if not risen.any():
                continue
            to, moved = active[risen], moved.at(risen)
            current = current.replaced(to, moved)
            (shared[to], z[to]), rise[to] = _newton(moved)
        return replace(current, value=np.where(rise < RISE, current.value, np.nan))

    def evaluated(self, shared: FloatArray, z: FloatArray, components: Components) -> LatentModes:
        """Return log posterior, gradient and curvature, -inf if edges are not in order."""
        lower, upper = self.trials.bounds(
            shared, departures(components.root, z), components.residual_sd
        )
        in_order = (upper > lower).all(axis=0)
        # Elsewhere there is no likelihood; any edges in order will do.
        slopes = edge_slopes(np.where(in_order, lower, -1.0), np.where(in_order, upper, 1.0))
        likelihood = self.trials.curvature(slopes, components.residual_sd)
        away = shared - self.trials.shared_start
        precision = self._shared_prior(components)
        # (22), mathematics/sensitivity
        squares = (z**2).sum(axis=(1, 2)) + (precision * away**2).sum(axis=1)
        value = self.trials.weight @ slopes.log_p - (squares - np.log(precision).sum(axis=1)) / 2
        return LatentModes(
            shared=shared,
            z=z,
            value=np.where(in_order, value, -np.inf),
            curvature=Curvature.of_posterior(likelihood, (away, z), precision, components.root),
        )

    def _shared_prior(self, components: Components) -> FloatArray:
        """Return the prior precision of each shared parameter about its initial value."""
        shape = len(components.residual_sd), len(self.trials.shared_start)
        prior = np.full(shape, WIDE**-2)
        prior[:, self.trials.line_columns.stop :] = components.discrepancy_sd[:, None] ** -2
        return prior


def _newton(found: LatentModes) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Return Newton's step of shared parameters and z, and twice the rise that it expects."""
    curvature = found.curvature
    shared, z = curvature.newton_step()
    rise = (curvature.shared_gradient * shared).sum(axis=1)
    return (shared, z), rise + (curvature.own_gradient * z).sum(axis=(1, 2))
