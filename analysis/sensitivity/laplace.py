"""Laplace's approximation of ordered answers with partially pooled latent lines."""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Protocol, Self

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.sensitivity.curvature import Curvature, EdgeSlopes, Loadings, edge_slopes

STEPS = 60
# Prior SD of thresholds and population line, in SDs of the ratings. It is so wide that it only
# keeps them finite if the answers do not overlap.
WIDE = 10.0
# Newton's method makes its last step if that is expected to raise the log posterior by less; with
# more than LARGE different trials, by less than LARGE_RISE.
RISE, LARGE_RISE = 1e-4, 1e-2
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

    def curvature(self, slopes: EdgeSlopes, residual_sd: FloatArray) -> Curvature:
        """Return the likelihood's derivatives with respect to the parameters."""
        ...


NOWHERE = -1e9
"""The log evidence of a point that the likelihood says nothing about."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Components:
    """σ (points,), T (points, 2, 2) and the SD of discrepancies (points,)."""

    residual_sd: FloatArray
    between: FloatArray
    discrepancy_sd: FloatArray

    def at(self, points: IntArray) -> "Components":
        """Return the components at some of the points."""
        return Components(**{part.name: getattr(self, part.name)[points] for part in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentModes:
    """At each point the mode of the latent parameters, its log posterior and curvature.

    `shared` (points, G): free thresholds, population line, discrepancies; `own` (points, subjects,
    2): each subject's departure from that line; `value` (points,).
    """

    shared: FloatArray
    own: FloatArray
    value: FloatArray
    curvature: Curvature

    def at(self, points: BoolArray) -> "LatentModes":
        """Return the modes at some of the points."""
        return LatentModes(
            shared=self.shared[points],
            own=self.own[points],
            value=self.value[points],
            curvature=self.curvature.at(points),
        )

    def replaced(self, points: IntArray, others: "LatentModes") -> "LatentModes":
        """Return these modes, with others at some of the points."""
        return LatentModes(
            shared=_with(self.shared, points, others.shared),
            own=_with(self.own, points, others.own),
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
                for name in ("shared", "own", "value")
            },
            curvature=Curvature(
                **{
                    part.name: np.concatenate([getattr(one.curvature, part.name) for one in every])
                    for part in fields(Curvature)
                }
            ),
        )

    @property
    def log_evidence(self) -> FloatArray:
        """Log marginal likelihood at these components, up to a constant."""
        with np.errstate(all="ignore"):  # far out the curvature can be no number
            found = self.value - self.curvature.log_determinant / 2
        return np.where(np.isfinite(found), found, NOWHERE)

    @property
    def parameters(self) -> FloatArray:
        """Shared parameters, then each subject's own, in one row per point."""
        return np.concatenate([self.shared, self.own.reshape(len(self.own), -1)], axis=1)


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
        """Return the initial shared and own parameters at each point."""
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
        (shared, own), rise = _newton(current)
        length = np.ones(len(rise))
        least = RISE if len(self.trials.x) <= LARGE else LARGE_RISE
        for _ in range(STEPS):
            active = np.flatnonzero(rise >= least)
            if not active.size:
                break
            size = length[active]
            moved = self.evaluated(
                current.shared[active] + size[:, None] * shared[active],
                current.own[active] + size[:, None, None] * own[active],
                components.at(active),
            )
            risen = moved.value > current.value[active]
            length[active] = np.where(risen, 1.0, size / 2)
            if not risen.any():
                continue
            to, moved = active[risen], moved.at(risen)
            current = current.replaced(to, moved)
            (shared[to], own[to]), rise[to] = _newton(moved)
        return replace(
            current,
            shared=current.shared + shared,
            own=current.own + own,
            value=current.value + rise / 2,
        )

    def in_order(self, shared: FloatArray, own: FloatArray) -> BoolArray:
        """Return at which points each trial's upper edge is above its lower one."""
        lower, upper = self.trials.bounds(shared, own, np.ones(len(shared)))
        return np.asarray((upper > lower).all(axis=0))

    def evaluated(self, shared: FloatArray, own: FloatArray, components: Components) -> LatentModes:
        """Return log posterior, gradient and curvature, -inf if edges are not in order."""
        # A step that is too long may overflow; it is shortened.
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            lower, upper = self.trials.bounds(shared, own, components.residual_sd)
            slopes = edge_slopes(lower, upper)
            likelihood = self.trials.curvature(slopes, components.residual_sd)
        departures = shared - self.trials.shared_start, own
        precision = np.asarray(np.linalg.inv(components.between), dtype=np.float64)
        shared_precision = self._shared_prior(components)
        squares = np.einsum("psi,pij,psj->p", own, precision, own)
        squares += (shared_precision * departures[0] ** 2).sum(axis=1)
        determinants = own.shape[1] * np.linalg.slogdet(precision)[1]
        determinants += np.log(shared_precision).sum(axis=1)
        value = self.trials.weight @ slopes.log_p - (squares - determinants) / 2
        return LatentModes(
            shared=shared,
            own=own,
            value=np.where((upper > lower).all(axis=0), value, -np.inf),
            curvature=likelihood.with_prior(departures, shared_precision, precision),
        )

    def _shared_prior(self, components: Components) -> FloatArray:
        """Return the prior precision of each shared parameter about its initial value."""
        shape = len(components.residual_sd), len(self.trials.shared_start)
        prior = np.full(shape, WIDE**-2)
        prior[:, self.trials.line_columns.stop :] = components.discrepancy_sd[:, None] ** -2
        return prior


def _newton(found: LatentModes) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Return Newton's step of shared and own parameters, and the rise that it expects."""
    curvature = found.curvature
    shared, own = curvature.newton_step()
    rise = (curvature.shared_gradient * shared).sum(axis=1)
    return (shared, own), rise + (curvature.own_gradient * own).sum(axis=(1, 2))
