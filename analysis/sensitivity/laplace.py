"""Laplace's approximation for ordered answers about partially pooled latent lines."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.sensitivity.curvature import Curvature, OrdinalTrials, curvature_of
from analysis.statistics.ordinal_likelihood import log_interval

STEPS = 60
HALVINGS = 30
# Standard deviation, in those of the ratings, of the prior of thresholds and population line: it
# says nothing but that they are finite where people's answers do not overlap.
WIDE = 10.0
# Newton's method stops when it promises to raise the log posterior by less than this.
RISE = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Components:
    """One value of what is integrated over: σ, covariance of subjects, SD of discrepancies."""

    residual_sd: float
    between: FloatArray
    discrepancy_sd: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentMode:
    """The most probable latent numbers and the curvature there.

    `shared` (G,): free thresholds, population line, discrepancies; `own` (subjects, 2): each
    subject's departure from that line; `value` is the log posterior there.
    """

    shared: FloatArray
    own: FloatArray
    value: float
    curvature: Curvature

    @property
    def log_evidence(self) -> float:
        """Log marginal likelihood at these components, up to a constant."""
        own = np.linalg.slogdet(self.curvature.own_precision)[1].sum()
        return float(self.value - (own + np.linalg.slogdet(self.curvature.shared_precision)[1]) / 2)

    def contrast(self, of_shared: FloatArray, of_own: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and variance of `of_shared · shared + of_own · own` for each subject."""
        inverse = np.linalg.inv(self.curvature.shared_precision)
        alone = np.linalg.solve(self.curvature.own_precision, of_own)
        reach = of_shared - np.einsum("si,sig->sg", alone, self.curvature.cross)
        variance = alone @ of_own + ((reach @ inverse) * reach).sum(axis=1)
        return self.own @ of_own + float(of_shared @ self.shared), variance


class LatentField:
    """The latent numbers of one set of trials; `mode` finds the best of them by Newton's method.

    The log posterior is concave, and given what is shared the subjects are independent, so that a
    step costs one small system per subject and one for what is shared.
    """

    def __init__(self, trials: OrdinalTrials) -> None:
        self.trials = trials

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return shared and own numbers to begin with."""
        return self.trials.shared_start, np.zeros((self.trials.subjects, 2))

    def mode(self, components: Components, start: tuple[FloatArray, FloatArray]) -> LatentMode:
        """Return the mode at the given components, searched from the given numbers."""
        shared, own = start
        value = self._value(shared, own, components)
        for _ in range(STEPS):
            found = self._curvature(shared, own, components)
            step = found.newton_step()
            rise = found.shared_gradient @ step[0] + (found.own_gradient * step[1]).sum()
            if rise < RISE:
                break
            shared, own, value = self._advance((shared, own, value), step, components)
        return LatentMode(shared=shared, own=own, value=value, curvature=found)

    def _advance(
        self,
        current: tuple[FloatArray, FloatArray, float],
        step: tuple[FloatArray, FloatArray],
        components: Components,
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return the numbers after the step, shortened until the posterior rises."""
        shared, own, value = current
        length = 1.0
        for _ in range(HALVINGS):
            to = shared + length * step[0], own + length * step[1]
            reached = self._value(*to, components)
            if reached > value:
                return *to, reached
            length /= 2
        return current

    def _bounds(
        self, shared: FloatArray, own: FloatArray, components: Components
    ) -> tuple[FloatArray, FloatArray]:
        edges = self.trials.edges(shared)
        location = self.trials.location(shared, own)
        lower, upper = edges[self.trials.category], edges[self.trials.category + 1]
        return (lower - location) / components.residual_sd, (
            upper - location
        ) / components.residual_sd

    def _value(self, shared: FloatArray, own: FloatArray, components: Components) -> float:
        if (np.diff(self.trials.edges(shared)) <= 0).any():
            return -np.inf
        lower, upper = self._bounds(shared, own, components)
        likelihood = float(self.trials.weight @ log_interval(lower, upper, "probit"))
        precision = np.linalg.inv(components.between)
        shared_precision = self._shared_prior(components)
        squares = ((own @ precision) * own).sum()
        squares += shared_precision @ (shared - self.trials.shared_start) ** 2
        determinants = len(own) * np.linalg.slogdet(precision)[1] + np.log(shared_precision).sum()
        return likelihood - float(squares - determinants) / 2

    def _shared_prior(self, components: Components) -> FloatArray:
        """Return the prior precision of each shared number about where its search begins."""
        prior = np.full(len(self.trials.shared_start), WIDE**-2)
        prior[self.trials.line_columns.stop :] = components.discrepancy_sd**-2
        return prior

    def _curvature(self, shared: FloatArray, own: FloatArray, components: Components) -> Curvature:
        """Return gradient and curvature of the log posterior, prior included."""
        departures = shared - self.trials.shared_start, own
        precision = np.asarray(np.linalg.inv(components.between), dtype=np.float64)
        return curvature_of(
            self.trials,
            self._bounds(shared, own, components),
            components.residual_sd,
        ).with_prior(departures, self._shared_prior(components), precision)
