"""Tracks in a session: the level of each trial, and the trials that a stop makes needless.

Both follow from the answers in the journal alone, so that a session that was killed goes on as if
it had not been, and a trial that must be made again is made at the same level.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

from device.tracks.next_level import Answer, counted, level_after, recorded_level
from device.tracks.posterior import estimate
from protocol.journal.events import TrialsNotNeeded
from protocol.journal.records import TrackAnswer
from protocol.journal.state import SessionState
from protocol.plan.track_trials import touches_of
from protocol.plan.trials import Trial
from protocol.study.track import Track
from protocol.tracks.procedure import place_after
from runner.session.session import Session


def level_of(session: Session, state: SessionState, trial: Trial) -> int | None:
    """Return the number of the level at which a trial of a track is made; None in a catch trial."""
    assert trial.track is not None, "only trials of tracks have a level"
    before = state.tracks.get(trial.track.name, ())
    return recorded_level(session.study, trial.track, before, session.plan.slot, session.number)


_UNITS = {"voltage": " V", "frequency": " of resonance", "contrast": "", "place": " m"}


def standing(session: Session, state: SessionState, trial: Trial | None) -> str:
    """Return where the track of the running trial stands, in words; '' if it has none."""
    if trial is None or trial.track is None:
        return ""
    track = session.study.track_of(trial.track.name)
    unit, level = _UNITS[track.axis], level_of(session, state, trial)
    answers = counted(state.tracks.get(track.name, ()))
    said = ["no level" if level is None else f"level {level} ({track.values[level]:.4g}{unit})"]
    if track.turns:
        turned = len(place_after(track, answers).turned_at)
        said.append(f"{turned} reversal{'s' * (turned != 1)}")
    if answers:
        said.append(_threshold(track, answers) + unit)
    return f"{track.name}: {', '.join(said)}"


# The view is made anew several times a touch, between which no answer comes.
@lru_cache(maxsize=8)
def _threshold(track: Track, answers: tuple[Answer, ...]) -> str:
    found = estimate(track, answers)
    low, high = found.threshold_ci
    return f"threshold {found.threshold:.3g} ({low:.3g} to {high:.3g})"


def as_made(session: Session, state: SessionState, trial: Trial) -> Trial:
    """Return a trial with the touches that are made: those of a track are at its level."""
    if trial.track is None or (level := level_of(session, state, trial)) is None:
        return trial
    planned, track = trial.track, session.study.track_of(trial.track.name)
    solved_v = session.volts.get(track.name, ())
    comparison = track.at(level, solved_v[level] if solved_v else None)
    return replace(trial, touches=touches_of(track, planned.role, planned.interval, comparison))


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
