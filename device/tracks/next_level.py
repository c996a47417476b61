"""The next level of a track: a pure function of the answers that count."""

from collections.abc import Iterable, Sequence

import numpy as np

from device.tracks.posterior import choices, lattice
from protocol.journal.records import PlannedTrack, TrackAnswer
from protocol.study.study import Study
from protocol.study.track import Track, decibels
from protocol.tracks.procedure import Answer, constant_order, place_after

__all__ = ["Answer", "levels_of", "next_level"]


def next_level(track: Track, answers: Sequence[Answer], order: Sequence[int] = ()) -> int | None:
    """Return the number of the level to ask next, None where the track has ended.

    `order` is that of constant stimuli (`protocol.tracks.procedure.constant_order`), drawn before.
    """
    if len(answers) >= track.trials or _stopped(track, answers):
        return None
    if track.method == "constant":
        return order[len(answers)]
    if track.method != "quest+":
        return place_after(track, answers).level
    missed = (answer.level for answer in answers[-track.mercy :] if not answer.correct)
    hardest = max(missed, default=0) if track.mercy else 0
    weights = lattice(track).weights(answers)
    return int(choices(track, weights[np.newaxis], hardest)[0])


def _stopped(track: Track, answers: Sequence[Answer]) -> bool:
    if track.stop is None or not answers:
        return False
    reversals, width_db = track.stop.reversals, track.stop.interval_db
    if reversals is not None and len(place_after(track, answers).turned_at) >= reversals:
        return True
    if width_db is None:
        return False
    grid = lattice(track)
    _, low, high = grid.interval(grid.weights(answers)[np.newaxis])[:, 0]
    return decibels(high / low) <= width_db


def levels_of(
    track: Track, correct: Sequence[bool], order: Sequence[int] = ()
) -> tuple[Answer, ...]:
    """Return the answers with the levels that the track asks for, as far as it goes."""
    found: list[Answer] = []
    for right in correct:
        level = next_level(track, found, order)
        if level is None:
            break
        found.append(Answer(level, right))
    return tuple(found)


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


def recorded_level(
    study: Study, planned: PlannedTrack, before: Iterable[TrackAnswer], slot: int, session: int
) -> int | None:
    """Return the number of the level at which a trial is made after the answers `before` it.

    None in a catch trial, which has none.
    """
    track = study.track_of(planned.name)
    if planned.role == "level":
        return level_after(study, track, before, slot, session)
    return len(track.values) - 1 if planned.role == "easy" else None
