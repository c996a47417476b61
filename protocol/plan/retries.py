"""Trials that come again because a touch was not as instructed: where in their block they stand."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby, pairwise

from protocol.plan.randomisation import Stream
from protocol.plan.trials import Beams, Trial, beams_of, swap_count
from protocol.study.study import Study

Deferral = tuple[int, int]
"""Numbers of a trial, and of the one after which it comes again; its own if it comes at once."""


def running_order(trials: Sequence[Trial], deferrals: Iterable[Deferral]) -> list[Trial]:
    """Return the trials of a session in the order in which they are run.

    Args:
        trials: as planned.
        deferrals: in the order in which they happened.
    """
    order = list(trials)
    for index, after in deferrals:
        here = _place(order, index)
        moved = replace(order.pop(here), break_s=0.0)  # the break has been taken
        order.insert(here if after == index else _place(order, after) + 1, moved)
    return order


def _place(order: Sequence[Trial], index: int) -> int:
    return next(place for place, trial in enumerate(order) if trial.index == index)


def deferral(
    study: Study, order: Sequence[Trial], trial: Trial, mounted: str | None, stream: Stream
) -> Deferral:
    """Return after which trial of its block `trial` comes again.

    Each place is equally likely where it needs no further beam swap and breaks no rule of the
    design that the order has kept so far. Without such a place, and before the first block, the
    trial comes at once.

    Args:
        study: whose design the order follows.
        order: the trials as they are run, `trial` among them.
        trial: the running one.
        mounted: the beam on the rig.
        stream: of the draw.
    """
    here = _place(order, trial.index)
    later = [entry for entry in order[here + 1 :] if trial.block == entry.block > 0]

    def costs(after: int) -> tuple[int, int, int]:
        """Return beam swaps from now on, those of the whole order, and the rules that it breaks."""
        moved = running_order(order, [(trial.index, after)])
        return _swaps(study, moved[here:], mounted), _swaps(study, moved), _broken(study, moved)

    at_once = costs(trial.index)
    fitting = [
        entry.index
        for entry in later
        if all(cost <= limit for cost, limit in zip(costs(entry.index), at_once, strict=True))
    ]
    return trial.index, stream.one_of(fitting) if fitting else trial.index


def _swaps(study: Study, order: Sequence[Trial], mounted: str | None = None) -> int:
    own = study.touch.beam
    touches = [touch for trial in order for touch in trial.touches]
    return swap_count((mounted or own, *beams_of(touches, own)))


def _broken(study: Study, order: Sequence[Trial]) -> int:
    """Return how often an order breaks the rules on runs of a condition and on catch trials."""
    runs = groupby(trial.condition for trial in order if trial.kind == "trial")
    long_runs = [max(len(list(run)) - study.design.max_alike_in_row, 0) for _, run in runs]
    catches = [place for place, trial in enumerate(order) if trial.kind == "catch"]
    close = [later - place - 1 < study.design.catch_apart for place, later in pairwise(catches)]
    misplaced = [
        order[place].block != order[place - 1].block
        or _beams(study, order[place]) != _beams(study, order[place - 1])
        for place in catches
    ]
    return sum(long_runs) + sum(close) + sum(misplaced)


def _beams(study: Study, trial: Trial) -> Beams:
    return beams_of(trial.touches, study.touch.beam)
