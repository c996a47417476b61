"""One model of the answers: a change is noticed first, and rated if it was noticed as expected.

Who notices a weak change feels more of it than others. The second stage has a column for that: what
noticing selects on average, of which it estimates how much is in the ratings.

Numbers of equations are those of docs/mathematics/answers.md.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np

from analysis.estimates import Estimate, FloatArray, IntArray, NotEstimable
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing_stage import (
    Answered,
    NoticingStage,
    noticing_stage,
)
from analysis.sensitivity.rating_stage import Beside, RatingStage, rating_stage

FEWEST_NOTICED = 0.1
"""Share of changes answered as expected, below which the column explodes. Where nearly all are, it
is nearly 0, and so is what it corrects."""
ALL_NOTICED = 0.97
"""Above this share of them ratings need no correction for who noticed, if noticing has no model."""
MOST_WIDTH = 0.5
"""A gain is told if its interval, times the span of the contrasts, is below this part of the scale.
"""
LEVELS_SHARE = 0.1
"""Share of the variance of contrasts within conditions, above which these have levels."""
MOST_HIGHEST = 0.5
"""Gains are told unless more of the scores than this are the highest possible."""
UNEQUAL = 0.05
"""Below this probability of equal gains, gains differ."""
NOBODY_ASKED = NotEstimable("nobody was asked what changed")


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyAnswers:
    """What people answered and scored in a study.

    Parameters:
        ratings: the scored trials, and the catch trials where people were asked for a change;
            contrasts are in the direction that the trial expects, 0 on a catch trial.
        scale: the lowest and the highest possible rating.
        answered: the same trials with what was answered; None where nobody was asked.
        selects: whether scores were asked for only where a change was noticed.
        groups: names of the groups, none or several.
        group: shape (subjects,), positions in `groups`, -1 of none; None without groups.
        session: shape (trials,), positions of sessions, from 0; None of a single one.
    """

    ratings: Ratings
    scale: tuple[float, float]
    answered: Answered | None = None
    selects: bool = False
    groups: tuple[str, ...] = ()
    group: IntArray | None = None
    session: IntArray | None = None

    @cached_property
    def rated(self) -> Ratings:
        """The trials, with a rating where the second stage takes it."""
        if self.answered is None:
            return self.ratings
        is_rated = self.answered.expected if self.selects else ~self.answered.catch
        return replace(self.ratings, rating=np.where(is_rated, self.ratings.rating, np.nan))

    def beside(self, selection: FloatArray | None) -> Beside:
        """Return what stands beside the lines."""
        return Beside(selection=selection, group=self.group, session=self.session)

    @property
    def all_noticed(self) -> bool:
        """Whether so many changes were noticed that those who did are no others."""
        if not (self.selects and self.answered):
            return True
        return self.answered.share_noticed > ALL_NOTICED

    @property
    def selection_refusal(self) -> NotEstimable | None:
        """Why who noticed cannot be corrected for, or None."""
        if not (self.selects and self.answered):
            return None
        if not (~self.answered.catch).any():
            return NotEstimable("no change was answered")
        if (share := self.answered.share_noticed) >= FEWEST_NOTICED:
            return None
        return NotEstimable(
            f"{share:.0%} of the changes were answered as expected, and of less than "
            f"{FEWEST_NOTICED:.0%} ratings cannot be corrected for who noticed"
        )


@dataclass(frozen=True, kw_only=True)
class Person:
    """One subject's line in the ratings.

    `level` is the rating at the mean contrast, `bias` at none, over the conditions of the study;
    `gain` is in points per unit of contrast, `relative_gain` that less the mean of the subjects
    with ratings. `trials` are rated. `told` is whether the gain is known well enough to be
    compared, and `reason` why not.
    """

    subject: str
    trials: int
    level: Estimate
    bias: Estimate
    gain: Estimate
    relative_gain: Estimate | NotEstimable
    told: bool
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class GroupLine:
    """The line of a group of people, or by how much those of two groups differ, `a - b`."""

    name: str
    level: Estimate
    gain: Estimate


@dataclass(frozen=True, kw_only=True)
class PersonNoticing:
    """How one subject notices changes: d and criterion, in SDs of the noise."""

    subject: str
    d: Estimate
    criterion: Estimate


@dataclass(frozen=True, kw_only=True)
class Noticed:
    """How changes are noticed.

    `d` and `criterion` are the population's; `p` is that of d = 0: twice the smaller posterior
    probability of either sign. d is per `unit` of contrast. `lean` is by how much less readily the
    first answer of a question is given.
    """

    subjects: tuple[PersonNoticing, ...]
    d: Estimate
    criterion: Estimate
    p: float
    lean: Estimate
    unit: float
    share: float


@dataclass(frozen=True, kw_only=True)
class Rated:
    """How changes are rated.

    `level`, `bias` and `gain` are the population's, over several groups the mean of theirs; a
    single subject tells of none. `contrast` is that of the levels, `span` that of the contrasts
    with ratings, from the lowest to the highest. `equal_gains` is the probability that all gains
    are equal, .5 before the study; if they differ, their SD is below `gain_sd_upper` with 95%
    probability. `selection` is how much of the noise that noticing selects is in the ratings, in
    points. `effects` are those of conditions beyond their contrasts, none of fewer than three.
    `untold` is why the gains are not told, None where those of most subjects are. `highest` is the
    share of the ratings that are the highest possible.
    """

    subjects: tuple[Person, ...]
    level: Estimate | NotEstimable
    bias: Estimate | NotEstimable
    gain: Estimate | NotEstimable
    contrast: float
    span: float
    equal_gains: float
    gain_sd_upper: float
    selection: Estimate | None
    effects: Mapping[str, Estimate]
    groups: tuple[GroupLine, ...]
    differences: tuple[GroupLine, ...]
    untold: NotEstimable | None
    highest: float

    @property
    def gains_differ(self) -> bool:
        """Whether gains are shown to differ."""
        return self.equal_gains < UNEQUAL

    def of(self, contrast: FloatArray) -> FloatArray:
        """Return the rating of the population's line, or of the only subject's, by contrast."""
        line: Rated | Person = self
        if isinstance(self.gain, NotEstimable):
            line = max(self.subjects, key=lambda person: person.trials)
        assert isinstance(line.bias, Estimate)
        assert isinstance(line.gain, Estimate)
        return np.asarray(line.bias.value + line.gain.value * contrast)


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """What the model of the answers tells, as far as it does."""

    noticing: Noticed | NotEstimable
    rating: Rated | NotEstimable


ALONE = NotEstimable("a single subject tells nothing about a population")
NO_OTHERS = NotEstimable("a single subject has no others to compare with")


def sensitivity(answers: StudyAnswers) -> Sensitivity:
    """Return what the answers of a study tell of its people.

    First, whether a change is noticed: n = d_s x + sign(x) ε_c + e is answered as expected above
    the subject's criterion. Then, how it is rated by those who noticed it: y = b_s + g_s x +
    γ E(e | noticed) + δ_c + σ e₂, between thresholds common to all. So the gain g_s is that of the
    change, whether people score it or what they felt of it (Heckman, Econometrica 47, 1979, of
    selection). Both are mixed models by Laplace's approximation, integrated over the differences
    between people (Rue, Martino and Chopin, Journal of the Royal Statistical Society B 71, 2009).
    """
    model = answers_model(answers)
    return Sensitivity(noticing=model.noticed, rating=model.rated)


def evidence(answers: StudyAnswers) -> float | NotEstimable:
    """Return the log evidence of the model under these contrasts: of all answers and ratings.

    It is rounded to hundredths; its error is about .1.
    """
    model = answers_model(answers, few=True)
    if isinstance(model.rating, NotEstimable):
        return model.rating
    found = model.rating.posterior.points.log_evidence
    # Where nobody was asked, or all is noticed, ratings alone tell of a law.
    if isinstance(model.noticing, NoticingStage):
        found += model.noticing.posterior.points.log_evidence
    return round(found, 2)


@dataclass(frozen=True, kw_only=True, eq=False)
class AnswersModel:
    """Both stages of a study's answers, as far as there are any."""

    answers: StudyAnswers
    noticing: NoticingStage | NotEstimable
    rating: RatingStage | NotEstimable

    @property
    def noticed(self) -> Noticed | NotEstimable:
        """The estimates of the first stage."""
        if isinstance(stage := self.noticing, NotEstimable):
            return stage
        *slopes, d = stage.slopes
        *criteria, criterion = stage.criteria
        names = stage.answered.ratings.subjects
        return Noticed(
            subjects=tuple(
                PersonNoticing(subject=name, d=own, criterion=k)
                for name, own, k in zip(names, slopes, criteria, strict=True)
            ),
            d=d,
            criterion=criterion,
            p=stage.p,
            lean=stage.lean,
            unit=stage.answered.unit,
            share=stage.answered.share_noticed,
        )

    @property
    def rated(self) -> Rated | NotEstimable:
        """The estimates of the second stage."""
        if isinstance(stage := self.rating, NotEstimable):
            return stage
        ready = stage.ready
        group = {
            name: ALONE if stage.alone else stage.of_group(name)
            for name in ("level", "bias", "gain")
        }
        names = ready.ratings.conditions if stage.effects else ()
        pairs = [f"{a} - {b}" for a, b in combinations(self.answers.groups, 2)]
        return Rated(
            subjects=tuple(self._people(stage)),
            **group,
            contrast=ready.axes.x_mean,
            span=self._span,
            equal_gains=stage.equal_gains,
            gain_sd_upper=stage.gain_sd_upper,
            selection=stage.selection,
            effects=dict(zip(names, stage.effects, strict=True)),
            groups=_groups(self.answers.groups, stage.of_groups),
            differences=_groups(pairs, stage.apart),
            untold=self.untold,
            highest=self.highest,
        )

    def _people(self, stage: RatingStage) -> Iterator[Person]:
        lines = (stage.of_subjects(name) for name in ("level", "bias", "gain", "relative gain"))
        people = zip(stage.ready.ratings.subjects, stage.ready.counts, *lines, strict=True)
        for name, trials, level, bias, gain, relative in people:
            # Somebody without ratings has the group's line and nothing of the own.
            if trials:
                reason = self._untold(self.open_share(gain))
                yield Person(
                    subject=name,
                    trials=int(trials),
                    level=level,
                    bias=bias,
                    gain=gain,
                    relative_gain=NO_OTHERS if stage.alone else relative,
                    told=reason is None,
                    reason=reason.reason if reason else "",
                )

    @cached_property
    def untold(self) -> NotEstimable | None:
        """Why the gains of this study are not told, or None where those of most people are."""
        if isinstance(self.rating, NotEstimable):
            return self.rating
        return self._untold(self.usual_open_share)

    def _untold(self, share: float) -> NotEstimable | None:
        """Return all reasons why a gain is not told that leaves this part of the scale open."""
        reasons = [why.reason for why in (self.ceiling, self.too_wide(share)) if why]
        return NotEstimable("; ".join(reasons)) if reasons else None

    @property
    def ceiling(self) -> NotEstimable | None:
        """Why no gain is told, where most scores are the highest."""
        if self.highest <= MOST_HIGHEST:
            return None
        return NotEstimable(
            f"{self.highest:.0%} of the scores are the highest possible, above which larger "
            "changes cannot be scored; a scale with room above would tell more"
        )

    def too_wide(self, share: float) -> NotEstimable | None:
        """Return why a gain is not told that leaves this part of the scale open, or None."""
        if share < MOST_WIDTH:
            return None
        # Contrasts further apart do not help: what they leave open grows with them.
        times = math.ceil(10 * (share / MOST_WIDTH) ** 2) / 10
        needed = f"about {times:.3g} times as many rated trials per person"
        if self.conditions_hide_gain:
            needed = (
                "several levels of each condition, or more conditions; more of the same trials do "
                "not help, because conditions are rated differently beyond their contrasts"
            )
        part = f"{share:.0%} of the scale" if share < 1 else "more than the whole scale"
        return NotEstimable(
            "over the contrasts of this study, the 95% interval of a typical person's gain leaves "
            f"{part} open; to leave less than {MOST_WIDTH:.0%} takes {needed}"
        )

    @property
    def conditions_hide_gain(self) -> bool:
        """Whether effects of conditions leave too much of the scale open to the gain of all."""
        stage = self.rating
        assert isinstance(stage, RatingStage)
        if stage.alone or not stage.effects:
            return False
        # Levels of a condition tell a gain apart from its effect, and more trials of these help.
        of, contrast = stage.ready.ratings.condition, stage.ready.ratings.contrast
        sums, counts = np.bincount(of, contrast), np.bincount(of)
        within = contrast - (sums / np.maximum(counts, 1))[of]
        has_levels = np.var(within) > LEVELS_SHARE * np.var(contrast)
        return not has_levels and self.open_share(stage.of_group("gain")) >= MOST_WIDTH

    @property
    def usual_open_share(self) -> float:
        """What part of the scale the gain of the median person leaves open."""
        assert isinstance(self.rating, RatingStage)
        gains = self.rating.of_subjects("gain")
        rated = np.flatnonzero(self.rating.ready.counts)
        return float(np.median([self.open_share(gains[who]) for who in rated]))

    @cached_property
    def highest(self) -> float:
        """The share of the ratings that are the highest possible."""
        given = self.answers.rated.given.rating
        return float((given >= self.answers.scale[1]).mean()) if given.size else 0.0

    @property
    def _span(self) -> float:
        assert isinstance(self.rating, RatingStage)
        return float(np.ptp(self.rating.ready.ratings.contrast))

    def open_share(self, gain: Estimate) -> float:
        """Return what part of the scale the interval of a gain leaves open over the contrasts."""
        (low, high), (lowest, highest) = gain.interval, self.answers.scale
        return (high - low) * self._span / (highest - lowest)


def _groups(
    names: Sequence[str], lines_of: Callable[[str], list[Estimate]]
) -> tuple[GroupLine, ...]:
    lines = zip(names, lines_of("levels"), lines_of("gains"), strict=True)
    return tuple(GroupLine(name=name, level=level, gain=gain) for name, level, gain in lines)


def answers_model(answers: StudyAnswers, *, few: bool = False) -> AnswersModel:
    """Return the fit of both stages; with `few` points for its evidence alone."""
    noticing: NoticingStage | NotEstimable = NOBODY_ASKED
    selection = None
    if answers.answered is not None:
        noticing = noticing_stage(answers.answered, few=few)
        if answers.selects and isinstance(noticing, NoticingStage):
            selection = noticing.selection
    rating: RatingStage | NotEstimable
    if refusal := answers.selection_refusal:
        rating = refusal
    elif isinstance(noticing, NotEstimable) and not answers.all_noticed:
        rating = noticing
    else:
        rating = rating_stage(answers.rated, answers.beside(selection), few=few)
    return AnswersModel(answers=answers, noticing=noticing, rating=rating)
