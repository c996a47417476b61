"""From the journal's events to the table of scores and the trials behind it."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from itertools import chain, groupby
from operator import itemgetter
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd

from analysis.estimates import FloatArray, NotEstimable, ScoreTable
from analysis.friction.recorded import TouchForces
from analysis.loading.exclusion_rules import excluded_by_rule
from analysis.loading.records import Exclusion, Incident, is_older, values
from analysis.loading.response import Directions, directions
from analysis.loading.sessions import Sessions, is_scored, load_sessions
from analysis.loading.study_lock import StudyLock, study_lock
from protocol.errors import BadInput, listed
from protocol.journal.events import StoredEvent
from protocol.journal.records import VirtualTruth
from protocol.study.rules import PAPERS_SCALE, Exclusions, Rating
from protocol.study.study import Study

# Why a cell of the table of scores has no score: not every such cell may be read as an answer.


class Why(StrEnum):
    """Why no trial of a subject under a condition has a score that counts."""

    CONTRARY = "contrary"
    SAME = "same"
    BLANK = "blank"
    EXCLUDED = "excluded"
    NOT_REACHED = "not reached"


EmptyCells = Mapping[tuple[int, int], Why]
"""By row and column of the table, every cell without a score and nothing else."""


class CellKind(NamedTuple):
    """What people read of a cell: its mark, what it is, and the note below the table."""

    mark: str
    words: str
    note: str


KINDS = {
    Why.CONTRARY: CellKind(
        "⇄", "felt the other way", "some or all changes were felt the other way"
    ),
    Why.SAME: CellKind("=", "no change noticed", "no change was noticed"),
    Why.BLANK: CellKind("–", "no score", "no score was given"),
    Why.EXCLUDED: CellKind("×", "excluded", "without a score, as the trials are excluded"),
    Why.NOT_REACHED: CellKind(
        "○", "not reached", "without a trial, as the session did not get there"
    ),
}
"""Of cells without a score; the first mark also follows a score if any change was felt so."""
WAYS = frozenset({Why.CONTRARY, Why.SAME})
"""Kinds of cells that the directions of their answers explain."""


def empty_cells(table: ScoreTable, counted: pd.DataFrame, excluded: pd.DataFrame) -> EmptyCells:
    """Return why each cell without a score has none.

    An answered trial that counts and has no score explains its cell before an excluded one does.
    `excluded` are the trials taken out by the operator or by a rule.
    """
    # A later line overwrites an earlier one, so that trials that count explain a cell before
    # excluded ones.
    known = dict.fromkeys(_scored_cells(excluded), Why.EXCLUDED)
    known |= dict.fromkeys(_scored_cells(counted), Why.BLANK)
    for (who, name), answers in directions(counted, "participant", "condition").items():
        if answers.contrary or answers.same:
            known[who, name] = Why.CONTRARY if answers.contrary else Why.SAME
    return {
        (int(row), int(column)): known.get(
            (table.subjects[row], table.conditions[column]), Why.NOT_REACHED
        )
        for row, column in np.argwhere(~table.given)
    }


def _scored_cells(trials: pd.DataFrame) -> Iterable[tuple[str, str]]:
    scored = trials[is_scored(trials)]
    return zip(scored["participant"], scored["condition"], strict=True)


def unscored(table: ScoreTable) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the subjects and the conditions without any score."""
    given = table.given
    return (
        tuple(who for row, who in enumerate(table.subjects) if not given[row].any()),
        tuple(name for column, name in enumerate(table.conditions) if not given[:, column].any()),
    )


def is_papers_table(study: Study, table: ScoreTable) -> bool:
    """Return whether a study's table of scores is the paper's Table 4, and may be called so."""
    return study.is_papers and set(table.conditions) == set(study.conditions)


def scale_of_scores(study: Study, kinds: Sequence[str]) -> Rating:
    """Return the scale of the scores of sessions of these kinds: the study's.

    Scores that were imported into a study to be run were not given on its scale: they were taken
    for scores on the paper's, whose words are those of the paper's conditions.
    """
    if tuple(kinds) != ("published",) or study.imported:
        return study.rating
    return PAPERS_SCALE if study.is_papers else PAPERS_SCALE.model_copy(update={"bands": ()})


NO_SCORE = "no score in the table"
Value = TypeVar("Value")


class NothingToReport(BadInput):
    """A study without the sessions that a report needs; the message says which option helps."""


@dataclass(frozen=True, kw_only=True)
class RecordedUnder:
    """What the scores were recorded under: each value once, in order of appearance."""

    versions: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()
    studies: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    devices: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class SessionOrder:
    """The numbers of a session's trials in the order in which they were answered.

    `slot` is its place in the counterbalanced order of the `group`, `conditions` those of the
    trials.
    """

    session: int
    slot: int
    group: str | None
    trials: tuple[int, ...]
    conditions: tuple[str | None, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyData:
    """The scores and trials of a study, their kinds, and what was left out and why.

    - `trials`: the answered trials that count, excluded ones not among them: `Sessions.answered`
      with `participant`, `session` and `group`.
    - `answers`: those to the study's own questions, of the sessions and trials that count:
      `Sessions.answers` with `participant`, `session`, `trial_kind` and `condition`.
    - `touches`: those of `trials`: `Sessions.touches` with `place_m`.
    - `forces`: of those of `touches` that were recorded, as `Sessions.forces`.
    - `empty`: why a cell of the table has no score.
    - `groups`: the group of each participant of these sessions who has one, left out or not.
    - `orders`: of the sessions that count, excluded trials among them; none of published scores.
    - `virtual`: true parameters of the virtual participants, by name; of their last sessions.
    - `other_rehearsals`: how many rehearsals of another study file are left out.
    - `withdrawn_completed`: how many of the withdrawn sessions had been completed.
    - `lock`: the registration, None of a study without one.
    - `older_rules`: whether the rules on who is left out are those of version 1, by which the study
      was registered or begun; and `unnoticing` the participants whom they leave out only because
      they noticed little.
    - `with_alarmed`: see `of_noticing`; None where it has the same trials.
    """

    table: ScoreTable
    kinds: tuple[str, ...]
    rehearsals_left_out: int
    unfinished: tuple[str, ...]
    unfinished_sessions: tuple[int, ...]
    sessions_excluded: int
    sessions_withdrawn: int
    trials_excluded: int
    trials: pd.DataFrame
    touches: pd.DataFrame
    forces: Mapping[int, TouchForces | NotEstimable]
    answers: pd.DataFrame
    left_out: tuple[Exclusion, ...]
    incidents: tuple[Incident, ...]
    recording: RecordedUnder
    empty: EmptyCells
    orders: tuple[SessionOrder, ...]
    virtual: Mapping[str, VirtualTruth]
    lock: StudyLock | None = None
    other_rehearsals: int = 0
    withdrawn_completed: int = 0
    groups: Mapping[str, str] = field(default_factory=dict)
    older_rules: bool = False
    unnoticing: tuple[str, ...] = ()
    with_alarmed: pd.DataFrame | None = None

    @property
    def of_noticing(self) -> pd.DataFrame:
        """The trials that tell what was noticed, those of people left out for false alarms, too.

        The rule on these would choose the catch trials by their answers: changes would seem to be
        noticed where nobody feels any.
        """
        return self.trials if self.with_alarmed is None else self.with_alarmed

    @property
    def alarmed(self) -> int:
        """How many people are in `of_noticing` alone."""
        return self.of_noticing["participant"].nunique() - self.trials["participant"].nunique()

    @property
    def scored(self) -> pd.DataFrame:
        """The trials that count for the table of scores."""
        return self.trials[is_scored(self.trials)]

    @cached_property
    def catch_scores(self) -> FloatArray | None:
        """Each subject's mean score of catch trials; None where none was scored.

        They are scored where no condition has a question, as touches at 0 V.
        """
        catch = self.trials[self.trials["trial_kind"].eq("catch")]
        means = catch.dropna(subset=["score"]).groupby("participant")["score"].mean()
        return means.reindex(self.table.subjects).to_numpy() if len(means) else None

    @cached_property
    def ways(self) -> Mapping[tuple[int, int], Directions]:
        """How the changes of each cell were answered, by row and column of the table."""
        rows, columns = (
            {name: place for place, name in enumerate(names)}
            for names in (self.table.subjects, self.table.conditions)
        )
        answers = directions(self.trials, "participant", "condition")
        return {(rows[who], columns[name]): each for (who, name), each in answers.items()}

    @cached_property
    def marks(self) -> Mapping[tuple[int, int], str]:
        """What stands in cells without a score, and after scores beside changes felt otherwise."""
        contrary = [cell for cell, answers in self.ways.items() if answers.contrary]
        why = {**dict.fromkeys(contrary, Why.CONTRARY), **self.empty}
        return {cell: KINDS[kind].mark for cell, kind in why.items()}

    @property
    def notes(self) -> list[str]:
        """What stands below the table: each mark, how often, and who or what has no score."""
        counts = Counter(self.marks.values())
        said = [
            f"{kind.mark} {kind.note}: {counts[kind.mark]} cell{'s' * (counts[kind.mark] != 1)}."
            for kind in KINDS.values()
            if counts[kind.mark]
        ]
        scored = self.scored
        beside = int((scored["score"].notna() & scored["agrees"].eq(False).fillna(False)).sum())
        if beside:
            said.append(
                f"{beside} of these scores {'was' if beside == 1 else 'were'} given after another "
                "answer than the expected one; the tests count those trials as 0."
            )
        for axis, names in enumerate(unscored(self.table)):
            what = ("Subjects", "Conditions")[axis]
            place = {name: at for at, name in enumerate(self._named[axis])}
            excluded = [name for name in names if self._is_excluded(axis, place[name])]
            if given := [name for name in names if name not in excluded]:
                said.append(f"{what} without any score: {listed(given)}.")
            if excluded:
                why = "as their trials are left out"
                said.append(f"{what} without a score that counts, {why}: {listed(excluded)}.")
        return said

    @property
    def _named(self) -> tuple[Sequence[str], Sequence[str]]:
        return self.table.subjects, self.table.conditions

    def _is_excluded(self, axis: int, place: int) -> bool:
        """Return whether every trial that a row or column of the table has is left out."""
        why = {kind for cell, kind in self.empty.items() if cell[axis] == place}
        return Why.EXCLUDED in why and why <= {Why.EXCLUDED, Why.NOT_REACHED}


def load_study_data(
    chains: Iterable[Sequence[StoredEvent]], *, rehearsals: bool, rules: Exclusions | None = None
) -> StudyData:
    """Return the scores of the sessions whose events `chains` yields, as `study_data` does."""
    return study_data(load_sessions(chains), rehearsals=rehearsals, rules=rules)


def study_data(found: Sessions, *, rehearsals: bool, rules: Exclusions | None = None) -> StudyData:
    """Return the scores of all sessions; of rehearsals too if asked for.

    A participant's score for a condition is the mean over that participant's trials. `rules` are
    the study's, on who and what is left out.

    Raises:
        NothingToReport: there are no sessions to report on.
    """
    excluded = found.sessions["exclusion"].notna()
    rehearsal = ~excluded & found.sessions["session_kind"].eq("rehearsal")
    sessions = found.sessions[~excluded if rehearsals else ~(excluded | rehearsal)]
    if sessions.empty:
        none = "no sessions here; record one with touchbeam run"
        if found.other_rehearsals:
            none = (
                "nothing but rehearsals of another study.toml here "
                f"({found.other_rehearsals}); rehearse the present one with touchbeam run"
            )
        how = "add --rehearsals (in Python rehearsals=True) to include them"
        raise NothingToReport(f"nothing but rehearsals here; {how}" if rehearsal.any() else none)
    sessions = sessions.assign(participant=sessions["subject"])
    silent = _silent(sessions, found.answered)
    sessions = sessions[~sessions["participant"].isin(silent)]
    names = sessions[["participant", "session"]]
    answered = found.answered.join(names.assign(group=sessions["group"]), "session_id", "inner")
    lock = study_lock(found.decisions, sessions)
    older = _has_older_rules(sessions, lock)
    trials, by_rule, unnoticing = excluded_by_rule(
        answered[answered["exclusion"].isna()],
        sessions.groupby("participant", sort=False)["planned_trials"].sum(),
        Exclusions() if rules is None else rules,
        older=older,
    )
    with_alarmed = None
    if rules is not None and rules.max_false_alarms is not None and not older:
        others = rules.model_copy(update={"max_false_alarms": None})
        everybody, *_ = excluded_by_rule(
            answered[answered["exclusion"].isna()],
            sessions.groupby("participant", sort=False)["planned_trials"].sum(),
            others,
            older=older,
        )
        with_alarmed = everybody if len(everybody) > len(trials) else None
    gone = {out.participant for out in by_rule if out.trial is None}
    subjects = _once(name for name in sessions["participant"] if name not in gone)
    if not subjects:
        last = by_rule[-1]
        raise NothingToReport(
            f"the rules of [exclusions] leave nobody: {last.participant} has {last.why}"
        )
    conditions = _once(chain.from_iterable(sessions["conditions"]))
    cells = trials[is_scored(trials)].groupby(["participant", "condition"])["score"].mean()
    # A subject without any score keeps a row of missing ones, and is named under the table.
    means = cells.unstack().reindex(index=subjects, columns=conditions)
    table = ScoreTable(subjects=subjects, conditions=conditions, scores=means.to_numpy())
    kept = set(names.itertuples(index=False, name=None))
    trials_left_out = [
        out
        for out in found.exclusions
        if out.trial is not None and (out.participant, out.session) in kept
    ]
    touches = found.touches[found.touches["attempt_id"].isin(trials.index)]
    return StudyData(
        table=table,
        kinds=_once(sessions["session_kind"]),
        rehearsals_left_out=0 if rehearsals else int(rehearsal.sum()),
        unfinished=tuple(sessions["participant"][~sessions["session_completed"]]),
        unfinished_sessions=tuple(sessions["session"][~sessions["session_completed"]]),
        sessions_excluded=int(excluded.sum()),
        other_rehearsals=found.other_rehearsals,
        sessions_withdrawn=found.withdrawn,
        withdrawn_completed=found.withdrawn_completed,
        trials_excluded=len(trials_left_out),
        trials=trials,
        with_alarmed=with_alarmed,
        touches=touches.assign(place_m=found.places_m),
        forces={touch: found.forces[touch] for touch in touches.index if touch in found.forces},
        answers=_answers(found, names[names["participant"].isin(subjects)], trials),
        left_out=(
            *(out for out in found.exclusions if out.trial is None),
            *trials_left_out,
            *(Exclusion(participant=who, by="import", why=NO_SCORE) for who in silent),
            *by_rule,
        ),
        incidents=tuple(it for it in found.incidents if (it.participant, it.session) in kept),
        recording=_recording(sessions),
        empty=empty_cells(table, trials, answered.drop(trials.index)),
        # With excluded trials, because they were felt and may carry over to the next.
        orders=_orders(found.answered, sessions),
        virtual={
            name: truth
            for name, truth in zip(sessions["participant"], sessions["virtual"], strict=True)
            # The column has NaN for people.
            if isinstance(truth, VirtualTruth) and name in subjects
        },
        lock=lock,
        older_rules=older,
        unnoticing=unnoticing,
        groups=dict(sessions[["participant", "group"]].dropna().itertuples(index=False, name=None)),
    )


def _silent(sessions: pd.DataFrame, answered: pd.DataFrame) -> list[str]:
    """Return the subjects without any score or answer in the tables that were imported.

    `touchbeam import` leaves them out; earlier versions stored them, and empty rows would take the
    place of Friedman's test. Where nobody has a score there is nothing else to report.
    """
    known = answered.join(sessions["participant"], on="session_id", how="inner")
    given = known["score"].notna() | known["agrees"].notna() | known["trial_kind"].ne("published")
    by_subject = given.groupby(known["participant"], sort=False).any()
    return list(by_subject.index[~by_subject]) if by_subject.any() else []


def _has_older_rules(sessions: pd.DataFrame, lock: StudyLock | None) -> bool:
    """Return whether the rules are those that version 1 registered, or began to record under.

    Published tables, which no version recorded, do not count.
    """
    if lock is not None:
        return bool(lock.registration.earlier)
    recorded = [versions for versions in sessions["versions"] if versions]
    return any(map(is_older, recorded))


def _orders(answered: pd.DataFrame, sessions: pd.DataFrame) -> tuple[SessionOrder, ...]:
    # A published score has no slot, and its place in an order is not known.
    counting = sessions[["session", "slot", "group"]].dropna(subset="slot")
    known = answered.join(counting, on="session_id", how="inner")
    names = ("session_id", "session", "slot", "group", "trial_index", "condition")
    rows = sorted(zip(*(values(known[name]) for name in names), strict=True), key=itemgetter(0))
    orders = []
    for _, own in groupby(rows, key=itemgetter(0)):
        _, session, slot, group, trials, conditions = zip(*own, strict=True)
        of = {"session": session[0], "slot": slot[0], "group": group[0]}
        orders.append(SessionOrder(**of, trials=trials, conditions=conditions))
    return tuple(orders)


def _answers(found: Sessions, names: pd.DataFrame, trials: pd.DataFrame) -> pd.DataFrame:
    """Return the answers to the study's own questions in sessions and trials that count."""
    answers = found.answers.join(names, on="session_id", how="inner")
    of_trial = answers.join(trials[["trial_kind", "condition"]], on="attempt_id")
    # An answer about a block or a session has no trial that could be left out.
    return of_trial[of_trial["attempt_id"].isna() | of_trial["trial_kind"].notna()]


def _recording(sessions: pd.DataFrame) -> RecordedUnder:
    return RecordedUnder(
        versions=_once(
            ", ".join(f"{name} {number}" for name, number in versions.items())
            for versions in sessions["versions"]
            if versions
        ),
        seeds=_once(sessions["seed"].dropna()),
        studies=_once(sessions["study_sha256"].dropna()),
        sources=_once(sessions["imported_from"].dropna()),
        devices=_once(sessions["device"].dropna()),
    )


def _once(values: Iterable[Value]) -> tuple[Value, ...]:
    """Return each value once, in order of first appearance."""
    return tuple(dict.fromkeys(values))


def changed_journal(sessions: Sequence[str]) -> str:
    """Return what the results of a journal may be where the chains of `sessions` are broken."""
    return (
        "The journal was changed by other means than touchbeam, so that these may not be the "
        f"answers that were given. The chain of hashes is broken in {', '.join(sessions)}; "
        "touchbeam verify tells more."
    )
