"""The trials of tracks: which track is asked when, and which of its touches is the comparison.

Their levels are not drawn, because they follow from the answers.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, count

from protocol.journal.records import PlannedTrack
from protocol.plan.orders import Stream, StreamName
from protocol.plan.trials import Trial
from protocol.study.study import Study
from protocol.study.study_question import INTERVALS
from protocol.study.touch import Touch
from protocol.study.track import Track

TWICE = 2
"""How often the comparison comes in each interval before the next such stretch is drawn."""


def track_trials(study: Study, first_block: int, name: StreamName) -> list[Trial]:
    """Return the trials of all tracks in their order, in blocks from `first_block` on.

    Interleaved, each track that has trials left comes once, in random order, before one comes
    again; else the tracks follow each other in random order.
    """
    drawn = [[*_trials(track, (*name, track.name))] for track in study.track]
    stream = Stream(*name, "order")
    if study.design.tracks == "one after another":
        order = [trial for own in stream.shuffled(drawn) for trial in own]
    else:
        order = []
        while left := [own for own in drawn if own]:
            order += [own.pop(0) for own in stream.shuffled(left)]
    design, size = study.design, study.design.track_block
    blocks = [first_block + place // size for place in range(len(order))]
    every = design.break_every_blocks
    begins = [place % size == 0 and block > 1 for place, block in enumerate(blocks)]
    pauses = [every > 0 and (block - 1) % every == 0 for block in blocks]
    return [
        replace(trial, block=block, break_s=design.break_s * (first and pause))
        for trial, block, first, pause in zip(order, blocks, begins, pauses, strict=True)
    ]


def _trials(track: Track, name: StreamName) -> Iterator[Trial]:
    """Yield the trials of one track; the first one is at a level that the method chooses."""
    others = ["level"] * (track.trials - 1) + ["catch"] * track.catch + ["easy"] * track.easy
    stream, stretch = Stream(*name, "intervals"), [*range(1, track.intervals + 1)] * TWICE
    intervals = chain.from_iterable(stream.shuffled(stretch) for _ in count())
    for role in ["level", *Stream(*name, "roles").shuffled(others)]:
        interval = None if role == "catch" or track.intervals == 1 else next(intervals)
        yield Trial(
            kind="track",
            expected=right_answer(track, role, interval),
            touches=touches_of(track, role, interval, track.comparison),
            track=PlannedTrack(name=track.name, role=role, interval=interval),
        )


def right_answer(track: Track, role: str, interval: int | None) -> str | None:
    """Return the answer that is right; None in a catch trial of intervals, where none is."""
    if track.intervals == 1:
        return "no" if role == "catch" else "yes"
    return None if interval is None else INTERVALS[interval - 1]


def touches_of(
    track: Track, role: str, interval: int | None, comparison: Touch
) -> tuple[Touch, ...]:
    """Return the touches of a trial: the standard, but for `comparison` in its interval."""
    standard = track.standard or comparison  # catch trials and intervals have one
    touches: Sequence[Touch] = [standard] * track.intervals
    if role != "catch":
        at = (interval or 1) - 1
        touches = [*touches[:at], comparison, *touches[at + 1 :]]
    return tuple(touches)
