"""Chains of events as a journal holds them, of sessions that nobody played."""

from collections.abc import Container, Iterable, Mapping, Sequence
from datetime import UTC, datetime, timedelta

from protocol.journal.events import (
    Answered,
    Event,
    ScoresImported,
    SessionCompleted,
    SessionOpened,
    StoredEvent,
    TrialStarted,
)
from protocol.journal.records import PlannedTrial

BEGAN = datetime(2026, 1, 1, tzinfo=UTC)


def chain(events: Iterable[Event]) -> list[StoredEvent]:
    """The events as they are stored, one a second."""
    return [
        StoredEvent(
            seq=seq,
            tag=event.TAG,
            utc=BEGAN + timedelta(seconds=seq),
            monotonic_s=float(seq),
            payload=event.to_json(),
        )
        for seq, event in enumerate(events)
    ]


def opened(
    participant: str,
    conditions: Sequence[str],
    trials: Iterable[PlannedTrial] = (),
    *,
    session: int = 1,
    kind: str = "participant",
    slot: int = 0,
) -> SessionOpened:
    """The first event of a session; the journal does not hold its study."""
    return SessionOpened(
        participant=participant,
        session=session,
        kind=kind,
        study="a study",
        slot=slot,
        sequence=(),
        conditions=tuple(conditions),
        study_sha256="1" * 64,
        study_text=None,
        trials=tuple(trials),
        language="en",
        consent=None,
        seed=1,
        versions={"touchbeam": "2.0.0", "python": "3.11.7"},
    )


def scored_session(
    participant: str,
    scores: Iterable[tuple[str, int | None]],
    conditions: Sequence[str],
    *,
    session: int = 1,
    kind: str = "participant",
    practice: Container[int] = (),
) -> list[Event]:
    """A session of trials without touches: condition and score of each one, None if withheld.

    The first answer comes after 0.1 s, the next after 0.2 s and so on; trials of the indices in
    `practice` are not scored for the table.
    """
    given = list(scores)
    trials = [
        PlannedTrial.from_json(
            {
                "index": index,
                "kind": "practice" if index in practice else "trial",
                "condition": condition,
            }
        )
        for index, (condition, _) in enumerate(given)
    ]
    answered = [
        event
        for trial, (_, score) in zip(trials, given, strict=True)
        for event in (TrialStarted(index=trial.index, kind=trial.kind), answer(trial, score))
    ]
    return [
        opened(participant, conditions, trials, session=session, kind=kind),
        *answered,
        SessionCompleted(),
    ]


def asked_session(
    participant: str,
    answers: Iterable[tuple[str, str, int | None]],
    conditions: Sequence[str],
    *,
    session: int = 1,
) -> list[Event]:
    """A session of trials that expect "smoother": condition, answer and score of each one."""
    given = list(answers)
    trials = [
        PlannedTrial.from_json(
            {
                "index": index,
                "kind": "trial",
                "condition": condition,
                "question": "roughness",
                "expected": "smoother",
                "scored": True,
            }
        )
        for index, (condition, _, _) in enumerate(given)
    ]
    answered = [
        event
        for trial, (_, change, score) in zip(trials, given, strict=True)
        for event in (
            TrialStarted(index=trial.index, kind=trial.kind),
            answer(trial, score, change=change),
        )
    ]
    return [
        opened(participant, conditions, trials, session=session),
        *answered,
        SessionCompleted(),
    ]


def answer(
    trial: PlannedTrial,
    score: int | None,
    *,
    change: str | None = None,
    reaction_time_s: float | None = None,
) -> Answered:
    """The answer to `trial`."""
    taken_s = round(0.1 * (trial.index + 1), 3) if reaction_time_s is None else reaction_time_s
    return Answered(
        index=trial.index,
        kind=trial.kind,
        condition=trial.condition,
        change=change,
        agrees=None if change is None else change == trial.expected,
        score=score,
        level=trial.level,
        opposite=trial.opposite,
        reaction_time_s=(taken_s,),
        traces=(),
        judged=(),
    )


def published_chain(participant: str, scores: Mapping[str, float | None]) -> list[StoredEvent]:
    """The one event of a subject of a published table."""
    return chain(
        [
            ScoresImported(
                participant=participant,
                session=1,
                conditions=tuple(scores),
                scores=scores,
                source="scores.csv",
                source_sha256="0",
            )
        ]
    )
