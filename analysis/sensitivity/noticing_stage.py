"""How changes are noticed: a probit model of answers, with each subject's d and criterion.

Numbers of equations are those of docs/mathematics/answers.md.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from analysis.estimates import BoolArray, Estimate, FloatArray, IntArray, NotEstimable
from analysis.sensitivity import lines
from analysis.sensitivity.curvature import (
    BEYOND,
    WIDE,
    EdgeSlopes,
    LatentTrials,
    counted,
    edge_slopes,
    mills_ratio,
)
from analysis.sensitivity.integration import Marginals, settled
from analysis.sensitivity.laplace import Components, LatentField
from analysis.sensitivity.latent_posterior import LatentPosterior, integrated
from analysis.sensitivity.rating_stage import estimates_of

LAPSE = 0.02
"""Share of trials in which each answer is as likely; few answers do not tell it."""
FEWEST_CONDITIONS = 3
OPPOSITE, SAME, EXPECTED = -1, 0, 1
LEAN = 1 / WIDE
"""The lean is so many times its parameter, whose prior SD is `WIDE`, so that its own is 1."""
# log τ_k, log τ_d and log τ_ε, in SDs of the noise.
START = np.array([-1.0, -1.0, -1.0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Answered:
    """Trials with what was answered.

    Parameters:
        ratings: contrasts are in the direction that the trial expects, 0 on a catch trial.
        answer: shape (trials,), 1 the expected change, 0 the same, -1 the contrary.
        two_sided: shape (trials,), whether the question offers the contrary.
        first: shape (trials,), whether the expected change is the first answer of its question.
        catch: shape (trials,), whether nothing changed; all contrasts are 0 there.

    Raises:
        ValueError: an invalid answer, or not one per trial.
    """

    ratings: lines.Ratings
    answer: IntArray
    two_sided: BoolArray
    first: BoolArray
    catch: BoolArray

    def __post_init__(self) -> None:
        count = len(self.ratings.rating)
        for name in ("answer", "two_sided", "first", "catch"):
            if len(getattr(self, name)) != count:
                got = len(getattr(self, name))
                raise ValueError(f"{name} must have {count} trials, got {got}")
        other = self.answer[~np.isin(self.answer, [OPPOSITE, SAME, EXPECTED])]
        if other.size:
            raise ValueError(f"an answer must be -1, 0 or 1, got {other[0]}")

    @property
    def expected(self) -> BoolArray:
        """The changes that were answered as expected."""
        return np.asarray(~self.catch & (self.answer == EXPECTED))

    @property
    def share_noticed(self) -> float:
        """Share of changes that were answered as expected."""
        return float(self.expected.sum() / (~self.catch).sum())

    @property
    def sign(self) -> FloatArray:
        """r, 1 where the expected change is the first answer of its question, else -1."""
        return np.where(self.first, 1.0, -1.0)

    @property
    def unit(self) -> float:
        """The SD of the contrasts of changes, or the largest one where all are the same."""
        contrast = self.ratings.contrast[~self.catch]
        most = float(np.abs(contrast).max())
        spread = float(contrast.std())
        return spread if spread > 1e-9 * most else most


@dataclass(frozen=True, kw_only=True, eq=False)
class NoticingTrials(LatentTrials):
    """Answers to whether something changed; x is in SDs of the contrasts.

    The line is (k, d). With the place m = d x + sign(x) ε_c + l `towards`, the expected change is
    answered if m + e > k, the contrary if that is below -k, the same between; e ~ N(0, 1). In a
    share `lapse` of trials all answers are equally likely.

    Parameters:
        answer: shape (trials,), 1 the expected change, 0 the same, -1 the contrary.
        two_sided: shape (trials,), whether the contrary could be answered.
        towards: shape (trials,), by which the lean is multiplied: 1 where it is towards the
            expected change.
        lapse: share of lapses.
    """

    answer: IntArray
    two_sided: BoolArray
    towards: FloatArray
    lapse: float = 0.0
    answers: ClassVar = ("answer", "two_sided", "towards")

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
        """(s_u, s_l) of (3), of upper and lower edge of each trial; 0 if that is infinite."""
        upper = np.select([self.answer == EXPECTED, self.answer == SAME], [0.0, 1.0], -1.0)
        below = np.where(self.two_sided, -1.0, 0.0)
        lower = np.select([self.answer == EXPECTED, self.answer == SAME], [1.0, below], 0.0)
        return upper, lower

    def bounds(
        self, shared: FloatArray, own: FloatArray, sd: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return (3); σ is 1."""
        lines = np.ascontiguousarray((own + shared[:, None, self.line_columns]).T)
        criterion, place = (each.take(self.subject, axis=0) for each in lines)
        place *= self.x[:, None]
        place += self.towards[:, None] * (LEAN * shared[:, 0])
        if self.conditions:
            effects = np.ascontiguousarray(shared.T[self.line_columns.stop :])
            place += np.sign(self.x)[:, None] * effects.take(self.condition, axis=0)
        upper, lower = (sign[:, None] * criterion for sign in self.signs)
        for edge, sign, beyond in zip((upper, lower), self.signs, (np.inf, -np.inf), strict=True):
            np.divide(np.subtract(edge, place, out=edge), sd, out=edge)
            edge[sign == 0] = beyond
        return lower, upper

    def slopes(self, lower: FloatArray, upper: FloatArray) -> EdgeSlopes:
        """Return log P of each answer, lapses among them, with its slopes by the edges."""
        attentive = edge_slopes(lower, upper)
        if not self.lapse:
            return attentive
        return attentive.with_lapses(self.lapse, -np.log(np.where(self.two_sided, 3.0, 2.0)))

    @cached_property
    def without_lapses(self) -> Self | None:
        """The trials as if no answer were a lapse."""
        return replace(self, lapse=0.0) if self.lapse else None

    @cached_property
    def loadings(self) -> tuple[FloatArray, FloatArray]:
        """The signs of the criterion, less the loadings of the place."""
        upper, lower = np.zeros((2, len(self.x), len(self.shared_start)))
        for loading, sign in zip((upper, lower), self.signs, strict=True):
            loading[:, 0], loading[:, 1], loading[:, 2] = -LEAN * self.towards, sign, -self.x
            if self.conditions:
                trials = np.arange(len(self.x))
                loading[trials, self.line_columns.stop + self.condition] = -np.sign(self.x)
            loading[sign == 0] = 0.0
        return upper, lower


@dataclass(frozen=True, kw_only=True, eq=False)
class NoticingStage:
    """The posterior of noticing, integrated over the spread of d and k and that of ε.

    n = d_s x + sign(x) ε_c + e, e ~ N(0, 1), is answered as expected above k_s + r l, as the
    contrary below -(k_s - r l), and as the same between. ε_c is by how much better a condition is
    noticed than its contrast says, 0 without a change.
    """

    answered: Answered
    posterior: LatentPosterior

    @cached_property
    def _marginals(self) -> Marginals:
        """The d of each subject and of the group, k of each subject and of the group, l and ε."""
        d, k = (self.posterior.of_lines(of) for of in np.eye(2)[::-1])
        (size,) = self.posterior.trials.shared_start.shape
        lean = LEAN * np.eye(1, size)
        return self.posterior.marginals(
            d.followed_by(
                d.shared_only(d.shared[:1]),
                k,
                k.shared_only(k.shared[:1]),
                k.shared_only(lean),
                k.shared_only(np.eye(size)[self.posterior.trials.line_columns.stop :]),
            )
        )

    @cached_property
    def _estimates(self) -> list[Estimate]:
        return estimates_of(self._marginals, self.posterior.points.weights)

    @property
    def slopes(self) -> list[Estimate]:
        """The d of each subject, and then the group's: SDs of the noise per SD of the contrasts."""
        return self._estimates[: self._people]

    @property
    def criteria(self) -> list[Estimate]:
        """The k of each subject, and then the group's, in SDs of the noise."""
        return self._estimates[self._people : 2 * self._people]

    @property
    def lean(self) -> Estimate:
        """l, by how much less readily the first answer of a question is given."""
        return self._estimates[2 * self._people]

    @cached_property
    def p(self) -> float:
        """Twice the smaller posterior probability that the group's d is above 0, or below."""
        above = self._marginals.above_zero(self.posterior.points.weights)[self._people - 1]
        return float(2 * min(above, 1 - above))

    @property
    def _people(self) -> int:
        return len(self.answered.ratings.subjects) + 1

    @cached_property
    def refusal(self) -> NotEstimable | None:
        """Why noticing is not known, or None."""
        lines_of = slice(2 * self._people)
        intervals = [estimate.interval for estimate in self._estimates[lines_of]]
        return self.posterior.points.refusal((self._marginals.part(lines_of), intervals))

    def selection_at(self, d: FloatArray, k: FloatArray, lean: float, of: FloatArray) -> FloatArray:
        """Return φ(a)/Φ(a) of each trial, a = d_s x + sign(x) ε_c - k_s - r l.

        It is how far above its mean the noise is, on average, of those who notice the change.

        Parameters:
            d, k: shape (subjects,).
            lean: l.
            of: ε of each condition, or none.
        """
        ratings = self.answered.ratings
        x = ratings.contrast / self.answered.unit
        a = d[ratings.subject] * x - k[ratings.subject] - self.answered.sign * lean
        if of.size:
            a += np.sign(x) * of[ratings.condition]
        return 1 / mills_ratio(np.maximum(-a, BEYOND))

    @cached_property
    def selection(self) -> FloatArray:
        """The column at posterior means, shape (trials,)."""
        means = self.posterior.points.weights @ self._marginals.means
        people = self._people
        others = means[2 * people :]
        d, k = means[: people - 1], means[people : 2 * people - 1]
        return self.selection_at(d, k, float(others[0]), others[1:])


def noticing_stage(answered: Answered, *, few: bool = False) -> NoticingStage | NotEstimable:
    """Return the fit of the answers, or why there is none.

    d and criterion of subjects are normal about those of the population, which have a very wide
    prior, as their SDs have that of ratings; those of the conditions' effects are half-Cauchy.
    With `few` points its evidence and means are known, and its limits are not.
    """
    ready = _prepared(answered)
    if isinstance(ready, NotEstimable):
        return ready
    fits = integrated(LatentField(ready), _start(ready), _components, _log_prior, few=few)
    if few:
        fit = NoticingStage(answered=answered, posterior=next(fits))
        return fit.posterior.points.refusal() or fit
    fit = settled(fits, lambda posterior: NoticingStage(answered=answered, posterior=posterior))
    return fit.refusal or fit


def _prepared(answered: Answered) -> NoticingTrials | NotEstimable:
    ratings, changed = answered.ratings, ~answered.catch
    if not changed.any() or len(np.unique(ratings.contrast)) < 2:
        return NotEstimable("all predicted contrasts are equal, so noticing has no slope")
    if len(np.unique(answered.answer)) < 2:
        return NotEstimable("all answers are the same")
    several = len(np.unique(ratings.condition[changed])) >= FEWEST_CONDITIONS
    columns = (
        *(ratings.subject, ratings.contrast / answered.unit, answered.answer),
        *(answered.two_sided, -answered.sign),
        ratings.condition if several else np.zeros_like(ratings.condition),
    )
    rows, weight = counted(np.stack(columns, axis=-1))
    return NoticingTrials(
        subjects=len(ratings.subjects),
        conditions=len(ratings.conditions) if several else 0,
        subject=rows[:, 0].astype(np.int64),
        condition=rows[:, 5].astype(np.int64),
        x=rows[:, 1],
        answer=rows[:, 2].astype(np.int64),
        two_sided=rows[:, 3].astype(np.bool_),
        towards=rows[:, 4],
        weight=weight,
        lapse=LAPSE,
    )


def _start(trials: NoticingTrials) -> FloatArray:
    return START if trials.conditions else START[:-1]


def _components(points: FloatArray) -> Components:
    root = np.zeros((len(points), 2, 2))
    root[:, 0, 0], root[:, 1, 1] = np.exp(points[:, :2]).T
    return Components(
        residual_sd=np.ones(len(points)),
        root=root,
        discrepancy_sd=np.exp(points[:, 2]) if points.shape[1] > 2 else np.ones(len(points)),
    )


def _log_prior(points: FloatArray) -> FloatArray:
    others = points[:, 2:]
    spread = lines.log_prior_of_spread(points[:, :2]).sum(axis=1)
    return np.asarray(spread + (others - np.log1p(np.exp(2 * others))).sum(axis=1))
