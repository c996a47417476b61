"""What a study may not ask of its rig, whatever the schema lets through."""

from collections.abc import Iterator
from dataclasses import dataclass

from protocol.study import Item, Study, Touch


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Something wrong with a study: where it stands, the broken rule, the value, what to do."""

    where: str
    rule: str
    value: str
    hint: str = ""

    def __str__(self) -> str:
        """One line for a person."""
        line = f"{self.where}: {self.rule}, got {self.value}"
        return f"{line}; {self.hint}" if self.hint else line


def problems(study: Study) -> list[Problem]:
    """Return everything in `study` that breaks a limit or names something that is not there."""
    found = [*_duplicates(study), *_missing_beam(study, "touch.beam", study.touch.beam)]
    for where, item in _items(study):
        for number, touch in enumerate(item.touches, start=1):
            found += _touch_problems(study, f"{where}, touch {number}", touch)
    return found


def _items(study: Study) -> Iterator[tuple[str, Item]]:
    yield from ((f"opening {opening.kind}", opening) for opening in study.opening)
    yield from ((f"condition {condition.name}", condition) for condition in study.condition)


def _duplicates(study: Study) -> Iterator[Problem]:
    for name in sorted({name for name in study.conditions if study.conditions.count(name) > 1}):
        yield Problem(
            where="condition", rule="names must differ", value=repr(name), hint="rename one"
        )


def _touch_problems(study: Study, where: str, touch: Touch) -> Iterator[Problem]:
    rig = study.rig
    if touch.peak_voltage_v > rig.max_voltage_v:
        yield Problem(
            where=where,
            rule=f"the amplitude must not exceed rig.max_voltage_v = {rig.max_voltage_v:g} V",
            value=f"{touch.peak_voltage_v:g} V",
            hint="amplitudes are peak, not peak-to-peak",
        )
    frequency_hz = touch.frequency * rig.nominal_resonance_hz
    if frequency_hz > rig.max_frequency_hz:
        yield Problem(
            where=where,
            rule=f"the drive must not exceed rig.max_frequency_hz = {rig.max_frequency_hz:g} Hz",
            value=f"{frequency_hz:g} Hz",
            hint="frequency is relative to the resonance: 1.0 drives the beam there",
        )
    yield from _missing_beam(study, where, touch.beam)


def _missing_beam(study: Study, where: str, beam: str | None) -> Iterator[Problem]:
    if beam is not None and beam not in study.beams:
        yield Problem(
            where=where,
            rule="the beam must be one of [beams]",
            value=repr(beam),
            hint=f"known: {', '.join(study.beams) or 'none'}",
        )
