"""The answers of simulated cohorts as the model of the answers takes them, each with its truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.power.people_cohorts import PeopleCohorts
from analysis.sensitivity.answers_model import StudyAnswers
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing_stage import Answered
from analysis.simulation import AlikeTrials, Cohort, counted_trials, joined, names_of
from device.people.answering import LESS, MORE, SAME, beyond, meaning
from protocol.study.rules import PAPERS_SCALE

POPULATION = 400
"""People whose means stand for those of the population."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lines:
    """The straight lines that the scores of people follow, shape (people,) each.

    The gain is points per unit of predicted contrast. What is felt is no straight line in it:
    people touch with their own force and speed, so that the slope is that over their changes. The
    bias, the score at contrast 0, has the mean of what the kinds of change add. Both are NaN of
    somebody without a predicted change.
    """

    bias: FloatArray
    gain: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class AnsweredCohort:
    """What the people of a simulated study answered whom its exclusions leave, and their lines."""

    answers: StudyAnswers
    lines: Lines


@dataclass(frozen=True, kw_only=True, eq=False)
class AnsweredCohorts:
    """Cohorts of a study's people."""

    cohorts: PeopleCohorts

    def cohort(self, key: str) -> AnsweredCohort:
        """Return the cohort of a key, which gives the same one every time."""
        return self.of_people(joined(self._sessions(self.cohorts.participants, key)))

    def cohorts_of(self, everybody: Cohort) -> Iterator[AnsweredCohort]:
        """Yield each cohort of several that follow one another."""
        size = self.cohorts.participants
        for first in range(0, everybody.people.size, size):
            yield self.of_people(everybody.rows(slice(first, first + size)))

    def of_people(self, made: Cohort) -> AnsweredCohort:
        """Return what these people answered."""
        contrast = self.contrasts_of(made)
        lines, kept = self.lines(made, contrast), self.kept(made)
        return AnsweredCohort(
            answers=self._answers(made, contrast, kept),
            lines=Lines(bias=lines.bias[kept], gain=lines.gain[kept]),
        )

    @cached_property
    def population(self) -> Lines:
        """The mean over the groups of the mean lines of people drawn from them, shape ()."""
        made = joined(self._sessions(POPULATION, "population"))
        lines = self.lines(made, self.contrasts_of(made))
        groups = self.groups(POPULATION)

        def mean(values: FloatArray) -> FloatArray:
            return np.array(np.mean([values[groups == one].mean() for one in set(groups.tolist())]))

        return Lines(bias=mean(lines.bias), gain=mean(lines.gain))

    def _sessions(self, participants: int, key: str) -> list[Cohort]:
        return self.cohorts.simulation.sessions(participants, key)

    def contrasts_of(self, made: Cohort) -> FloatArray:
        """Return the predicted contrast of each trial, (people, trials).

        It is 0 of catch trials, and NaN of those that expect no change.
        """
        contrast = np.where(self._are(made, "catch"), 0.0, np.nan)
        who, trial = np.nonzero(self._are(made, "trial"))
        contrast[who, trial] = self.cohorts.contrasts(made, who, trial)
        contrast[self._expected[made.kinds] == SAME] = np.nan
        return contrast

    def _are(self, made: Cohort, kind: str) -> BoolArray:
        return np.array([of.trial.kind == kind for of in self._kinds])[made.kinds]

    def lines(self, made: Cohort, contrast: FloatArray) -> Lines:
        """Return the lines of these people over their changes, in points of the study's scale."""
        people, study = made.people, self.cohorts.study
        added = np.stack([beyond(kind.change, people) for kind in self._kinds], axis=1)
        # There the points of an effect are all of it.
        added *= study.surface.kind != "given"
        added = np.take_along_axis(added, made.kinds, axis=1)
        changes = np.isfinite(contrast) & self._are(made, "trial")

        def mean(values: FloatArray) -> FloatArray:
            return _ratio(np.where(changes, values, 0.0).sum(axis=1), changes.sum(axis=1))

        x, felt = np.where(changes, contrast, 0.0), self.signs(made) * made.contrast
        away = np.where(changes, x - mean(x)[:, None], 0.0)
        slope = _ratio((away * np.where(changes, felt, 0.0)).sum(axis=1), (away**2).sum(axis=1))
        start = mean(felt) - slope * mean(x)
        drifted = people.drift * mean(self.asked_before(made).astype(np.float64))
        bias = people.bias + mean(added) + drifted + people.gain * start
        unit = study.rating.span / PAPERS_SCALE.span
        zero = study.rating.minimum - unit * PAPERS_SCALE.minimum
        return Lines(bias=zero + unit * bias, gain=unit * people.gain * slope)

    def signs(self, made: Cohort) -> FloatArray:
        """Return 1 for each trial that expects the first answer of its question, else -1."""
        of_kinds = [-1.0 if kind.expected == LESS else 1.0 for kind in self._kinds]
        return np.array(of_kinds)[made.kinds]

    def asked_before(self, made: Cohort) -> IntArray:
        """Return how many questions were asked before each trial, in its session."""
        of_kinds = [it.trial.question is not None or it.trial.rated for it in self._kinds]
        asks = np.array(of_kinds)[made.kinds]
        before = np.cumsum(asks, axis=1) - asks
        first = np.searchsorted(self._session, self._session)
        return np.asarray(before - before[:, first])

    @property
    def _kinds(self) -> Sequence[AlikeTrials]:
        return self.cohorts.simulation.planned.kinds

    def kept(self, made: Cohort) -> IntArray:
        """Return the positions of the people whom the study's rules leave."""
        *_, out = counted_trials(self.cohorts.simulation.planned, made)
        # Who left before the first answer breaks no rule, because there is nothing to judge.
        return np.flatnonzero(~(out & made.answered.any(axis=1)))

    def groups(self, participants: int) -> IntArray:
        """Return the position of each one's group, 0 without groups."""
        study, planned = self.cohorts.study, self.cohorts.simulation.planned
        names = [planned.place(slot)[0] for slot in range(participants)]
        return np.array([study.groups.index(name) if name else 0 for name in names])

    def _answers(self, made: Cohort, contrast: FloatArray, kept: IntArray) -> StudyAnswers:
        study, planned = self.cohorts.study, self.cohorts.simulation.planned
        scored, catch, _ = counted_trials(planned, made)
        # Where nobody is asked what changed catch trials tell nothing of noticing.
        used = scored if study.absolute else scored | catch
        subject, trial = np.nonzero((used & np.isfinite(contrast))[kept])
        at = kept[subject], trial
        kinds, change, expected = made.kinds[at], made.change[at], self._expected[made.kinds[at]]
        names = names_of(self.cohorts.participants)
        ratings = Ratings(
            subjects=tuple(names[who] for who in kept),
            conditions=study.conditions,
            subject=subject,
            condition=self._conditions[kinds],
            contrast=contrast[at],
            rating=made.score[at],
        )
        present, group = np.unique(
            self.groups(self.cohorts.participants)[kept], return_inverse=True
        )
        several = len(present) > 1
        return StudyAnswers(
            ratings=ratings,
            scale=(float(study.rating.minimum), float(study.rating.maximum)),
            answered=None
            if study.absolute
            else Answered(
                ratings=ratings,
                answer=np.where(change == SAME, 0, np.where(change == expected, 1, -1)),
                two_sided=np.array([kind.two_sided for kind in planned.kinds])[kinds],
                first=expected == MORE,
                catch=catch[at],
            ),
            selects=study.rating.score_when != "always" and not study.absolute,
            groups=tuple(study.groups[one] for one in present) if several else (),
            group=group if several else None,
            session=self._session[trial] if study.design.sessions > 1 else None,
        )

    @cached_property
    def _session(self) -> IntArray:
        """The session of each trial of a person, from 0."""
        sizes = [len(plan.plan(0).trials) for plan in self.cohorts.simulation.plans]
        return np.repeat(np.arange(len(sizes)), sizes)

    @property
    def _conditions(self) -> IntArray:
        """The position of each kind's condition, -1 of those without one."""
        names = self.cohorts.study.conditions
        of_kinds = (kind.trial.condition for kind in self._kinds)
        return np.array([names.index(name) if name in names else -1 for name in of_kinds])

    @property
    def _expected(self) -> IntArray:
        """The expected answer of each kind, of a catch trial that of its condition."""
        asked = {item.name: item for item in self.cohorts.study.condition}
        expected = []
        for kind in self._kinds:
            said = kind.expected
            if kind.trial.kind == "catch":
                condition = asked[kind.trial.condition or ""]
                if condition.question is not None:
                    said = meaning(condition.question, condition.expected)
            # What is not asked about is neither scored nor a catch trial, unless all is rated.
            expected.append(said if said is not None else MORE if kind.trial.rated else SAME)
        return np.array(expected)


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    """Return the ratio, NaN where there is nothing below."""
    shares = np.full(len(above), np.nan)
    np.divide(above, below, out=shares, where=below > 0)
    return shares
