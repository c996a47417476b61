"""The exported tables of trials, participants, touches and contrasts, a column per `Column`."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from analysis.cells import Cell
from analysis.estimates import IntArray
from analysis.felt.measured_statistics import with_measures
from analysis.loading.records import TEXT, values
from analysis.loading.response import responses
from analysis.loading.sessions import Sessions
from analysis.trials.contrasts import trial_contrasts
from device.friction.calibration import Calibration
from device.friction.changes import LAW, RUNG
from device.friction.laws import LAWS
from device.friction.surfaces import BeamSurface
from protocol.journal.records import PlannedTrial
from protocol.plan.trials import Trial
from protocol.study.columns import (
    BY_NAME,
    COLUMNS,
    GROUP,
    PARTICIPANT_COLUMNS,
    PLANNED,
    PLANNED_PER_TOUCH,
    SESSION_COLUMNS,
    TOUCH_COLUMNS,
    TRACE_COLUMNS,
    TRACK_COLUMNS,
    YES_NO,
    Column,
    factor_columns,
    in_tracks,
    names_of,
    question_columns,
    response_column,
)
from protocol.study.study import Study
from protocol.study.study_question import ONCE, StudyQuestion
from protocol.study.touch import Touch
from protocol.study.track import TrackTouch

_SESSION_NAMES = {"exclusion": "session_exclusion", "inclusion": "session_inclusion"}
"""The columns of sessions that have the names of columns of trials."""
_NOTED = ("skin_state", "room_temperature", "humidity", "cleaning")
"""The columns of what the operator was asked before a session."""
_PER_TOUCH = [column.name for column in COLUMNS if column.per_touch]
CONTRAST_COLUMNS = (
    *TOUCH_COLUMNS[:4],
    BY_NAME["trial_kind"],
    BY_NAME["condition"],
    Column(
        "law",
        "Friction law of the prediction, missing where no beam is modelled.",
        levels={name: law.meaning for name, law in LAWS.items()},
    ),
    Column("rung", "Rung of the friction model, likewise; `touchbeam ladder` lists all."),
    Column(
        "predicted_contrast",
        "Change of the logarithm of friction that the law predicts on the rig as calibrated, "
        "positive in the expected direction or, without a question, where friction is above that "
        "at 0 V; missing where nothing is predicted.",
    ),
    Column(
        "touch_measured",
        "Whether the prediction is for force or place as measured, not as planned.",
        levels=YES_NO,
    ),
    BY_NAME["measured_contrast"],
    BY_NAME["measured_contrast_error"],
)
"""Of a table of contrasts."""
NAMED_CONTRASTS = ("participant", "session", "trial_index", "trial_kind", "condition", "score")
"""The columns of Python's table of contrasts, one of each law, before the predictions."""


def _made(*, per_touch: bool) -> dict[str, Callable[[pd.DataFrame], Any]]:
    """Return how the columns that follow from others are made, of trials or of touches."""
    return {it.name: it.made for it in COLUMNS if it.made and it.per_touch == per_touch}


def of_groups(sessions: pd.DataFrame) -> tuple[Column, ...]:
    """Return the column of groups if any of the `sessions` has one."""
    return (GROUP,) if sessions["group"].notna().any() else ()


def of_tracks(found: Sessions) -> tuple[Column, ...]:
    """Return the columns of tracks if any trial is of one."""
    return TRACK_COLUMNS if found.attempts["track"].notna().any() else ()


def _last(answers: pd.DataFrame, keys: list[str]) -> "pd.Series[float]":
    """Return the row of the last answer by what it is about."""
    last = answers.drop_duplicates(keys, keep="last")
    return last.set_index([last[key].astype(np.float64) for key in keys])["row"]


def participant_table(
    sessions: pd.DataFrame, trials: pd.DataFrame, questions: Sequence[StudyQuestion]
) -> pd.DataFrame:
    """Return a row per participant of `sessions`, of which `trials` are the trials.

    A question that was asked before or after sessions has a column, unless somebody gave it
    different answers. A rehearsal that has a participant's name is a participant of its own.
    """
    keys = ["participant", "session", "session_kind"]
    kinds = sessions.groupby("subject", sort=False)["session_kind"]
    several = {who: tuple(dict.fromkeys(each)) for who, each in kinds}
    table = pd.DataFrame({"sessions": kinds.size(), "session_kinds": pd.Series(several)})
    if of_groups(sessions):
        table["group"] = sessions.groupby("subject")["group"].first()
    asked = [each.name for each in questions if each.when in ONCE]
    # Without the other columns, because a factor may be called "subject".
    said = trials[[*keys, *asked]].merge(sessions[[*keys, "subject"]], on=keys)
    for name in asked:
        given = said[["subject", name]].dropna().drop_duplicates().set_index("subject")[name]
        # One column cannot hold two answers, and none of them is the wrong one.
        if given.index.is_unique:
            table[name] = given.reindex(table.index)
    return table.rename_axis("participant").reset_index()


def _scores(scores: "pd.Series[float]", whole: "pd.Series[bool]") -> "pd.Series[Any]":
    """Return scores or responses: whole numbers in a session, any in a published table."""
    given = zip(values(scores), whole, strict=True)
    return pd.Series(
        # The scale of a session has whole numbers; 7.0 would suggest that halves were possible.
        [int(score) if is_whole and score is not None else score for score, is_whole in given],
        scores.index,
        object,
    )


def _utc(moments: "pd.Series[Any]") -> "pd.Series[str]":
    """Return the moments in BIDS' form: ISO 8601 to the microsecond, with Z."""
    texts: pd.Series[str] = moments.dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    return texts


def cells(table: pd.DataFrame) -> Iterable[tuple[Cell, ...]]:
    """Return the cells of each row of a table of trials."""
    return zip(*(values(table[name]) for name in table.columns), strict=True)


def contrast_table(
    study: Study, found: Sessions, trials: pd.DataFrame, rig: Calibration
) -> pd.DataFrame:
    """Return what each law predicts for each of the exported `trials`, as in the report.

    Without a beam's model there is one prediction, of no law and no rung.

    Args:
        study: the present study.
        found: what `trials` were made from, with measures.
        trials: as they are `Frames.exported`.
        rig: of the trials for which no calibration was in force.
    """
    begun = found.trials.loc[trials.index]
    touches = found.touches[found.touches["attempt_id"].isin(begun.index)]
    contrasts = trial_contrasts(study, begun, touches.assign(place_m=found.places_m), rig)
    names = names_of(CONTRAST_COLUMNS)
    is_beam = isinstance(rig.surface, BeamSurface)
    by_law = contrasts.by_law if is_beam else {None: contrasts.by_law[LAW]}
    # By trial and then by law, so that the laws of a trial stand together.
    rows = trials.filter(names).loc[trials.index.repeat(len(by_law))]
    told = rows.assign(
        law=[*by_law] * len(trials),
        rung=RUNG if is_beam else None,
        predicted_contrast=np.column_stack([*by_law.values()]).ravel(),
        touch_measured=contrasts.measured.repeat(len(by_law)),
    )
    return told[names].reset_index(drop=True)


# A study's tables for Python: trials, touches, traces, sessions and plans as data frames.
#
# Their columns are those of exported data, but for moments, which are moments here, not texts,
# and for the columns per touch, which stand in a table of touches.


def frames(study: Study, recorded: Sessions, *, rehearsals: bool) -> "Frames":
    """Return the tables of a study's sessions, rehearsals only if they are wanted, too."""
    found = with_measures(study, recorded)
    found = replace(found, touches=found.touches.assign(**_made(per_touch=True)))
    questions = asked_questions(study, found.answers)
    return Frames(
        found=found,
        kept=found.sessions[rehearsals | found.sessions["session_kind"].ne("rehearsal")],
        questions=questions,
        lowest=float(study.rating.minimum),
        factors=factor_columns(study, questions),
    )


def asked_questions(study: Study, answers: pd.DataFrame) -> tuple[StudyQuestion, ...]:
    """Return the questions of `study`, and those that were answered under an earlier study file."""
    asked = {question.name: question for question in study.question}
    given = zip(values(answers["name"]), values(answers["when"]), strict=True)
    earlier = {
        # The kind is no longer known; any answer can be shown as a text.
        name: StudyQuestion(name=name, kind="text", when=when)
        for name, when in given
        if name not in asked
    }
    return (*asked.values(), *earlier.values())


@dataclass(frozen=True, kw_only=True, eq=False)
class Frames:
    """The tables of the sessions `kept`, some of those `found`.

    `questions` are the study's own, and those that were asked under an earlier study file; `lowest`
    is the lowest score of its scale, and `factors` has the columns of its factors.
    """

    found: Sessions
    kept: pd.DataFrame
    questions: tuple[StudyQuestion, ...]
    lowest: float
    factors: tuple[Column, ...] = ()

    @cached_property
    def sessions(self) -> pd.DataFrame:
        """A row per session."""
        named = {"session_exclusion": "exclusion_reason", "session_inclusion": "inclusion_reason"}
        table = self._sessions.rename(columns=named)
        columns = names_of((*SESSION_COLUMNS, *of_groups(table)))
        return table[columns].infer_objects().reset_index(drop=True)

    @cached_property
    def _sessions(self) -> pd.DataFrame:
        """The sessions with what the operator noted and the version in columns of their own."""
        told = {
            **{name: ("operator_noted", name.replace("_", " ")) for name in _NOTED},
            "touchbeam_version": ("versions", "touchbeam"),
        }
        texts = {
            column: pd.Series(
                [answers.get(key) for answers in self.kept[of]], self.kept.index, TEXT
            )
            for column, (of, key) in told.items()
        }
        return self.kept.rename(columns=_SESSION_NAMES).assign(**texts)

    @cached_property
    def participants(self) -> pd.DataFrame:
        """A row per participant, with the answers that were given once."""
        return participant_table(self.kept, self._trials, self.questions).infer_objects()

    @cached_property
    def trials(self) -> pd.DataFrame:
        """A row per trial that was begun, of its last attempt."""
        return self._trials.reset_index(drop=True)

    @cached_property
    def _trials(self) -> pd.DataFrame:
        names = [column.name for column in self.columns if not column.per_touch]
        # Texts would stand in the order of the alphabet: 120 V, 40 V, 80 V.
        ordered = {
            each.name: pd.CategoricalDtype([*each.levels], ordered=True)
            for each in self.factors
            if each.levels
        }
        return self._answered[names].infer_objects().astype(ordered)

    @cached_property
    def flat(self) -> pd.DataFrame:
        """The same as it is written to files, but for the columns per touch; by last attempt.

        Values of a plan or an attempt are missing for a published score.
        """
        trials = self._answered
        name, whole = response_column(self.questions).name, trials["attempts"].notna()
        table = trials.assign(
            score=_scores(trials["score"], whole=whole),
            **{name: _scores(trials[name], whole=whole)},
            started_utc=_utc(trials["started_utc"]),
            answered_utc=_utc(trials["answered_utc"]),
        )
        return table[[column.name for column in self.columns if not column.per_touch]]

    @cached_property
    def exported(self) -> pd.DataFrame:
        """The same with the columns per touch, each cell of which has a tuple."""
        spans = [slice(*span) for span in pairwise([0, *np.cumsum(self.counts).tolist()])]
        lists: dict[str, Any] = {}
        for name in _PER_TOUCH:
            told = values(self.touched[name])
            lists[name] = [tuple(told[span]) for span in spans]
        return self.flat.assign(**lists)[names_of(self.columns)]

    @cached_property
    def _ends(self) -> tuple[IntArray, IntArray]:
        """Where the touches of each trial of `flat` begin and end among those found."""
        # The touches of an attempt follow one another, and attempts are numbered as they began.
        told_of, attempts = self.found.touches["attempt_id"].to_numpy(), self.flat.index
        return np.searchsorted(told_of, attempts), np.searchsorted(told_of, attempts, "right")

    @property
    def counts(self) -> IntArray:
        """How many touches each trial of `flat` has."""
        begins, ends = self._ends
        return ends - begins

    @cached_property
    def touched(self) -> pd.DataFrame:
        """A row per touch of `flat`, in the order of its trials."""
        counts = self.counts
        number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        trials = self.flat[names_of(TOUCH_COLUMNS[:4])]
        told = self.found.touches[_PER_TOUCH].iloc[np.repeat(self._ends[0], counts) + number]
        named = trials.loc[trials.index.repeat(counts)].reset_index(drop=True).assign(touch=number)
        return named.join(told.reset_index(drop=True))

    @property
    def columns(self) -> tuple[Column, ...]:
        """The columns of `exported`; groups, factors and answers stand in the last ones."""
        tracks = of_tracks(self.found)
        own = (*of_groups(self.kept), *self.factors, *question_columns(self.questions))
        # A study without tracks is exported as before.
        of_all = map(in_tracks, COLUMNS) if tracks else COLUMNS
        return (*of_all, *tracks, response_column(self.questions), *own)

    @cached_property
    def _answered(self) -> pd.DataFrame:
        """The trials with all but the columns per touch; the index is that of the last attempt."""
        # Each attempt has its own digest: the study may be amended within a session.
        trials = self.found.trials.join(
            self._sessions.drop(columns="study_sha256"), "session_id", "inner"
        )
        planned = trials["attempts"].notna()
        touches = (
            self.found.touches["attempt_id"].value_counts().reindex(trials.index, fill_value=0)
        )
        own = {
            each.name: trials["condition"]
            .map(each.of_condition)
            .astype(TEXT if each.levels else np.float64)
            for each in self.factors
        }
        own |= self._answers(trials)
        response = responses(trials, self.lowest)
        own[response_column(self.questions).name] = pd.Series(response, trials.index)
        assigned = trials.assign(
            # A published score has a place in its table, but none in a plan.
            trial_index=trials["trial_index"].astype("Int64").where(planned),
            level=trials["level"].where(planned),
            opposite=trials["opposite"].astype("boolean").where(planned),
            touches=touches.astype("Int64").where(planned),
            **_made(per_touch=False),
        )
        # All at once: pandas warns of a hundred columns that come one by one.
        # A question may have the name of a column that is not exported.
        kept = assigned.drop(columns=[*own], errors="ignore")
        return kept.join(pd.DataFrame(own, trials.index))

    def _answers(self, trials: pd.DataFrame) -> "dict[str, pd.Series[Any]]":
        """Return answer and reaction time to each question for each of `trials`.

        An answer about a trial belongs to its last attempt, one about a block to all of its
        trials, any other to all trials of the session. One that is given once in the first session
        belongs to all trials of the participant.
        """
        answers = self.found.answers.assign(
            row=np.arange(len(self.found.answers), dtype=np.float64)
        )
        of_trial, of_block = answers["attempt_id"].notna(), answers["block"].notna()
        by_name = answers["name"].to_numpy()
        blocks = pd.MultiIndex.from_frame(trials[["session_id", "block"]].astype(np.float64))
        given = {name: values(answers[name]) for name in ("answer", "reaction_time_s")}
        table: dict[str, pd.Series[Any]] = {}
        for question in self.questions:
            own = by_name == question.name
            session = _last(answers[own & ~of_trial & ~of_block], ["session_id"])
            rows = _last(answers[own & of_trial], ["attempt_id"]).reindex(trials.index)
            # The nearest first: the trial, its block, its session, the participant.
            about_block = _last(answers[own & of_block & ~of_trial], ["session_id", "block"])
            rows = rows.fillna(pd.Series(about_block.reindex(blocks).to_numpy(), trials.index))
            rows = rows.fillna(trials["session_id"].map(session))
            if question.sessions == "first":
                once = pd.Series(
                    session.to_numpy(), session.index.map(self.found.sessions["subject"].to_dict())
                )
                once = once[~once.index.duplicated()]
                rows = rows.fillna(trials["subject"].map(once))
            places = [None if np.isnan(row) else int(row) for row in rows]
            for column, told in zip(question_columns([question]), given.values(), strict=True):
                known = [None if place is None else told[place] for place in places]
                table[column.name] = pd.Series(known, trials.index, object)
        return table

    @cached_property
    def touches(self) -> pd.DataFrame:
        """A row per touch of the trials' last attempts."""
        return self._touches.reset_index(drop=True)

    @cached_property
    def _touches(self) -> pd.DataFrame:
        names = self._trials[names_of(TOUCH_COLUMNS[:4])].rename_axis(None)
        touches = self.found.touches.merge(names, left_on="attempt_id", right_index=True)
        numbered = touches.assign(touch=touches.groupby("attempt_id").cumcount())
        return numbered[names_of(TOUCH_COLUMNS)]

    @cached_property
    def traces(self) -> pd.DataFrame:
        """A row per sample of the finger during these touches."""
        names = self._touches[names_of(TOUCH_COLUMNS[:5])]
        samples = self.found.traces.merge(names, left_on="touch_id", right_index=True)
        return samples[names_of(TRACE_COLUMNS)].reset_index(drop=True)

    def described(self, scale: str) -> pd.DataFrame:
        """Return meaning, unit and levels of each table's columns; `scale` is that of scores."""
        known = {column.name: column for column in self.columns}
        score = known["score"].description.format(scale=scale)
        known["score"] = replace(known["score"], description=score)
        of_contrasts = {column.name: column for column in CONTRAST_COLUMNS}
        people = known | {column.name: column for column in PARTICIPANT_COLUMNS}
        tables: Mapping[str, Iterable[Column]] = {
            "participants": [people[str(name)] for name in self.participants],
            "sessions": [known[str(name)] for name in self.sessions],
            "trials": [known[str(name)] for name in self._trials],
            "touches": TOUCH_COLUMNS,
            "traces": TRACE_COLUMNS,
            "contrasts": [
                *(known[name] for name in NAMED_CONTRASTS),
                of_contrasts["touch_measured"],
                *(
                    Column(name, f"Contrast by this law, {law.meaning}; missing where none is.")
                    for name, law in LAWS.items()
                ),
                *CONTRAST_COLUMNS[-2:],
            ],
        }
        rows = [
            (
                *(table, column.name, column.description, column.unit),
                "; ".join(f"{level}: {text}" for level, text in column.levels.items()) or None,
            )
            for table, columns in tables.items()
            for column in columns
        ]
        headings = ["table", "column", "meaning", "unit", "levels"]
        return pd.DataFrame(rows, columns=headings).set_index(["table", "column"])


def plan_frame(planned: Iterable[Trial | PlannedTrial]) -> pd.DataFrame:
    """Return planned trials, a row each; a column per touch holds a tuple of values."""
    return pd.DataFrame([_plan_row(trial) for trial in planned])


def _plan_row(trial: Trial | PlannedTrial) -> dict[str, Any]:
    touches = [
        each if isinstance(each, Touch) else TrackTouch.model_validate(each)
        for each in trial.touches
    ]
    return {
        **{it.name: getattr(trial, it.planned) for it in PLANNED},
        "touches": len(touches),
        **{it.name: tuple(getattr(of, it.planned) for of in touches) for it in PLANNED_PER_TOUCH},
    }
