"""The plan of a session: opening, practice, and scored trials in the slot's order with catches."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import count, groupby, islice, pairwise, product
from math import gcd
from typing import Any, Literal, NamedTuple

from protocol.plan import orders
from protocol.plan.track_trials import track_trials
from protocol.plan.trials import Plan, Trial, beams_of, swaps
from protocol.study.study import Condition, Study
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Slide, SlidePass


def _draws(
    study: Study, stream_name: Callable[[str], orders.StreamName]
) -> Iterator[list[tuple[float, bool]]]:
    """Yield for each condition the level of each repeat, and whether it runs in the opposite order.

    All levels come equally often; either is in random order.
    """
    repeats, asked = study.design.repeats, study.design.opposite_repeats
    for number, condition in enumerate(study.condition):
        levels = condition.levels * (repeats // len(condition.levels))
        turned = asked if orders.opposite_expected(condition) else 0
        opposites = [True] * turned + [False] * (repeats - turned)
        drawn = (
            orders.Stream(*stream_name("levels"), number).shuffled(levels),
            orders.Stream(*stream_name("opposite"), number).shuffled(opposites),
        )
        yield [*zip(*drawn, strict=True)]


def catch_places(study: Study, order: list[int], name: orders.StreamName) -> dict[int, int]:
    """Return the condition of each catch trial by the number of scored trials before it.

    A catch trial follows a trial that needs only one beam and takes a condition on that beam, so
    that it needs no beam swap. It never opens a block.
    """
    if not study.design.catch_trials:
        return {}
    beams = [beams_of(condition.touches, study.touch.beam) for condition in study.condition]
    # A catch trial takes the beam of the trial before it, so that it gives nobody away by a swap.
    allowed = [place for place, number in enumerate(order, start=1) if len(beams[number]) == 1]
    stream, design = orders.Stream(*name), study.design
    chosen: dict[int, int] = {}
    for place in orders.spaced_places(allowed, design.catch_trials, design.catch_apart, stream):
        same = [at for at, needed in enumerate(beams) if needed == beams[order[place - 1]]]
        chosen[place] = stream.one_of(same)
    return chosen


def plan(study: Study, slot: int, session: int = 1) -> Plan:
    """Return the plan for a `slot`, counted from 0 over the cohort, and a `session`, from 1.

    The study's seed determines the plan: orders (see `protocol.plan.orders`), levels,
    opposite, catch and practice trials are each drawn from a random stream of their own. Whether
    the design can be met `protocol.study_file.limits` says beforehand.
    """

    # A stream for each purpose: a change of one part of the design leaves the others as they were.
    def stream_name(purpose: str) -> orders.StreamName:
        return (study.study.seed, purpose, session, slot)

    order = orders.ordered_conditions(study, slot, session) if study.condition else []
    practice = _practice(study, stream_name("practice"))
    opening = (
        Trial(kind=item.kind, question=item.question, expected=item.expected, touches=item.touches)
        for item in study.opening
    )
    trials = [*opening, *practice, *_main(study, order, stream_name)]
    first = order[-1][0] + 1 if order else 1
    trials += track_trials(study, first, stream_name("tracks"))
    return Plan(
        slot=slot,
        session=session,
        sequence=tuple(study.conditions[number] for _, number in order),
        trials=tuple(replace(trial, index=index) for index, trial in enumerate(trials)),
    )


SlotState = Literal["free", "running", "done", "dropped"]


def next_slot(states: Sequence[SlotState]) -> int:
    """Return the slot, from 0, of the next participant: the first neither running nor done.

    The slot of a participant who dropped out is used again, so that the orders stay balanced over
    the participants who finish. An interrupted session that may be resumed is still `running`.

    >>> next_slot(["done", "dropped", "running"])
    1
    >>> next_slot(["done", "running"])
    2
    """
    free = (slot for slot, state in enumerate(states) if state not in {"running", "done"})
    return next(free, len(states))


def arrivals(study: Study, kind: str) -> Iterator[tuple[str, int]]:
    """Yield group and slot of each participant of a `kind` of session, in the order of arrival.

    Groups are shuffled in blocks that hold each of them in proportion to its size, so that the
    seed and the place in the order of arrival decide, and all groups grow alike.
    """
    least = gcd(*(group.size for group in study.group))
    block = [group.name for group in study.group for _ in range(group.size // least)]
    slots = {name: count() for name in study.groups}
    for number in count():
        for name in orders.Stream(study.study.seed, "arrival", kind, number).shuffled(block):
            yield name, next(slots[name])


def cohort_plans(study: Study, participants: int) -> tuple[Plan, ...]:
    """Return the plans of the first sessions of a cohort, in the order of arrival."""
    places = islice(arrivals(study, "participant"), participants) if study.group else ()
    grouped = (replace(plan(study.of_group(name), slot), group=name) for name, slot in places)
    return tuple(grouped if study.group else (plan(study, slot) for slot in range(participants)))


def _practice(study: Study, name: orders.StreamName) -> Iterator[Trial]:
    """Yield trials of the conditions to practise: all in random order, again and again."""
    stream, drawn = orders.Stream(*name), list[int]()
    while len(drawn) < study.design.practice_trials:
        drawn += stream.shuffled(orders.practice_pool(study))
    for number in drawn[: study.design.practice_trials]:
        condition = study.condition[number]
        yield replace(_trial(condition, condition.levels[-1], turned=False), kind="practice")


def _main(
    study: Study, order: list[tuple[int, int]], stream_name: Callable[[str], orders.StreamName]
) -> Iterator[Trial]:
    """Yield the scored trials block by block, with catch trials after some of them."""
    draws = [*_draws(study, stream_name)]
    catches = catch_places(study, [number for _, number in order], stream_name("catch"))
    every, block_before = study.design.break_every_blocks, 1
    for place, (block, number) in enumerate(order, start=1):
        pauses = every > 0 and block != block_before and (block - 1) % every == 0
        level, turned = draws[number].pop()
        break_s = study.design.break_s if pauses else 0.0
        yield _trial(study.condition[number], level, turned=turned, block=block, break_s=break_s)
        if place in catches:
            condition = study.condition[catches[place]]
            # A catch trial has everything of its condition but the drive, so that nothing else
            # tells it apart.
            still = _trial(condition, 0.0, turned=False, block=block)
            same = QUESTIONS[condition.question].same if condition.question else None
            yield replace(still, kind="catch", expected=same, scored=False)
        block_before = block


def _trial(
    condition: Condition, level: float, *, turned: bool, block: int = 0, break_s: float = 0.0
) -> Trial:
    touches = orders.at_level(condition.touches, level)
    return Trial(
        block=block,
        kind="trial",
        condition=condition.name,
        question=condition.question,
        expected=orders.opposite_expected(condition) if turned else condition.expected,
        scored=True,
        touches=orders.opposite(touches) if turned else touches,
        level=level,
        opposite=turned,
        break_s=break_s,
    )


Deferral = tuple[int, int]
"""Numbers of a trial, and of the one after which it comes again; its own if it comes at once."""


def running_order(trials: Sequence[Trial], deferrals: Iterable[Deferral]) -> list[Trial]:
    """Return the trials of a plan in the order in which they are run, after these deferrals."""
    order = list(trials)
    for index, after in deferrals:
        here = _place(order, index)
        moved = replace(order.pop(here), break_s=0.0)  # the break has been taken
        order.insert(here if after == index else _place(order, after) + 1, moved)
    return order


def _place(order: Sequence[Trial], index: int) -> int:
    return next(place for place, trial in enumerate(order) if trial.index == index)


def deferral(
    study: Study, order: Sequence[Trial], trial: Trial, mounted: str | None, stream: orders.Stream
) -> Deferral:
    """Return after which trial of its block `trial` comes again.

    Each place is equally likely where it needs no further beam swap and breaks no rule of the
    design that the order has kept so far. Without such a place, and before the first block, the
    trial comes at once, as does one of a track, whose level is then still the same. `order` has the
    trials as they are run, `trial` among them; `mounted` is the beam on the rig.
    """
    if trial.track is not None:
        return trial.index, trial.index
    here = _place(order, trial.index)
    later = [entry for entry in order[here + 1 :] if trial.block == entry.block > 0]

    def costs(after: int) -> tuple[int, int, int]:
        """Return beam swaps from now on, those of the whole order, and the rules that it breaks."""
        moved = running_order(order, [(trial.index, after)])
        own = study.touch.beam
        left, whole = swaps(study, moved[here:], mounted or own), swaps(study, moved, own)
        return left, whole, _broken(study, moved)

    at_once = costs(trial.index)
    fitting = [
        entry.index
        for entry in later
        # Compared with coming at once, which breaks nothing new and is always possible.
        if all(cost <= limit for cost, limit in zip(costs(entry.index), at_once, strict=True))
    ]
    return trial.index, stream.one_of(fitting) if fitting else trial.index


def _broken(study: Study, order: Sequence[Trial]) -> int:
    """Return how often an order breaks the rules on runs of a condition and on catch trials."""
    runs = groupby(trial.condition for trial in order if trial.kind == "trial")
    long_runs = [max(len(list(run)) - study.design.max_alike_in_row, 0) for _, run in runs]
    catches = [place for place, trial in enumerate(order) if trial.kind == "catch"]
    close = [later - place - 1 < study.design.catch_apart for place, later in pairwise(catches)]
    own = study.touch.beam
    needed = [(trial.block, beams_of(trial.touches, own)) for trial in order]
    misplaced = [place == 0 or needed[place] != needed[place - 1] for place in catches]
    return sum(long_runs) + sum(close) + sum(misplaced)


DEFAULT_RATE_HZ = 1_000


def slide_study(study: Study) -> Study:
    """Return the study as a sliding experiment runs it: the block touches, and nobody is asked.

    Forces are always recorded, at `DEFAULT_RATE_HZ` unless the study says otherwise. A study that
    was made so stays as it is.
    """
    rate_hz, slide = study.force_channel.rate_hz or DEFAULT_RATE_HZ, _slide_of(study)
    # There is no participant who could be told to do it again.
    rules = study.as_instructed.model_copy(update={"retries": 0, "feedback": "never"})
    return study.model_copy(
        update={
            "slide": slide,
            "touch": slide.finger(study.touch),
            "force_channel": study.force_channel.model_copy(update={"rate_hz": rate_hz}),
            "as_instructed": rules,
            "session": study.session.model_copy(update={"blind_operator": False}),
            **dict.fromkeys(("question", "page", "opening", "condition"), ()),
        }
    )


def _slide_of(study: Study) -> Slide:
    """Return what is drawn; on a surface of the study's own by default along its own path.

    The paper's fixed frequency means nothing there.
    """
    slide = study.slide
    if study.surface.length_m is None:
        return slide
    usual: dict[str, Any] = {"paths_m": (study.touch.path_m,)}
    if slide.frequencies:
        usual["frequencies_hz"] = ()
    given = slide.model_fields_set
    return slide.model_copy(update={key: usual[key] for key in usual if key not in given})


def slide_plan(study: Study, session: int = 1) -> Plan:
    """Return the passes of a sliding experiment in the order in which they are made.

    Each repeat has every driven pass once, in an order drawn from the study's seed. References
    come in rounds, each with every path, speed and direction: the first round before the first
    driven pass, the last one after the last, the others evenly between them.
    """
    slide, name = study.slide, (study.study.seed, "slide", session)
    volts, nominal_hz = slide.voltage_v, study.rig.nominal_resonance_hz
    drives = [_Drive(f"{each:g} x resonance", volts, each) for each in slide.frequencies]
    drives += [_Drive(f"{hz:g} Hz", volts, hz / nominal_hz, hz) for hz in slide.frequencies_hz]
    driven_once = [trial for drive in drives for trial in _passes(slide, drive)]
    # At a frequency that is driven anyway, so that a reference breaks no limit of its own.
    rest = drives[0]._replace(label="reference, 0 V", voltage_v=0.0)
    driven = [
        replace(trial, block=repeat)
        for repeat in range(1, slide.repeats + 1)
        for trial in orders.Stream(*name, repeat).shuffled(driven_once)
    ]
    gaps = max(slide.references - 1, 1)
    before = [round(number * len(driven) / gaps) for number in range(slide.references)]
    order: list[Trial] = []
    for place in range(len(driven) + 1):
        for number in (number for number, at in enumerate(before) if at == place):
            references = orders.Stream(*name, "reference", number).shuffled(_passes(slide, rest))
            block = driven[min(place, len(driven) - 1)].block
            order += [replace(trial, block=block) for trial in references]
        order += driven[place : place + 1]
    return Plan(
        slot=0,
        session=session,
        sequence=(),
        trials=tuple(replace(trial, index=index) for index, trial in enumerate(order)),
    )


class _Drive(NamedTuple):
    """The drive of a pass."""

    label: str
    voltage_v: float
    frequency: float
    frequency_hz: float | None = None


def _passes(slide: Slide, drive: _Drive) -> Iterator[Trial]:
    """Yield the passes of one drive, each named by what tells it from the others."""
    for path_m, speed_m_s, direction in product(slide.paths_m, slide.speeds_m_s, slide.directions):
        left_mm, right_mm = (1e3 * end_m for end_m in path_m)
        said = {
            f"to the {direction}": len(slide.directions),
            f"{1e3 * speed_m_s:g} mm/s": len(slide.speeds_m_s),
            f"{left_mm:g} to {right_mm:g} mm": len(slide.paths_m),
        }
        made = SlidePass(
            place="path",
            voltage_v=drive.voltage_v,
            frequency_hz=drive.frequency_hz,
            direction=direction,
            path_m=path_m,
            duration_s=round((path_m[1] - path_m[0]) / speed_m_s, 9),
        )
        named = ", ".join([drive.label, *(text for text, many in said.items() if many > 1)])
        touches = (made.model_copy(update={"frequency": drive.frequency}),)
        yield Trial(block=1, kind="pass", condition=named, touches=touches)
