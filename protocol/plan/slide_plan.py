"""The plan of a sliding experiment: its passes in random order, references spread among them."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import NamedTuple

from protocol.journal.events import SLIDE
from protocol.plan.randomisation import Stream
from protocol.plan.trials import Plan, Trial
from protocol.study.slide import Slide, SlidePass
from protocol.study.study import Study

DEFAULT_RATE_HZ = 1_000


def slide_study(study: Study) -> Study:
    """Return the study as a sliding experiment runs it: the block touches, and nobody is asked.

    Forces are always recorded, at `DEFAULT_RATE_HZ` unless the study says otherwise. A study that
    was made so stays as it is.
    """
    rate_hz = study.force_channel.rate_hz or DEFAULT_RATE_HZ
    rules = study.as_instructed.model_copy(update={"retries": 0, "feedback": "never"})
    return study.model_copy(
        update={
            "slide": study.slide,
            "touch": study.slide.finger(study.touch),
            "force_channel": study.force_channel.model_copy(update={"rate_hz": rate_hz}),
            "as_instructed": rules,
            "session": study.session.model_copy(update={"blind_operator": False}),
            "question": (),
            "page": (),
            "opening": (),
            "condition": (),
        }
    )


def slide_plan(study: Study, session: int = 1) -> Plan:
    """Return the passes of a sliding experiment in the order in which they are made.

    Each repeat has every driven pass once, in an order drawn from the study's seed. References
    come in rounds, each with every path, speed and direction: the first round before the first
    driven pass, the last one after the last, the others evenly between them.
    """
    slide, name = study.slide, (study.study.seed, SLIDE, session)
    drives = _drives(slide, study.rig.nominal_resonance_hz)
    driven_once = [trial for drive in drives for trial in _passes(slide, drive)]
    # At a frequency that is driven anyway, so that a reference breaks no limit of its own.
    rest = drives[0]._replace(label="reference, 0 V", voltage_v=0.0)
    driven = [
        replace(trial, block=repeat)
        for repeat in range(1, slide.repeats + 1)
        for trial in Stream(*name, repeat).shuffled(driven_once)
    ]
    gaps = max(slide.references - 1, 1)
    before = [round(number * len(driven) / gaps) for number in range(slide.references)]
    order: list[Trial] = []
    for place in range(len(driven) + 1):
        for number in (number for number, at in enumerate(before) if at == place):
            references = Stream(*name, "reference", number).shuffled(_passes(slide, rest))
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


def _drives(slide: Slide, nominal_hz: float) -> list[_Drive]:
    volts = slide.voltage_v
    relative = [_Drive(f"{each:g} x resonance", volts, each) for each in slide.frequencies]
    fixed = [_Drive(f"{hz:g} Hz", volts, hz / nominal_hz, hz) for hz in slide.frequencies_hz]
    return relative + fixed


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
        yield Trial(
            index=0,
            block=1,
            kind="pass",
            condition=", ".join([drive.label, *(text for text, many in said.items() if many > 1)]),
            question=None,
            expected=None,
            scored=False,
            touches=(made.model_copy(update={"frequency": drive.frequency}),),
        )
