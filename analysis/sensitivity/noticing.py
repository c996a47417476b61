"""Noticing of changes: a probit model in contrast, with each subject's noise and criterion.

Numbers of equations are those of docs/mathematics/sensitivity.md, "M3".
"""

from dataclasses import dataclass
from functools import cached_property, partial
from typing import ClassVar

import numpy as np
from scipy.special import ndtr

from analysis.estimates import BoolArray, FloatArray, IntArray, Interval, NotEstimable, central
from analysis.sensitivity.curvature import LatentTrials, counted
from analysis.sensitivity.integration import Marginals, settled
from analysis.sensitivity.laplace import WIDE, Components, LatentField
from analysis.sensitivity.latent_posterior import LatentPosterior, integrated
from analysis.sensitivity.lines import Ratings, log_prior_of_spread, roots_of_covariances

OPPOSITE, SAME, EXPECTED = -1, 0, 1
# log τ_criterion, log τ_d′, artanh ρ and log τ_discrepancy, in SDs of the noise.
START = np.array([-0.7, -0.3, 0.0, -1.5])
FEWEST_CONDITIONS = 3
# The lean is one unit of its parameter over WIDE, so that its prior SD is 1.
LEAN = 1 / WIDE
RATE_DRAWS = 4000


@dataclass(frozen=True, kw_only=True, eq=False)
class NoticingTrials(LatentTrials):
    """Answers to whether something changed; x is relative to the reference contrast.

    A subject reports the expected change if lean + d x + sign(x) δ_c + ε > κ, the opposite change
    if that is below -κ, and none in between; ε ~ N(0, 1). The line is (κ, d), the criterion and the
    d′ at x = 1. δ_c is zero without a change.

    Parameters:
        answer: shape (trials,), 1 the expected change, 0 the same, -1 the opposite change.
        two_sided: shape (trials,), whether the opposite change could be answered.
    """

    answer: IntArray
    two_sided: BoolArray
    answers: ClassVar = ("answer", "two_sided")

    @property
    def shared_start(self) -> FloatArray:
        """Initial lean, criterion, d′ and discrepancies."""
        return np.concatenate([[0.0, 1.0, 1.0], np.zeros(self.conditions)])

    @property
    def line_columns(self) -> slice:
        """Those after the lean."""
        return slice(1, 3)

    @cached_property
    def signs(self) -> tuple[FloatArray, FloatArray]:
        """(s_u, s_l) of (16), of upper and lower edge of each trial; 0 if that is infinite."""
        upper = np.select([self.answer == EXPECTED, self.answer == SAME], [0.0, 1.0], -1.0)
        below = np.where(self.two_sided, -1.0, 0.0)
        lower = np.select([self.answer == EXPECTED, self.answer == SAME], [1.0, below], 0.0)
        return upper, lower

    def bounds(
        self, shared: FloatArray, own: FloatArray, sd: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return (16); σ is 1."""
        lines = np.ascontiguousarray((own + shared[:, None, self.line_columns]).T)
        criterion, place = (each.take(self.subject, axis=0) for each in lines)
        place *= self.x[:, None]
        place += LEAN * shared[:, 0]
        if self.conditions:
            effects = np.ascontiguousarray(shared.T[self.line_columns.stop :])
            place += np.sign(self.x)[:, None] * effects.take(self.condition, axis=0)
        upper, lower = (sign[:, None] * criterion for sign in self.signs)
        for edge, sign, beyond in zip((upper, lower), self.signs, (np.inf, -np.inf), strict=True):
            np.divide(np.subtract(edge, place, out=edge), sd, out=edge)
            edge[sign == 0] = beyond
        return lower, upper

    @cached_property
    def loadings(self) -> tuple[FloatArray, FloatArray]:
        """The signs of the criterion, less the loadings of the place."""
        upper, lower = np.zeros((2, len(self.x), len(self.shared_start)))
        for loading, sign in zip((upper, lower), self.signs, strict=True):
            loading[:, 0], loading[:, 1], loading[:, 2] = -LEAN, sign, -self.x
            if self.conditions:
                trials = np.arange(len(self.x))
                loading[trials, self.line_columns.stop + self.condition] = -np.sign(self.x)
            loading[sign == 0] = 0.0
        return upper, lower


@dataclass(frozen=True, kw_only=True)
class ChangeDetection:
    """How well one subject notices changes, with 95% intervals.

    `d_prime` is the reference contrast over the SD of the noise; `criterion` is the felt contrast,
    in the same unit, above which the subject reports the expected change. Both are posterior
    medians, because their posteriors are skewed to the right. `false_alarm_rate` is the probability
    that a change in either direction is reported without one.
    """

    subject: str
    d_prime: float
    d_prime_interval: Interval
    criterion: float
    criterion_interval: Interval
    false_alarm_rate: float
    false_alarm_rate_interval: Interval


@dataclass(frozen=True, kw_only=True)
class Noticed:
    """What the noticing stage tells of each subject; `reference` is the contrast of d′."""

    detection: tuple[ChangeDetection, ...]
    reference: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Noticing:
    """The posterior of the noticing stage; `reference` is the contrast that d′ refers to."""

    trials: NoticingTrials
    posterior: LatentPosterior
    subjects: tuple[str, ...]
    reference: float

    @cached_property
    def _found(self) -> Marginals:
        """d′ of each subject, and then each one's criterion."""
        d_primes = self.posterior.of_lines(np.array([0.0, 1.0]))
        criteria = self.posterior.of_lines(np.array([1.0, 0.0]))
        criteria.shared[:, 0] = -LEAN
        return self.posterior.marginals(d_primes.followed_by(criteria))

    @cached_property
    def _intervals(self) -> list[Interval]:
        return self._found.interval_95(self.posterior.points.weights)

    @cached_property
    def refusal(self) -> NotEstimable | None:
        """Why noticing is not known, or None."""
        return self.posterior.points.refusal((self._found, self._intervals))

    @property
    def told(self) -> Noticed:
        """d′, criterion and false-alarm rate of each subject."""
        posterior, weights, found = self.posterior, self.posterior.points.weights, self._found
        (medians,), intervals = found.quantiles(weights, 0.5), self._intervals
        draws = posterior.draws(RATE_DRAWS, np.random.default_rng(0))
        criteria, lean = draws.own[..., 0], LEAN * draws.shared[:, 0]

        def false_alarms(row: int) -> FloatArray:
            own = criteria[:, row] + draws.shared[:, 1]
            # (20). A criterion below 0, which the normal approximation allows: nothing is "same"
            # then.
            return np.minimum(np.asarray(ndtr(lean - own) + ndtr(-lean - own)), 1.0)

        count = len(self.subjects)
        detection = tuple(
            ChangeDetection(
                subject=name,
                d_prime=float(medians[row]),
                d_prime_interval=intervals[row],
                criterion=float(medians[count + row]),
                criterion_interval=intervals[count + row],
                false_alarm_rate=float(rates.mean()),
                false_alarm_rate_interval=central(rates),
            )
            # One by one: the rates of all would take as much memory as the posterior.
            for row, (name, rates) in enumerate(
                zip(self.subjects, map(false_alarms, range(count)), strict=True)
            )
        )
        return Noticed(detection=detection, reference=self.reference)


def noticing(ratings: Ratings, answer: IntArray, two_sided: BoolArray) -> Noticing:
    """Return the fit of the noticing stage. At least one contrast must be positive.

    Parameters:
        ratings: all trials, contrasts signed by the condition's expected direction.
        answer: shape (trials,), 1 the expected change, 0 the same, -1 the opposite change.
        two_sided: shape (trials,), whether the question offers the opposite change.
    """
    reference = float(ratings.contrast[ratings.contrast > 0].mean())
    columns = (ratings.subject, ratings.condition, ratings.contrast / reference, answer, two_sided)
    rows, weight = counted(np.stack(columns, axis=-1))
    used = len(np.unique(ratings.condition[ratings.contrast != 0]))
    trials = NoticingTrials(
        subjects=len(ratings.subjects),
        conditions=len(ratings.conditions) if used >= FEWEST_CONDITIONS else 0,
        subject=rows[:, 0].astype(np.int64),
        condition=rows[:, 1].astype(np.int64),
        x=rows[:, 2],
        answer=rows[:, 3].astype(np.int64),
        two_sided=rows[:, 4].astype(np.bool_),
        weight=weight,
    )
    start = START if trials.conditions else START[:-1]
    of = partial(Noticing, trials=trials, subjects=ratings.subjects, reference=reference)
    known = integrated(LatentField(trials), start, _components, _log_prior)
    return settled(known, lambda posterior: of(posterior=posterior))


def _components(points: FloatArray) -> Components:
    return Components(
        residual_sd=np.ones(len(points)),
        root=roots_of_covariances(points[:, :3]),
        discrepancy_sd=np.exp(points[:, 3]) if points.shape[1] > 3 else np.ones(len(points)),
    )


def _log_prior(points: FloatArray) -> FloatArray:
    spread = log_prior_of_spread(points[:, :2]).sum(axis=1) - 2 * np.log(np.cosh(points[:, 2]))
    others = points[:, 3:]
    return np.asarray(spread + (others - np.log1p(np.exp(2 * others))).sum(axis=1))
