"""From the journal's events to the table of scores and the trials behind it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from analysis.loading.exclusions import Exclusion, excluded_by_rule
from analysis.loading.missing_scores import EmptyCells, empty_cells
from analysis.loading.score_table import ScoreTable
from analysis.loading.sessions import Happened, Incident, SessionStory, TrialRow, session_story
from protocol.errors import BadInput
from protocol.study.design import Exclusions


class NothingToReport(BadInput):
    """A study without the sessions that a report needs; the message says which option helps."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """Under what the scores were recorded: each value once, in order of appearance."""

    versions: tuple[str, ...] = ()
    seeds: tuple[int, ...] = ()
    studies: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class StudyData:
    """What was found: scores and trials, whose kind they are, and what was left out and why.

    `rows` are the trials that count: excluded ones are not among them. `empty` says why a cell of
    the table has no score.
    """

    table: ScoreTable
    kinds: tuple[str, ...]
    rehearsals_left_out: int
    unfinished: tuple[str, ...]
    sessions_excluded: int = 0
    sessions_withdrawn: int = 0
    trials_excluded: int = 0
    rows: tuple[TrialRow, ...] = ()
    left_out: tuple[Exclusion, ...] = ()
    incidents: tuple[Incident, ...] = ()
    recording: Recording = Recording()
    empty: EmptyCells = field(default_factory=dict)


def load_study_data(
    sessions: Iterable[Sequence[Happened]],
    *,
    rehearsals: bool,
    rules: Exclusions | None = None,
) -> StudyData:
    """Return the scores of all sessions; of rehearsals too if asked for.

    A participant's score for a condition is the mean over that participant's trials.

    Args:
        sessions: the events of each session, read one session at a time.
        rehearsals: whether rehearsals count.
        rules: the study's rules on who and what is left out.

    Raises:
        NothingToReport: there are no sessions to report on.
    """
    found = _found(sessions, rehearsals=rehearsals)
    wanted = found.records
    if not wanted:
        raise NothingToReport(
            "nothing but rehearsals here; name them with --rehearsals"
            if found.rehearsals_left_out
            else "no sessions here"
        )
    rows, by_rule = excluded_by_rule(
        [row for record in wanted for row in record.kept], _or_none(rules)
    )
    gone = {out.participant for out in by_rule if out.trial is None}
    subjects = _in_order(r.participant for r in wanted if r.participant not in gone)
    if not subjects:
        raise NothingToReport(
            f"the rules of [exclusions] leave nobody: {by_rule[-1].participant} has "
            f"{by_rule[-1].why}"
        )
    conditions = _in_order(name for record in wanted for name in record.conditions)
    table = ScoreTable(
        subjects=subjects, conditions=conditions, scores=_means(rows, subjects, conditions)
    )
    return StudyData(
        table=table,
        kinds=_in_order(record.kind for record in wanted),
        rehearsals_left_out=found.rehearsals_left_out,
        unfinished=tuple(record.participant for record in wanted if not record.finished),
        sessions_excluded=found.excluded,
        sessions_withdrawn=found.withdrawn,
        trials_excluded=sum(len(record.excluded_trials) for record in wanted),
        rows=rows,
        left_out=(*found.left_out, *_trials_left_out(wanted), *by_rule),
        incidents=tuple(incident for record in wanted for incident in record.incidents),
        recording=_recording(wanted),
        empty=empty_cells(table, rows, _taken_out(wanted, rows)),
    )


@dataclass(kw_only=True)
class _Found:
    records: list[SessionStory]
    left_out: list[Exclusion]
    rehearsals_left_out: int = 0
    excluded: int = 0
    withdrawn: int = 0


def _found(sessions: Iterable[Sequence[Happened]], *, rehearsals: bool) -> _Found:
    """Read every session once and keep what the report needs of it."""
    found = _Found(records=[], left_out=[])
    for events in sessions:
        if not events or events[0][0] == "study-amended":
            continue
        match _gone(events):
            case "withdrawn":
                found.withdrawn += 1
            case "session-excluded":
                found.excluded += 1
                found.left_out += _session_left_out(events)
            case _ if not rehearsals and events[0][1].get("kind") == "rehearsal":
                found.rehearsals_left_out += 1
            case _:
                found.records.append(session_story(events))
    return found


def _gone(events: Sequence[Happened]) -> str:
    """The tag of the event that took the whole session out, empty if none did."""
    tags = [tag for tag, _ in events if tag in {"session-excluded", "withdrawn"}]
    return tags[-1] if tags else ""


def _session_left_out(events: Sequence[Happened]) -> list[Exclusion]:
    opened = events[0][1]
    return [
        Exclusion(
            participant=opened["participant"],
            session=opened.get("session", 1),
            by="operator",
            why=payload.get("reason", ""),
        )
        for tag, payload in events
        if tag == "session-excluded"
    ]


def _trials_left_out(records: Sequence[SessionStory]) -> list[Exclusion]:
    return [
        Exclusion(
            participant=record.participant,
            session=record.number,
            trial=index,
            by="operator",
            why=why,
        )
        for record in records
        for index, why in record.excluded_trials.items()
    ]


def _taken_out(records: Sequence[SessionStory], counted: Sequence[TrialRow]) -> list[TrialRow]:
    """The answered trials that do not count, by the operator's word or by a rule."""
    kept = {(row.participant, row.session, row.index) for row in counted}
    return [
        row
        for record in records
        for row in record.rows
        if (row.participant, row.session, row.index) not in kept
    ]


def _means(
    rows: Sequence[TrialRow], subjects: tuple[str, ...], conditions: tuple[str, ...]
) -> np.typing.NDArray[np.float64]:
    """Return the mean score of each cell, NaN where no score was given."""
    row_of = {name: row for row, name in enumerate(subjects)}
    column_of = {name: column for column, name in enumerate(conditions)}
    sums = np.zeros((len(subjects), len(conditions)))
    counts = np.zeros_like(sums)
    for row in rows:
        if row.is_scored and row.condition is not None and not np.isnan(row.score):
            cell = row_of[row.participant], column_of[row.condition]
            sums[cell] += row.score
            counts[cell] += 1
    return np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)


def _recording(records: Sequence[SessionStory]) -> Recording:
    opened = [record.opened for record in records]
    return Recording(
        versions=_in_order(
            ", ".join(f"{name} {number}" for name, number in o["versions"].items())
            for o in opened
            if "versions" in o
        ),
        seeds=tuple(dict.fromkeys(o["seed"] for o in opened if "seed" in o)),
        studies=_in_order(o["study_sha256"] for o in opened if "study_sha256" in o),
        sources=_in_order(
            f"{o['source']} (SHA-256 {o['source_sha256']})" for o in opened if "source" in o
        ),
    )


def _or_none(rules: Exclusions | None) -> Exclusions:
    return Exclusions() if rules is None else rules


def _in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Each name once, in order of first appearance."""
    return tuple(dict.fromkeys(names))


def changed_journal(sessions: Sequence[str]) -> str:
    """Return what the results of a journal may be where the chains of `sessions` are broken."""
    return (
        "The journal was changed by other means than touchbeam, so that these may not be the "
        f"answers that were given. The chain of hashes is broken in {', '.join(sessions)}; "
        "touchbeam verify tells more."
    )
