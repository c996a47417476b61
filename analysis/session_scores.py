"""From the journal's events to the table of scores. Knows tags and payloads, no code of a session.

docs/journal.md lists the tags.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean
from typing import Any

import numpy as np

from analysis.scores import ScoreTable
from protocol.errors import BadInput

Happened = tuple[str, Mapping[str, Any]]
"""An event as far as the analysis is concerned: its tag and its payload."""


class NothingToReport(BadInput):
    """A study without the sessions that a report needs; the message says which option helps."""


@dataclass(frozen=True, kw_only=True)
class Loaded:
    """What was found: the scores, whose kind they are, and what was left out."""

    table: ScoreTable
    kinds: tuple[str, ...]
    rehearsals_left_out: int
    unfinished: tuple[str, ...]
    sessions_excluded: int = 0
    sessions_withdrawn: int = 0
    trials_excluded: int = 0


def loaded(sessions: Iterable[Sequence[Happened]], *, rehearsals: bool) -> Loaded:
    """Return the scores of all sessions; of rehearsals too if asked for.

    A participant's score for a condition is the mean over that participant's trials.

    Raises:
        NothingToReport: there are no sessions to report on.
    """
    chains = [events for events in sessions if events and events[0][0] != "study-amended"]
    gone = [_gone(events) for events in chains]
    all_sessions = [
        _Session.of(events) for events, why in zip(chains, gone, strict=True) if not why
    ]
    wanted = [s for s in all_sessions if rehearsals or s.kind != "rehearsal"]
    if not wanted:
        raise NothingToReport(
            "nothing but rehearsals here; name them with --rehearsals"
            if all_sessions
            else "no sessions here"
        )
    conditions = _in_order(name for session in wanted for name in session.conditions)
    subjects = _in_order(session.participant for session in wanted)
    return Loaded(
        table=ScoreTable(
            subjects=subjects,
            conditions=conditions,
            scores=np.array(
                [[_mean(wanted, who, what) for what in conditions] for who in subjects]
            ),
        ),
        kinds=_in_order(session.kind for session in wanted),
        rehearsals_left_out=len(all_sessions) - len(wanted),
        unfinished=tuple(session.participant for session in wanted if not session.finished),
        sessions_excluded=gone.count("session-excluded"),
        sessions_withdrawn=gone.count("withdrawn"),
        trials_excluded=sum(session.trials_excluded for session in wanted),
    )


@dataclass(frozen=True, kw_only=True)
class _Session:
    participant: str
    kind: str
    conditions: tuple[str, ...]
    scores: tuple[tuple[str, float], ...]
    finished: bool
    trials_excluded: int = 0

    @classmethod
    def of(cls, events: Sequence[Happened]) -> "_Session":
        tag, opened = events[0]
        if tag == "scores-imported":
            return cls(
                participant=opened["participant"],
                kind="published",
                conditions=tuple(opened["conditions"]),
                scores=_given(opened["scores"].items()),
                finished=True,
            )
        excluded = {payload["index"] for tag, payload in events if tag == "trial-excluded"}
        answers = [
            payload
            for tag, payload in events
            if tag == "answered" and payload["kind"] == "trial" and payload["index"] not in excluded
        ]
        return cls(
            participant=opened["participant"],
            kind=opened["kind"],
            conditions=tuple(opened["conditions"]),
            scores=_given((answer["condition"], answer["score"]) for answer in answers),
            finished=any(tag == "session-completed" for tag, _ in events),
            trials_excluded=len(excluded),
        )


def _gone(events: Sequence[Happened]) -> str:
    """The tag of the event that took the whole session out, empty if none did."""
    tags = [tag for tag, _ in events if tag in {"session-excluded", "withdrawn"}]
    return tags[-1] if tags else ""


def _given(scores: Iterable[tuple[str | None, float | None]]) -> tuple[tuple[str, float], ...]:
    return tuple(
        (condition, float(score))
        for condition, score in scores
        if condition is not None and score is not None
    )


def _mean(sessions: list[_Session], participant: str, condition: str) -> float:
    scores = [
        score
        for session in sessions
        if session.participant == participant
        for name, score in session.scores
        if name == condition
    ]
    return fmean(scores) if scores else float("nan")


def _in_order(names: Iterable[str]) -> tuple[str, ...]:
    """Each name once, in order of first appearance."""
    return tuple(dict.fromkeys(names))
