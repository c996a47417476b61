"""From the journal's events to the table of scores and the trials behind it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

import pandas as pd

from analysis.estimates import NotEstimable
from analysis.friction.recorded import TouchForces
from analysis.loading.exclusions import excluded_by_rule
from analysis.loading.missing_scores import EmptyCells, empty_cells, readings
from analysis.loading.records import Exclusion, Incident, values
from analysis.loading.score_table import ScoreTable
from analysis.loading.sessions import Sessions, is_scored, load_sessions
from analysis.loading.study_lock import StudyLock, study_lock
from protocol.errors import BadInput
from protocol.journal.events import StoredEvent
from protocol.journal.records import VirtualTruth
from protocol.study.rules import Exclusions

Value = TypeVar("Value")


class NothingToReport(BadInput):
    """A study without the sessions that a report needs; the message says which option helps."""


class OnlyRehearsals(NothingToReport):
    """A study of rehearsals alone, which were not asked for."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Under what the scores were recorded: each value once, in order of appearance."""

    versions: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()
    studies: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    devices: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class SessionOrder:
    """The numbers of a session's trials in the order in which they were answered.

    `slot` is its place in the counterbalanced order, `conditions` those of the trials.
    """

    session: int
    slot: int
    trials: tuple[int, ...]
    conditions: tuple[str | None, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyData:
    """The scores and trials of a study, their kinds, and what was left out and why.

    - `trials`: the answered trials that count, excluded ones not among them: `Sessions.answered`
      with `participant` and `session`.
    - `answers`: those to the study's own questions, of the sessions and trials that count:
      `Sessions.answers` with `participant`, `session`, `trial_kind` and `condition`.
    - `touches`: those of `trials`: `Sessions.touches` with `place_m`.
    - `forces`: of those of `touches` that were recorded, as `Sessions.forces`.
    - `empty`: why a cell of the table has no score.
    - `orders`: of the sessions that count, excluded trials among them; none of published scores.
    - `virtual`: true parameters of the virtual participants, by name; of their last sessions.
    - `withdrawn_completed`: how many of the withdrawn sessions had been completed.
    - `lock`: the registration, None of a study without one.
    """

    table: ScoreTable
    kinds: tuple[str, ...]
    rehearsals_left_out: int
    unfinished: tuple[str, ...]
    sessions_excluded: int
    sessions_withdrawn: int
    trials_excluded: int
    trials: pd.DataFrame
    touches: pd.DataFrame
    forces: Mapping[int, TouchForces | NotEstimable]
    answers: pd.DataFrame
    left_out: tuple[Exclusion, ...]
    incidents: tuple[Incident, ...]
    recording: Recording
    empty: EmptyCells
    orders: tuple[SessionOrder, ...]
    virtual: Mapping[str, VirtualTruth]
    lock: StudyLock | None = None
    withdrawn_completed: int = 0

    @property
    def scored(self) -> pd.DataFrame:
        """The trials that count for Table 4."""
        return self.trials[is_scored(self.trials)]

    def readings(self, least: float = 0.0) -> dict[str, ScoreTable]:
        """Return the table under each reading of withheld scores, by name.

        `least` is the lowest score of the scale.
        """
        return readings(self.table, self.trials, least)


def load_study_data(
    chains: Iterable[Sequence[StoredEvent]], *, rehearsals: bool, rules: Exclusions | None = None
) -> StudyData:
    """Return the scores of the sessions whose events `chains` yields, as `study_data` does."""
    return study_data(load_sessions(chains), rehearsals=rehearsals, rules=rules)


def study_data(found: Sessions, *, rehearsals: bool, rules: Exclusions | None = None) -> StudyData:
    """Return the scores of all sessions; of rehearsals too if asked for.

    A participant's score for a condition is the mean over that participant's trials.

    Args:
        found: all sessions of the journal.
        rehearsals: whether rehearsals count.
        rules: the study's rules on who and what is left out.

    Raises:
        NothingToReport: there are no sessions to report on.
    """
    excluded = found.sessions["exclusion"].notna()
    rehearsal = ~excluded & found.sessions["session_kind"].eq("rehearsal")
    sessions = found.sessions[~excluded if rehearsals else ~(excluded | rehearsal)]
    if sessions.empty:
        if rehearsal.any():
            raise OnlyRehearsals("nothing but rehearsals here; add --rehearsals to include them")
        raise NothingToReport("no sessions here")
    sessions = sessions.assign(participant=sessions["subject"])
    names = sessions[["participant", "session"]]
    answered = found.answered.join(names, on="session_id", how="inner")
    trials, by_rule = excluded_by_rule(
        answered[answered["exclusion"].isna()], Exclusions() if rules is None else rules
    )
    gone = {out.participant for out in by_rule if out.trial is None}
    subjects = _once(name for name in sessions["participant"] if name not in gone)
    if not subjects:
        last = by_rule[-1]
        raise NothingToReport(
            f"the rules of [exclusions] leave nobody: {last.participant} has {last.why}"
        )
    conditions = _once(chain.from_iterable(sessions["conditions"]))
    cells = trials[is_scored(trials)].groupby(["participant", "condition"])["score"].mean()
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
        sessions_excluded=int(excluded.sum()),
        sessions_withdrawn=found.withdrawn,
        withdrawn_completed=found.withdrawn_completed,
        trials_excluded=len(trials_left_out),
        trials=trials,
        touches=touches.assign(place_m=found.places_m),
        forces={touch: found.forces[touch] for touch in touches.index if touch in found.forces},
        answers=_answers(found, names[names["participant"].isin(subjects)], trials),
        left_out=(
            *(out for out in found.exclusions if out.trial is None),
            *trials_left_out,
            *by_rule,
        ),
        incidents=tuple(it for it in found.incidents if (it.participant, it.session) in kept),
        recording=_recording(sessions),
        empty=empty_cells(table, trials, answered.drop(trials.index)),
        orders=_orders(found.answered, sessions),
        virtual={
            name: truth
            for name, truth in zip(sessions["participant"], sessions["virtual"], strict=True)
            if isinstance(truth, VirtualTruth) and name in subjects
        },
        lock=study_lock(found.decisions, sessions),
    )


def _orders(answered: pd.DataFrame, sessions: pd.DataFrame) -> tuple[SessionOrder, ...]:
    counting = sessions[["session", "slot"]].dropna()
    known = answered.join(counting, on="session_id", how="inner")
    return tuple(
        SessionOrder(
            session=int(rows["session"].iloc[0]),
            slot=int(rows["slot"].iloc[0]),
            trials=tuple(rows["trial_index"].tolist()),
            conditions=tuple(values(rows["condition"])),
        )
        for _, rows in known.groupby("session_id")
    )


def _answers(found: Sessions, names: pd.DataFrame, trials: pd.DataFrame) -> pd.DataFrame:
    """Return the answers to the study's own questions in sessions and trials that count."""
    answers = found.answers.join(names, on="session_id", how="inner")
    of_trial = answers.join(trials[["trial_kind", "condition"]], on="attempt_id")
    return of_trial[of_trial["attempt_id"].isna() | of_trial["trial_kind"].notna()]


def _recording(sessions: pd.DataFrame) -> Recording:
    return Recording(
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
