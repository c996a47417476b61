"""Tracks in a session: the level of each trial, and the trials that a stop makes needless.

Both follow from the answers in the journal alone, so that a session that was killed goes on as if
it had not been, and a trial that must be made again is made at the same level.
"""

from collections.abc import Iterator
from dataclasses import replace

from device.tracks.next_level import counted, level_after, recorded_level
from protocol.journal.events import TrialsNotNeeded
from protocol.journal.records import TrackAnswer
from protocol.journal.state import SessionState
from protocol.plan.track_trials import touches_of
from protocol.plan.trials import Trial
from runner.session.session import Session


def level_of(session: Session, state: SessionState, trial: Trial) -> int | None:
    """Return the number of the level at which a trial of a track is made; None in a catch trial."""
    assert trial.track is not None, "only trials of tracks have a level"
    before = state.tracks.get(trial.track.name, ())
    return recorded_level(session.study, trial.track, before, session.plan.slot, session.number)


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
