"""The columns about the touches of a trial: as planned, as commanded, as read back, as judged."""

from collections.abc import Callable
from typing import Any

from analysis.cells import Cell
from analysis.export.dataset import YES_NO, Column
from analysis.loading.records import TouchRecord, TrialRecord


def _each(value: Callable[[TouchRecord], Any]) -> Callable[[TrialRecord], Cell]:
    return lambda trial: tuple(value(touch) for touch in trial.touches)


def _asked(key: str, instead: str = "") -> Callable[[TrialRecord], Cell]:
    """What the plan asks of each touch; the key `instead` stands in where there is no `key`."""
    return _each(lambda touch: touch.planned.get(key, touch.planned.get(instead)))


def _read(key: str, which: int) -> Callable[[TrialRecord], Cell]:
    return _each(lambda touch: touch.read_back[which].get(key) if touch.read_back else None)


def _judged(key: str) -> Callable[[TrialRecord], Cell]:
    return _each(lambda touch: touch.judged.get(key))


def _touch(name: str, description: str, of: Callable[[TrialRecord], Cell], **more: Any) -> Column:
    return Column(name=name, description=description, of=of, per_touch=True, **more)


TOUCH_COLUMNS = (
    Column(
        name="touches",
        description="How many touches the attempt had.",
        of=lambda trial: None if trial.attempts is None else len(trial.touches),
    ),
    _touch("beam", "The beam that was mounted.", _each(lambda touch: touch.beam)),
    _touch(
        "place",
        "Where the beam was to be touched.",
        _asked("place"),
        levels={"smooth": "one place", "path": "sliding along the beam"},
    ),
    _touch(
        "direction",
        "Direction of a sliding finger.",
        _asked("direction"),
        levels={"right": "left to right", "left": "right to left"},
    ),
    _touch(
        "coverage",
        "How much of the beam was to be covered.",
        _asked("coverage"),
        levels={"local": "one finger", "full": "several fingers"},
    ),
    _touch("press", "Touch force asked for, relative to the study's.", _asked("press")),
    _touch(
        "planned_voltage_v", "Planned amplitude (peak) at the start.", _asked("voltage_v"), unit="V"
    ),
    _touch(
        "planned_end_voltage_v",
        "Planned amplitude (peak) at the end.",
        _asked("ramp_to_v", "voltage_v"),
        unit="V",
    ),
    _touch(
        "planned_frequency",
        "Planned drive at the start, relative to the resonance.",
        _asked("frequency"),
    ),
    _touch(
        "planned_end_frequency",
        "Planned drive at the end, relative to the resonance.",
        _asked("sweep_to", "frequency"),
    ),
    _touch(
        "commanded_voltage_v",
        "Amplitude (peak) commanded at the start.",
        _each(lambda touch: touch.commanded["voltage_v"]),
        unit="V",
    ),
    _touch(
        "commanded_frequency_hz",
        "Frequency commanded at the start.",
        _each(lambda touch: touch.commanded["frequency_hz"]),
        unit="Hz",
    ),
    _touch(
        "start_voltage_v",
        "Amplitude (peak) read back at the start.",
        _read("voltage_v", 0),
        unit="V",
    ),
    _touch(
        "end_voltage_v", "Amplitude (peak) read back at the end.", _read("voltage_v", -1), unit="V"
    ),
    _touch(
        "start_frequency_hz",
        "Frequency read back at the start.",
        _read("frequency_hz", 0),
        unit="Hz",
    ),
    _touch(
        "end_frequency_hz", "Frequency read back at the end.", _read("frequency_hz", -1), unit="Hz"
    ),
    _touch(
        "start_monitor_v",
        "The device's monitor of its output at the start.",
        _read("monitor_v", 0),
        unit="V",
    ),
    _touch(
        "end_monitor_v",
        "The device's monitor of its output at the end.",
        _read("monitor_v", -1),
        unit="V",
    ),
    _touch("force_n", "Median force of the finger.", _judged("force_n"), unit="N"),
    _touch(
        "force_ok", "Whether the force was the one asked for.", _judged("force_ok"), levels=YES_NO
    ),
    _touch(
        "place_ok",
        "Whether the finger was, or moved, where it should.",
        _judged("place_ok"),
        levels=YES_NO,
    ),
)
