"""The rules of tracks: where a staircase or limits go after each answer, and where one settles."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from statistics import geometric_mean
from typing import NamedTuple

from protocol.plan.orders import Stream
from protocol.study.track import Track

WHOLE = 0.01
"""How far, in grid steps, a step in dB may be from a whole number of them."""


class Answer(NamedTuple):
    """An answer that counts: the level that was asked, and whether it was right (or yes)."""

    level: int
    correct: bool


class TrackPlace(NamedTuple):
    """Where a track is: its next level, and what its rule remembers.

    `heading` is -1 towards harder levels, 1 towards easier ones, 0 before the first step.
    `turned_at` are the levels at which it was reversed, in their order.
    """

    level: int
    right: int = 0
    wrong: int = 0
    heading: int = 0
    turned_at: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Staircase:
    """A staircase on the grid: answers that move it, steps in levels, the number of levels."""

    down: int
    up: int
    down_steps: tuple[int, ...]
    up_steps: tuple[int, ...]
    cumulative: bool
    one_by_one: bool
    levels: int

    def moved(self, place: TrackPlace, correct: bool) -> TrackPlace:
        """Return the place after an answer."""
        right = place.right + 1 if correct else place.right * self.cumulative
        wrong = 0 if correct else place.wrong + 1
        at_first = self.one_by_one and not place.turned_at
        if correct and right >= (1 if at_first else self.down):
            heading, right = -1, 0
        elif not correct and wrong >= (1 if at_first else self.up):
            heading, wrong = 1, 0
        else:
            return place._replace(right=right, wrong=wrong)
        turned_at = place.turned_at
        if place.heading == -heading:
            turned_at += (place.level,)
        steps = self.down_steps if heading < 0 else self.up_steps
        step = steps[min(len(turned_at), len(steps) - 1)]
        level = min(max(place.level + heading * step, 0), self.levels - 1)
        return TrackPlace(level, right, wrong, heading, turned_at)


def counts(rule: str) -> tuple[int, int]:
    """Return how many correct answers and how many errors move a staircase.

    >>> counts("3 down 1 up")
    (3, 1)
    """
    down, _, up, _ = rule.split()
    return int(down), int(up)


def in_levels(track: Track) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return a staircase's steps towards harder and towards easier levels, as numbers of levels."""
    grid_db = track.levels.step_db

    def whole(levels: tuple[int, ...], db: tuple[float, ...]) -> tuple[int, ...]:
        return levels or tuple(max(1, round(step / grid_db)) for step in db if grid_db)

    down = whole(track.step_levels, track.step_db)
    return down, whole(track.up_step_levels, track.up_step_db) or down


@lru_cache(maxsize=64)
def staircase(track: Track) -> Staircase:
    """Return the rule of a track whose method is a staircase; the study file was checked."""
    down, up = counts(track.rule or "1 down 1 up")
    down_steps, up_steps = in_levels(track)
    return Staircase(
        down=down,
        up=up,
        down_steps=down_steps,
        up_steps=up_steps,
        cumulative=track.streak == "cumulative",
        one_by_one=track.first_reversal == "1 down 1 up",
        levels=len(track.values),
    )


def start(track: Track) -> TrackPlace:
    """Return where a staircase or a series of limits begins."""
    values = track.values
    first = len(values) - 1 if track.start is None else nearest(values, track.start)
    # The first series of limits descends, so that a participant knows what is to be felt.
    return TrackPlace(first, heading=-1 if track.method == "limits" else 0)


def nearest(values: Iterable[float], wanted: float) -> int:
    """Return the number of the level that is nearest to `wanted`."""
    distances = [abs(value - wanted) for value in values]
    return distances.index(min(distances))


def moved(track: Track, place: TrackPlace, correct: bool) -> TrackPlace:
    """Return the place of a staircase or of a series of limits after an answer.

    A series goes on level by level until the answer changes, or at an end of the levels; the next
    one comes from the other end.
    """
    if track.method == "staircase":
        return staircase(track).moved(place, correct)
    top, heading = len(track.levels.values) - 1, place.heading
    changed = correct == (heading > 0)
    following = place.level + heading
    if not changed and 0 <= following <= top:
        return place._replace(level=following)
    turned_at = (*place.turned_at, place.level) if changed else place.turned_at
    return TrackPlace(0 if heading < 0 else top, heading=-heading, turned_at=turned_at)


def place_after(track: Track, answers: Iterable[Answer]) -> TrackPlace:
    """Return where a staircase or a series of limits is after these answers.

    The level that was asked counts, also where it is not the one that the rule would have named.
    """
    place = start(track)
    for answer in answers:
        place = moved(track, place._replace(level=answer.level), answer.correct)
    return place


def in_mean(track: Track, turned_at: tuple[int, ...]) -> tuple[int, ...]:
    """Return those reversals that were made with the last step."""
    return turned_at[0 if track.method == "limits" else max(map(len, in_levels(track))) - 1 :]


def reversal_mean(track: Track, turned_at: tuple[int, ...]) -> float | None:
    """Return the mean level of the reversals made with the last step, None before there are two.

    It is taken in ratios where the levels are in equal ratios.
    """
    values = [track.values[level] for level in in_mean(track, turned_at)]
    if len(values) < 2:
        return None
    in_ratios = track.levels.step_db is not None
    return geometric_mean(values) if in_ratios else sum(values) / len(values)


def constant_order(track: Track, seed: int, *name: object) -> tuple[int, ...]:
    """Return the levels of constant stimuli in their order, each once before one comes again.

    `name` tells the participant and the session whose order it is.
    """
    stream = Stream(seed, "track", track.name, *name)
    drawn: list[int] = []
    while len(drawn) < track.trials:
        drawn += stream.shuffled(range(len(track.values)))
    return tuple(drawn[: track.trials])


def most_reversals(track: Track) -> int:
    """Return the largest number of reversals that a track can have within its trials."""
    if track.method == "limits":
        return track.trials
    if track.method != "staircase":
        return 0
    fewer, more = sorted(counts(track.rule or "1 down 1 up"))
    by_rule = track.first_reversal == "by the rule"
    # Correct answers and errors turn it by turns; at first those that take fewer.
    turns, spent = -1, 0
    while spent <= track.trials:
        turns += 1
        spent += (fewer, more)[turns % 2] if by_rule or turns > 1 else 1
    return max(turns - 1, 0)


def converges_at(rule: Staircase) -> float:
    """Return the share correct at which steps down and up balance.

    The counts of correct answers and of errors are a Markov chain, whose states are left by a step
    to a harder or an easier level. At a share p of correct answers its stationary distribution
    gives how often each step is made; the share at which the mean of all steps is 0 is found by
    bisection (Levitt, J. Acoust. Soc. Am. 49, 1971, 467-477; weighted: Kaernbach, Percept.
    Psychophys. 49, 1991, 227-229). The last steps of the staircase count.

    >>> steps = {"down_steps": (1,), "up_steps": (1,), "one_by_one": False, "levels": 9}
    >>> round(converges_at(Staircase(down=3, up=1, cumulative=False, **steps)), 4)
    0.7937
    >>> round(converges_at(Staircase(down=3, up=1, cumulative=True, **steps)), 4)
    0.75
    """
    low, high = 0.0, 1.0
    for _ in range(24):
        middle = (low + high) / 2
        if _drift(rule, middle) > 0:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _drift(rule: Staircase, share: float) -> float:
    """Return the mean step of an answer towards easier levels, in levels of the grid."""
    chain, to_easier = _chain(rule)
    shares = dict.fromkeys(chain, 1 / len(chain))
    # Averaged with itself, because a chain that goes round in a circle would never settle.
    for _ in range(300):
        following = dict.fromkeys(chain, 0.0)
        for state, here in shares.items():
            after_right, after_wrong = chain[state]
            following[after_right] += here * share
            following[after_wrong] += here * (1 - share)
        shares = {state: (shares[state] + following[state]) / 2 for state in chain}
    return sum(
        here * (share * to_easier[state][0] + (1 - share) * to_easier[state][1])
        for state, here in shares.items()
    )


_Counts = tuple[int, int]


def _chain(
    rule: Staircase,
) -> tuple[dict[_Counts, tuple[_Counts, _Counts]], dict[_Counts, tuple[int, int]]]:
    """Return, by the counts, those after a correct answer and an error, and the steps made."""
    sizes = {-1: -rule.down_steps[-1], 0: 0, 1: rule.up_steps[-1]}
    chain: dict[_Counts, tuple[_Counts, _Counts]] = {}
    steps: dict[_Counts, tuple[int, int]] = {}
    waiting = [(0, 0)]
    while waiting:
        state = waiting.pop()
        if state in chain:
            continue
        # A reversal before, so that no beginning counts.
        here = TrackPlace(1, *state, 0, (1,))
        after = [rule.moved(here, correct) for correct in (True, False)]
        right, wrong = ((place.right, place.wrong) for place in after)
        chain[state] = right, wrong
        steps[state] = sizes[after[0].heading], sizes[after[1].heading]
        waiting += [right, wrong]
    return chain, steps
