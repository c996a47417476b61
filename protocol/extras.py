"""What is drawn besides the order: levels, opposite, catch and practice trials."""

from protocol.beams import beams_of
from protocol.grouping import practice_pool
from protocol.shuffles import spaced_places
from protocol.streams import Name, Stream
from protocol.study import Study
from protocol.variants import opposite_expected


def level_draws(study: Study, name: Name) -> list[list[float]]:
    """Return for each condition its levels in random order, one per repeat, equally often."""
    return [
        Stream(*name, number).shuffled(
            condition.levels * (study.design.repeats // len(condition.levels))
        )
        for number, condition in enumerate(study.condition)
    ]


def opposite_draws(study: Study, name: Name) -> list[list[bool]]:
    """Return for each condition which of its repeats run in the opposite order."""
    repeats = study.design.repeats
    drawn = []
    for number, condition in enumerate(study.condition):
        turned = study.design.opposite_repeats if opposite_expected(condition) else 0
        marks = [True] * turned + [False] * (repeats - turned)
        drawn.append(Stream(*name, number).shuffled(marks))
    return drawn


def practised(study: Study, name: Name) -> list[int]:
    """Return the conditions to practise: all of the pool in turn, in random order."""
    pool, wanted = practice_pool(study), study.design.practice_trials
    stream = Stream(*name)
    drawn: list[int] = []
    while len(drawn) < wanted:
        drawn += stream.shuffled(pool)
    return drawn[:wanted]


def catch_places(study: Study, order: list[int], name: Name) -> dict[int, int]:
    """Return {after how many scored trials: which condition} for the catch trials.

    A catch trial follows a trial that needs one beam alone and takes a condition on that beam, so
    that no beam is swapped for it. It never opens a block.
    """
    if not study.design.catch_trials:
        return {}
    beams = [beams_of(condition.touches, study.touch.beam) for condition in study.condition]
    allowed = [place for place, number in enumerate(order, start=1) if len(beams[number]) == 1]
    stream = Stream(*name)
    places = spaced_places(allowed, study.design.catch_trials, study.design.catch_apart, stream)
    return {
        place: stream.one_of(
            [number for number, needed in enumerate(beams) if needed == beams[order[place - 1]]]
        )
        for place in places
    }
