"""Findings of a study: its data and all results computed from them for the report."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import LEVEL, FloatArray, plain
from analysis.felt.measured_statistics import MeasuredStatistics, friction_of_touches
from analysis.loading.records import values
from analysis.loading.sessions import is_scored
from analysis.loading.study_data import StudyData, is_papers_table, scale_of_scores
from analysis.loading.study_lock import StudyLock
from analysis.report.wording import with_minus
from analysis.sensitivity.answers_model import Sensitivity, sensitivity
from analysis.statistics.corrections import holm
from analysis.statistics.factorial import Factorial
from analysis.statistics.groups import (
    CLAIMED,
    GAIN,
    INTERACTION,
    SCORE,
    GroupStatistics,
    group_statistics,
)
from analysis.statistics.slope import own_gains
from analysis.statistics.summary import TableStatistics
from analysis.trials.study_answers import predictor
from analysis.trials.track_fits import Thresholds, thresholds
from analysis.trials.trial_statistics import TrialStatistics
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import LAW, RUNG, stated_friction
from device.friction.surfaces import GivenSurface, MeasuredSurface
from protocol.registration.registration import (
    FOLLOWS,
    NOTICED,
    OMNIBUS,
    effect_of,
    implying_differences,
)
from protocol.study.participant_texts import scale_in_words
from protocol.study.rules import Rating
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True)
class Origin:
    """Command that made the report, and the digest of the study file.

    `broken_chains` names the sessions whose journal was changed after recording; `rig` is the rig
    as it was calibrated. Of a registered study, `rig` is the registered one, `later` a calibration
    made since the sessions, and `unlocked` says what is wrong with the file of the registration.
    `alone` is whether the command named sections, so that nothing is computed for others.
    """

    command: str
    study_sha256: str
    broken_chains: tuple[str, ...] = ()
    rig: Calibration = NOMINAL
    later: Calibration | None = None
    unlocked: str = ""
    alone: bool = False

    def under(self, lock: StudyLock) -> "Origin":
        """Return the origin of the report on a registered study."""
        # A calibration that some session ran under is no news.
        in_force = {run.calibration for run in lock.sessions}
        is_later = self.rig.origin and self.rig.origin not in in_force
        rig = lock.rig.on(self.rig.surface)
        return replace(self, rig=rig, later=self.rig if is_later else None)


class Scale(NamedTuple):
    """Lowest and highest possible score."""

    lowest: float
    highest: float

    @property
    def span(self) -> float:
        """Distance between its ends."""
        return self.highest - self.lowest

    def __str__(self) -> str:
        """Return the ends of the scale."""
        return with_minus(f"{self.lowest:g} to {self.highest:g}")


CHANGES_NOTICED = f"changes {NOTICED}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Questions:
    """What a report asks of these data, and which of it holds.

    A page that asks several kinds of question, each of which alone would be answered wrongly in 5%
    of studies, needs one correction over them: `p_holm` has Holm's, of those with an answer, also
    in `groups` and `factors`. The `primary` one of a registration is tested alone. What rests on a
    question, as pairs do on "conditions differ", counts only where that holds. So where nothing has
    an effect something is claimed in at most 5% of studies; with some true effects the others have
    less protection (docs/mathematics/response.md).
    `touchbeam power` counts so.
    """

    groups: GroupStatistics | None
    factors: Factorial | None
    p_holm: Mapping[str, float]
    primary: str = ""

    def holds(self, question: str) -> bool:
        """Return whether a question is answered by yes.

        Conditions differ, too, if a question holds that could not without: no further claim can be
        false by that.
        """
        by_itself = self.p_holm.get(question, 1.0) < LEVEL
        return by_itself or (question == OMNIBUS and bool(self.grounds))

    @property
    def grounds(self) -> list[str]:
        """The questions that hold and imply that conditions differ."""
        return [name for name in implying_differences(self.p_holm) if self.p_holm[name] < LEVEL]


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """Data and results that the sections of a report present.

    `measured` has those of recorded touches, None where nothing was recorded.
    """

    title: str
    loaded: StudyData
    study: Study
    origin: Origin
    table: TableStatistics
    trials: TrialStatistics
    measured: MeasuredStatistics | None

    @cached_property
    def is_predicted(self) -> bool:
        """Whether friction of any trial is known, so that ratings can be compared with it."""
        stated = isinstance(self.origin.rig.surface, GivenSurface)
        return not stated or bool(np.isfinite(self.trials.contrasts.by_law[LAW]).any())

    @property
    def shown_laws(self) -> tuple[str, ...]:
        """The laws whose contrasts are shown; without a beam's model all are the same."""
        if self.trials.has_laws:
            return tuple(self.trials.contrasts.by_law)
        return (LAW,) if self.is_predicted else ()

    @property
    def friction_source(self) -> str:
        """Where friction comes from, in words."""
        match self.origin.rig.surface:
            case GivenSurface() if self.study.imported:
                return "the contrasts that the author of the scores states"
            case GivenSurface():
                return "the friction that the study states of its touches"
            case MeasuredSurface():
                return f"the measured table {self.study.surface.table}"
        return f"the friction model on its rung {RUNG}"

    @property
    def rest(self) -> str:
        """To what the friction of a touch is compared that is rated at once, in words."""
        stated = isinstance(self.origin.rig.surface, GivenSurface)
        if stated and not stated_friction(self.study).at_rest:
            return "the mean of what touches state"
        return "the same touch at 0 V"

    @cached_property
    def trial_records(self) -> list[dict[str, Any]]:
        """A record per trial that counts, with its predicted contrasts and the measured one.

        `touch_measured` says whether the prediction is for force or place as measured.
        """
        contrasts = self.trials.contrasts
        told = _TRIAL | (_TRACK if self.loaded.trials["track"].notna().any() else {})
        trials = zip(*(values(self.loaded.trials[of]) for of in told.values()), strict=True)
        by_law = zip(*(plain(contrast) for contrast in contrasts.by_law.values()), strict=True)
        responses = plain(self.trials.responses)
        records: list[dict[str, Any]] = [
            {
                **dict(zip(told, trial, strict=True)),
                "response": response,
                "touch_measured": measured,
                "predicted": dict(zip(contrasts.by_law, predicted, strict=True)),
                # The key is there in every study, so that programs need not ask for it.
                "measured": None,
            }
            for trial, response, measured, predicted in zip(
                trials, responses, contrasts.measured.tolist(), by_law, strict=True
            )
        ]
        if self.measured is not None:
            felt = self.measured.trials
            numbers = zip(records, plain(felt.value), plain(felt.error), felt.why, strict=True)
            for record, contrast, error, why in numbers:
                known = {"measured": {"contrast": contrast, "error": error}}
                record.update(known if why is None else {"measured_reason": why})
        return records

    @cached_property
    def predictor(self) -> tuple[FloatArray, bool]:
        """The contrasts that sensitivity is to, (trials,), and whether they were measured."""
        scored = is_scored(self.loaded.trials).to_numpy()
        measured = None if self.measured is None else self.measured.trials.best
        return predictor(self.trials.contrasts.by_law[LAW], measured, scored)

    @cached_property
    def sensitivity(self) -> Sensitivity:
        """What the model of the answers tells of the people."""
        return sensitivity(self.trials.answers(self.predictor[0]))

    @property
    def contrast(self) -> str:
        """What sensitivity is to: a predicted contrast, or a measured one."""
        return "measured contrast" if self.predictor[1] else "predicted contrast"

    @cached_property
    def questions(self) -> Questions:
        """The questions about conditions, people, groups and factors."""
        groups, factors = self._groups(), self.trials.factorial
        tests: dict[str, Any] = {
            OMNIBUS: self.trials.response_tests.omnibus_p,
            FOLLOWS: self.trials.slope if self.is_predicted else None,
            CHANGES_NOTICED: self.trials.noticed[-1].found if self.trials.noticed else None,
            **{claim: getattr(groups, of) for of, claim in CLAIMED.items() if groups},
            **{effect_of(*it.factors): it.effect for it in (factors.effects if factors else ())},
        }
        found = {of: getattr(test, "p", test) for of, test in tests.items()}
        tested = {of: p for of, p in found.items() if isinstance(p, float)}
        lock = self.loaded.lock
        primary = lock.registration.primary if lock and not lock.registration.earlier else ""
        family = {of: p for of, p in tested.items() if of != primary}
        p_holm = tested | dict(zip(family, holm([*family.values()]), strict=True))
        return Questions(
            primary=primary,
            groups=groups and replace(groups, p_holm=_of_groups(p_holm)),
            factors=factors
            and replace(
                factors,
                effects=tuple(
                    replace(it, p_holm=p_holm.get(effect_of(*it.factors), it.p_holm))
                    for it in factors.effects
                ),
            ),
            p_holm=p_holm,
        )

    @property
    def groups(self) -> GroupStatistics | None:
        """The comparisons between groups; None of a study without groups."""
        return self.questions.groups

    @property
    def factors(self) -> Factorial | None:
        """The effects of factors and sessions; None of a study that has neither."""
        return self.questions.factors

    def _groups(self) -> GroupStatistics | None:
        known, table = self.loaded.groups, self.trials.response_tests.table
        rows = [row for row, who in enumerate(table.subjects) if who in known]
        if not rows:
            return None
        names = tuple(dict.fromkeys((*self.study.groups, *known.values())))
        trials, people = self.trials.answered, len(table.subjects)
        return group_statistics(
            responses=table.scores[rows],
            gains=own_gains(trials.rating, trials.contrast, trials.subject, people)[rows],
            groups=np.array([names.index(known[table.subjects[row]]) for row in rows]),
            names=names,
            conditions=table.conditions,
        )

    @cached_property
    def thresholds(self) -> Thresholds | None:
        """The thresholds of people in tracks; None of a study without tracks."""
        loaded = self.loaded
        friction = friction_of_touches(loaded) if self.study.track else {}
        return thresholds(self.study, loaded, self.origin.rig, friction)

    @property
    def measure(self) -> str:
        """What conditions are compared by: `response`, or `score` where nobody was asked."""
        return "response" if self.loaded.scored["question"].notna().any() else "score"

    def in_measure(self, text: str) -> str:
        """Return words on responses as words on scores where these are what is compared."""
        if self.measure == "response":
            return text
        return text.replace("response", "score").replace("Response", "Score")

    @property
    def response_scale(self) -> "Scale":
        """The ends of the scale of responses."""
        return Scale(0, self.scale.span + 1) if self.measure == "response" else self.scale

    @property
    def at_once(self) -> bool:
        """Whether people scored what they felt at once, without a question about a change."""
        return self.study.absolute and not self.published

    @property
    def rehearsals(self) -> bool:
        """Whether any of the scores come from a rehearsal."""
        return "rehearsal" in self.loaded.kinds

    @property
    def published(self) -> bool:
        """Whether all scores come from published tables, which come without session records."""
        return self.loaded.kinds == ("published",)

    @property
    def rating(self) -> Rating:
        """Scale of the scores."""
        return scale_of_scores(self.study, self.loaded.kinds)

    @cached_property
    def is_papers(self) -> bool:
        """Whether the table of scores is the paper's Table 4."""
        return is_papers_table(self.study, self.loaded.table)

    @property
    def table_name(self) -> str:
        """What the table of scores is called within a sentence."""
        return "Table 4" if self.is_papers else "the table of scores"

    @property
    def mean_name(self) -> str:
        """What the means of its rows are called."""
        return "comprehensive" if self.is_papers else "mean"

    @property
    def scale(self) -> Scale:
        """The ends of that scale."""
        return Scale(self.rating.minimum, self.rating.maximum)

    @property
    def scale_in_words(self) -> str:
        """That scale with the names of its bands, as the participants read them."""
        return with_minus(scale_in_words(self.study, self.rating))


def _of_groups(p_holm: Mapping[str, float]) -> dict[str, float]:
    """Return p of the questions about groups by their short names."""
    names = zip((SCORE, GAIN, INTERACTION), CLAIMED.values(), strict=True)
    return {name: p_holm[claim] for name, claim in names if claim in p_holm}


_TRIAL = {
    "subject": "participant",
    "session": "session",
    "index": "trial_index",
    "kind": "trial_kind",
    "condition": "condition",
    "level": "level",
    "opposite": "opposite",
    "place": "place",
    "change": "change",
    "agrees": "agrees",
    "score": "score",
    "reaction_s": "reaction_time_s",
}
"""What a trial's record holds, and the column it comes from."""
_OF_TRACK = ("track", "track_role", "level_value", "interval", "correct", "reversal")
_TRACK = dict(zip(_OF_TRACK, _OF_TRACK, strict=True))
"""Likewise where some trials are of tracks, whose `level` is a number of theirs."""
