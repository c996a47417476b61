"""What faults do to the device itself; those of the wire are in `wire`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from device.simulator.beam import SimulatedBeam
from device.simulator.faults import NAMES
from device.simulator.instrument import MAX_VOLTAGE_V, RAMP_RANGE_V_PER_S, Instrument
from device.simulator.keysight import KeysightDialect
from device.simulator.status import Status
from device.simulator.values import ScpiError

WRONG_IDN = "ACME,Toaster 3000,0,1.0"
KEPT_OF_SET = 0.9
SHOWN_BY_MONITOR = 0.5
TOO_MUCH = 2.0
SHORTED_V = 150.0
OTHER_HZ = 99_000.0
_ERROR = ScpiError(-310, "System error")


class AnyDialect(Protocol):
    """What a dialect looks like from behind."""

    idn: str
    banner: str
    status: Status

    def answer(self, line: str) -> str | None:
        """Return the answer to a line."""
        ...

    def restart(self) -> None:
        """Lose power and come back."""
        ...


@dataclass
class Broken:
    """The device with the faults that are on."""

    instrument: Instrument
    beam: SimulatedBeam
    dialect: AnyDialect
    wall_s: Callable[[], float]

    def __post_init__(self) -> None:
        self.active: set[str] = set()
        self._idn = self.dialect.idn

    def switch(self, name: str, *, on: bool) -> None:
        """Switch a fault on or off.

        Raises:
            ValueError: there is none of that name.
        """
        if name not in NAMES:
            raise ValueError(f"a fault must be one of {', '.join(NAMES)}, got {name!r}")
        (self.active.add if on else self.active.discard)(name)
        change = self._changes().get(name)
        if change is not None:
            change(on)

    def clear(self) -> None:
        """Switch every fault off."""
        for name in sorted(self.active):
            self.switch(name, on=False)

    def _changes(self) -> dict[str, Callable[[bool], None]]:
        return {
            "brown-out": lambda on: self.dialect.restart() if on else None,
            "read-back-differs": self._keep_less,
            "error-queued": lambda on: self.dialect.status.complain(_ERROR) if on else None,
            "endless-errors": self._complain_for_ever,
            "over-temperature": self._heat,
            "monitor-wrong": self._misread,
            "scale-wrong": self._scale,
            "watchdog-trip": lambda on: self._trip("WATC") if on else None,
            "wrong-idn": self._rename,
            "limits-lost": lambda on: self._lose_limits() if on else None,
            "panel-changed": lambda on: self._turn_knobs() if on else None,
            "frequency-changed": lambda on: self._turn_frequency() if on else None,
            "off-ignored": self._ignore_off,
            "relay-stuck": self._stick,
            "stage-shorted": self._short,
            "peak-to-peak": self._double,
            "panel-on": lambda on: self._press_output() if on else None,
        }

    def _keep_less(self, on: bool) -> None:
        self.instrument.set_gain = KEPT_OF_SET if on else 1.0

    def _complain_for_ever(self, on: bool) -> None:
        self.dialect.status.always = (_ERROR.code, _ERROR.text) if on else None

    def _heat(self, on: bool) -> None:
        self.instrument.hot = on
        if on:
            self._trip("TEMP")

    def _trip(self, cause: str) -> None:
        self.instrument.trip(cause, self.wall_s())

    def _misread(self, on: bool) -> None:
        self.beam.monitor_gain = SHOWN_BY_MONITOR if on else 1.0

    def _rename(self, on: bool) -> None:
        self.dialect.idn = WRONG_IDN if on else self._idn

    def _lose_limits(self) -> None:
        self.instrument.limit_v = MAX_VOLTAGE_V
        if isinstance(self.dialect, KeysightDialect):
            self.dialect.channels[0].limited = False

    def _turn_knobs(self) -> None:
        """The board has no panel: its limit and its ramp change as if it had one."""
        if isinstance(self.dialect, KeysightDialect):
            first = self.dialect.channels[0]
            first.load_ohm, first.unit, first.emf_offset_v = 50.0, "VRMS", 1.0
        else:
            self._lose_limits()
            self.instrument.ramp_v_per_s = RAMP_RANGE_V_PER_S[1]

    def _turn_frequency(self) -> None:
        if isinstance(self.dialect, KeysightDialect):
            self.dialect.channels[0].frequency_hz = OTHER_HZ
        self.instrument.sweep, self.instrument.frequency_hz = None, OTHER_HZ

    def _ignore_off(self, on: bool) -> None:
        self.instrument.off_ignored = on

    def _stick(self, on: bool) -> None:
        self.instrument.relay_stuck, self.instrument.left_v = on, 0.0

    def _short(self, on: bool) -> None:
        self.instrument.left_v = SHORTED_V if on else 0.0

    def _double(self, on: bool) -> None:
        self.instrument.stage_gain = TOO_MUCH if on else 1.0

    def _scale(self, on: bool) -> None:
        self.instrument.scale = TOO_MUCH if on else 1.0

    def _press_output(self) -> None:
        self.instrument.cause = "NONE"
        self.instrument.switch(on=True)
