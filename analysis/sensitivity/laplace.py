"""Laplace's approximation of ordered answers with partially pooled latent lines."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.sensitivity.curvature import Curvature, OrdinalTrials, curvature_of
from analysis.statistics.ordinal_likelihood import log_interval

STEPS = 60
HALVINGS = 30
# Prior SD of thresholds and population line, in SDs of the ratings. It is so wide that it only
# keeps them finite if the answers do not overlap.
WIDE = 10.0
# Newton's method stops if its step is expected to raise the log posterior by less than this.
RISE = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Components:
    """Variance components: σ, covariance between subjects, SD of discrepancies."""

    residual_sd: float
    between: FloatArray
    discrepancy_sd: float


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentMode:
    """The posterior mode of the latent parameters, with the log posterior and curvature there.

    `shared` (G,): free thresholds, population line, discrepancies; `own` (subjects, 2): each
    subject's departure from that line.
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
    """The log posterior of the latent parameters of a set of trials, and its mode.

    The log posterior is concave, and the subjects are independent given the shared parameters, so
    that a Newton step costs one small system per subject and one for the shared parameters.
    """

    def __init__(self, trials: OrdinalTrials) -> None:
        self.trials = trials

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Return the initial shared and own parameters."""
        return self.trials.shared_start, np.zeros((self.trials.subjects, 2))

    def mode(self, components: Components, start: tuple[FloatArray, FloatArray]) -> LatentMode:
        """Return the mode at the given components by Newton's method from `start`."""
        shared, own = start
        value = self.value(shared, own, components)
        for _ in range(STEPS):
            found = self.curvature(shared, own, components)
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
        """Return the parameters after the step, shortened until the posterior rises."""
        shared, own, value = current
        length = 1.0
        for _ in range(HALVINGS):
            to = shared + length * step[0], own + length * step[1]
            reached = self.value(*to, components)
            if reached > value:
                return *to, reached
            length /= 2
        return current

    def _bounds(
        self, shared: FloatArray, own: FloatArray, components: Components
    ) -> tuple[FloatArray, FloatArray]:
        edges = self.trials.edges(shared)
        location = self.trials.location(shared, own)
        lower = edges[self.trials.category] - location
        upper = edges[self.trials.category + 1] - location
        return lower / components.residual_sd, upper / components.residual_sd

    def value(self, shared: FloatArray, own: FloatArray, components: Components) -> float:
        """Return the log posterior, -inf if the thresholds are not in order."""
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
        """Return the prior precision of each shared parameter about its initial value."""
        prior = np.full(len(self.trials.shared_start), WIDE**-2)
        prior[self.trials.line_columns.stop :] = components.discrepancy_sd**-2
        return prior

    def curvature(self, shared: FloatArray, own: FloatArray, components: Components) -> Curvature:
        """Return gradient and curvature of the log posterior, including the prior."""
        departures = shared - self.trials.shared_start, own
        precision = np.asarray(np.linalg.inv(components.between), dtype=np.float64)
        bounds = self._bounds(shared, own, components)
        likelihood = curvature_of(self.trials, bounds, components.residual_sd)
        return likelihood.with_prior(departures, self._shared_prior(components), precision)
