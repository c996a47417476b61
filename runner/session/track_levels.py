"""Tracks in a session: the level of each trial, and the trials that a stop makes needless.

Both follow from the answers in the journal alone, so that a session that was killed goes on as if
it had not been, and a trial that must be made again is made at the same level.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from device.tracks.next_level import Answer, next_level
from protocol.journal.events import TrialsNotNeeded
from protocol.journal.records import TrackAnswer
from protocol.journal.state import SessionState
from protocol.plan.track_trials import touches_of
from protocol.plan.trials import Trial
from protocol.study.study import Study
from protocol.study.track import Track
from protocol.tracks.procedure import constant_order
from runner.session.session import Session


def counted(answers: Iterable[TrackAnswer]) -> tuple[Answer, ...]:
    """Return the answers from which the next level follows: not those of catch and easy trials."""
    return tuple(
        Answer(told.level, told.correct)
        for told in answers
        if told.role == "level" and told.level is not None and told.correct is not None
    )


def level_after(
    study: Study, track: Track, answers: Iterable[TrackAnswer], slot: int, session: int
) -> int | None:
    """Return the number of the level after these answers of a track, None where it has ended.

    `slot` and `session`, whose number counts from 1, name the order of constant stimuli.
    """
    order: tuple[int, ...] = ()
    if track.method == "constant":
        order = constant_order(track, study.study.seed, session, slot)
    return next_level(track, counted(answers), order)


def level_of(session: Session, state: SessionState, trial: Trial) -> int | None:
    """Return the number of the level at which a trial of a track is made; None in a catch trial."""
    assert trial.track is not None, "only trials of tracks have a level"
    track = session.study.track_of(trial.track.name)
    match trial.track.role:
        case "level":
            told = state.tracks.get(track.name, ())
            return level_after(session.study, track, told, session.plan.slot, session.number)
        case "easy":
            return len(track.values) - 1
    return None


def as_made(session: Session, state: SessionState, trial: Trial) -> Trial:
    """Return a trial with the touches that are made: those of a track are at its level."""
    if trial.track is None or (level := level_of(session, state, trial)) is None:
        return trial
    planned, track = trial.track, session.study.track_of(trial.track.name)
    solved_v = session.volts.get(track.name, ())
    comparison = track.at(level, solved_v[level] if solved_v else None)
    touches = touches_of(track, planned.role, planned.interval, comparison)
    return replace(trial, touches=touches)


def answered(
    session: Session, state: SessionState, trial: Trial, change: str | None
) -> TrackAnswer | None:
    """Return the record of an answer to a trial of a track; None for other trials."""
    if trial.track is None:
        return None
    track, level = session.study.track_of(trial.track.name), level_of(session, state, trial)
    right = change == ("yes" if track.intervals == 1 else trial.expected)
    return TrackAnswer(
        **vars(trial.track),
        level=level,
        value=None if level is None else track.values[level],
        correct=None if trial.expected is None else right,
    )


def ended(session: Session, state: SessionState) -> Iterator[TrialsNotNeeded]:
    """Yield what is not needed any more of each track that has reached its stop."""
    left: dict[str, list[int]] = {}
    for trial in session.plan.trials:
        done = trial.index in state.answered or trial.index in state.not_needed
        if trial.track is not None and not done:
            left.setdefault(trial.track.name, []).append(trial.index)
    for name, indices in left.items():
        track = session.study.track_of(name)
        told = state.tracks.get(name, ())
        stopped = len(counted(told)) < track.trials and (
            level_after(session.study, track, told, session.plan.slot, session.number) is None
        )
        if stopped:
            yield TrialsNotNeeded(track=name, indices=tuple(indices))


def wrong_level(
    study: Study, answers: Mapping[str, Iterable[TrackAnswer]], slot: int, session: int
) -> str:
    """Return which answer was given at a level that does not follow from those before; '' if none.

    `answers` are those of a session, by track, in their order.
    """
    for name, told in answers.items():
        track = study.track_of(name)
        before: list[TrackAnswer] = []
        for each in told:
            if each.role == "level":
                wanted = level_after(study, track, before, slot, session)
                if each.level != wanted:
                    return (
                        f"answer {len(before) + 1} of the track {name!r} was given at level "
                        f"{each.level}; the answers before it lead to level {wanted}"
                    )
            before.append(each)
    return ""
