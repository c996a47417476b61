"""The faults that a device can have, as a table; each can be switched on and off at any time.

Numbers are those of docs/wire-protocol.md, "Faults"; missing ones are the host's. What a fault
does to the wire stands in `wire`, what it does to the device in `Broken`.
"""

from collections.abc import Callable
from dataclasses import dataclass

from device.simulator.models.beam_and_finger import SimulatedBeam
from device.simulator.models.dialect import Dialect
from device.simulator.models.power_stage import MAX_VOLTAGE_V, Instrument
from device.simulator.models.scpi import ScpiError


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault's number, its name on the control socket, and what happens."""

    number: int
    name: str
    what: str


FAULTS = (
    Fault(number=1, name="vanish", what="the port vanishes; off brings it back, output off"),
    Fault(number=2, name="dead-peer", what="nothing gets through in either direction"),
    Fault(number=3, name="garbled", what="every answer has bytes that are no ASCII"),
    Fault(number=3, name="garbled-once", what="the next answer has bytes that are no ASCII"),
    Fault(number=4, name="late-reply", what="every answer comes 0.6 s late"),
    Fault(number=4, name="late-reply-once", what="the next answer comes 0.6 s late"),
    Fault(number=5, name="truncated-reply", what="answers stop half way, without a line end"),
    Fault(number=6, name="reply-nan", what="measured and set values answer NAN"),
    Fault(number=6, name="reply-inf", what="measured and set values answer INF"),
    Fault(number=6, name="reply-overflow", what="measured and set values answer 9.91E+37"),
    Fault(number=6, name="reply-underscore", what="measured and set values answer 1_000"),
    Fault(number=6, name="reply-empty", what="measured and set values answer an empty line"),
    Fault(number=7, name="slow-drip", what="answers come a byte every 0.05 s"),
    Fault(number=8, name="flood", what="the device talks without being asked, without end"),
    Fault(number=9, name="echo", what="the device sends back what it is sent"),
    Fault(number=10, name="line-end-cr", what="lines end in CR"),
    Fault(number=10, name="line-end-crlf", what="lines end in CR LF"),
    Fault(number=10, name="line-end-mixed", what="lines end in LF, CR LF and CR by turns"),
    Fault(number=11, name="banner", what="a banner comes before the next answer"),
    Fault(number=12, name="brown-out", what="the device restarts: output off, settings lost"),
    Fault(number=13, name="read-back-differs", what="nine tenths of what is set are kept"),
    Fault(number=14, name="error-queued", what="an error stands in the queue"),
    Fault(number=14, name="error-after-set", what="every command that sets leaves an error"),
    Fault(number=15, name="endless-errors", what="the error queue never ends"),
    Fault(number=16, name="over-temperature", what="protection trips, and does not clear"),
    Fault(number=17, name="monitor-wrong", what="the monitor shows half of the voltage"),
    Fault(number=17, name="scale-wrong", what="twice of what is set comes out, and is reported"),
    Fault(number=18, name="watchdog-trip", what="the watchdog trips"),
    Fault(number=18, name="watchdog-dead", what="the watchdog is acknowledged and never trips"),
    Fault(number=20, name="opc-silent", what="*OPC? is not answered"),
    Fault(number=21, name="wrong-idn", what="*IDN? answers with another device's name"),
    Fault(number=23, name="deaf", what="the device stops reading"),
    Fault(number=24, name="limits-lost", what="limits go back to their defaults"),
    Fault(number=25, name="panel-changed", what="load, unit and offset are changed at the panel"),
    Fault(number=25, name="frequency-changed", what="the frequency is changed at the panel"),
    Fault(number=25, name="modulated", what="frequency modulation is switched on at the panel"),
    Fault(number=25, name="signal-added", what="a second signal is added at the panel"),
    Fault(number=27, name="silent", what="the device obeys and answers nothing"),
    Fault(number=28, name="off-ignored", what="OUTP OFF is ignored"),
    Fault(number=28, name="relay-stuck", what="the voltage stays when the output is switched off"),
    Fault(number=31, name="peak-to-peak", what="twice the amplitude that was set comes out"),
    Fault(number=32, name="panel-on", what="the output is switched on at the panel"),
    Fault(number=32, name="stage-shorted", what="150 V are at the output though it is off"),
)
NAMES = tuple(fault.name for fault in FAULTS)

WRONG_IDN = "ACME,Toaster 3000,0,1.0"
KEPT_OF_SET = 0.9
SHOWN_BY_MONITOR = 0.5
TOO_MUCH = 2.0
SHORTED_V = 150.0
OTHER_HZ = 99_000.0
_ERROR = ScpiError(-310, "System error")


@dataclass
class Broken:
    """The device with the faults that are on."""

    instrument: Instrument
    beam: SimulatedBeam
    dialect: Dialect
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
            "watchdog-dead": self._kill_watchdog,
            "wrong-idn": self._rename,
            "limits-lost": lambda on: self._lose_limits() if on else None,
            "panel-changed": lambda on: self.dialect.turn_knobs() if on else None,
            "modulated": lambda on: self.dialect.modulate() if on else None,
            "signal-added": lambda on: self.dialect.add_signal() if on else None,
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

    def _kill_watchdog(self, on: bool) -> None:
        self.instrument.watchdog_dead = on

    def _misread(self, on: bool) -> None:
        self.beam.monitor_gain = SHOWN_BY_MONITOR if on else 1.0

    def _rename(self, on: bool) -> None:
        self.dialect.idn = WRONG_IDN if on else self._idn

    def _lose_limits(self) -> None:
        self.instrument.limit_v = MAX_VOLTAGE_V
        self.dialect.lose_limits()

    def _turn_frequency(self) -> None:
        self.dialect.turn_frequency(OTHER_HZ)
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
