"""The faults that a device can have, as a table; each can be switched on and off at any time.

Numbers are those of the documented wire protocol; missing ones are the host's. What a fault
does to the wire stands in `server`, what it does to the device in `Broken`.
"""

from collections.abc import Callable
from dataclasses import dataclass

from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.power_stage import MAX_VOLTAGE_V, Instrument
from device.simulator.models.dialect import Dialect, Happenings
from device.simulator.models.gauge_model import GaugeModel
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
    Fault(number=34, name="block-garbled", what="bytes of every block of samples are changed"),
    Fault(number=34, name="block-garbled-once", what="bytes of the next block are changed"),
    Fault(number=34, name="block-truncated-once", what="the next block of samples stops half way"),
    Fault(number=34, name="block-lost-once", what="the next block of samples is not sent"),
    Fault(number=34, name="block-doubled-once", what="the next block of samples comes twice"),
    Fault(number=34, name="block-stale", what="every block of samples is the first one again"),
    Fault(number=35, name="samples-lost", what="samples that were not fetched yet are forgotten"),
    Fault(number=35, name="sensor-saturated", what="the tangential force is at the sensor's limit"),
    Fault(number=35, name="sensor-drifts", what="the zero of the forces drifts a hundredfold"),
    Fault(number=36, name="gauge-vanish", what="the gauge's port vanishes; off brings it back"),
    Fault(number=36, name="gauge-silent", what="the gauge obeys and answers nothing"),
    Fault(number=36, name="gauge-garbled-once", what="digits of its next samples are changed"),
    Fault(number=36, name="gauge-wrong-unit", what="the gauge measures in gf"),
)
NAMES = tuple(fault.name for fault in FAULTS)

ERROR = ScpiError(-310, "System error")


@dataclass
class Broken:
    """The device with the faults that are on."""

    instrument: Instrument
    beam: SimulatedBeam
    dialect: Dialect
    gauge: GaugeModel
    wall_s: Callable[[], float]

    def __post_init__(self) -> None:
        instrument, dialect = self.instrument, self.dialect
        self.active: set[str] = set()
        self._settings: dict[str, tuple[object, str, object]] = {
            "read-back-differs": (instrument, "set_gain", 0.9),
            "endless-errors": (dialect.status, "always", (ERROR.code, ERROR.text)),
            "over-temperature": (instrument, "hot", True),
            "gauge-wrong-unit": (self.gauge, "unit", "gf"),
            "sensor-saturated": (self.beam, "is_saturated", True),
            "sensor-drifts": (self.beam, "drift_factor", 100.0),
            "monitor-wrong": (self.beam, "monitor_gain", 0.5),
            "scale-wrong": (instrument, "scale", 2.0),
            "watchdog-dead": (instrument, "watchdog_dead", True),
            "wrong-idn": (dialect, "idn", "ACME,Toaster 3000,0,1.0"),
            "off-ignored": (instrument, "off_ignored", True),
            "relay-stuck": (instrument, "relay_stuck", True),
            "stage-shorted": (instrument, "left_v", 150.0),
            "peak-to-peak": (instrument, "stage_gain", 2.0),
        }
        """What has another value while a fault is on: whose, which one, and the value."""
        self._sound = {
            name: getattr(owner, setting) for name, (owner, setting, _) in self._settings.items()
        }
        self._happenings: tuple[Happenings, ...] = (
            {
                "brown-out": dialect.restart,
                "error-queued": lambda: dialect.status.complain(ERROR),
                "over-temperature": lambda: instrument.trip("TEMP", self.wall_s()),
                "watchdog-trip": lambda: instrument.trip("WATC", self.wall_s()),
                "limits-lost": lambda: setattr(instrument, "limit_v", MAX_VOLTAGE_V),
                "samples-lost": self.gauge.sampler.lose,
                "frequency-changed": lambda: vars(instrument).update(sweep=None, frequency_hz=99e3),
                "panel-on": self._press_output,
            },
            dialect.happenings(),
        )
        """What happens once, when a fault is switched on."""

    def switch(self, name: str, *, on: bool) -> None:
        """Switch a fault on or off; raise `ValueError` if there is none of that name."""
        if name not in NAMES:
            raise ValueError(f"a fault must be one of {', '.join(NAMES)}, got {name!r}")
        (self.active.add if on else self.active.discard)(name)
        if name in self._settings:
            owner, setting, faulty = self._settings[name]
            setattr(owner, setting, faulty if on else self._sound[name])
        for happenings in self._happenings:
            if name in happenings and on:
                happenings[name]()
        if name == "relay-stuck":
            self.instrument.left_v = 0.0  # it holds what is on when the output is switched off

    def clear(self) -> None:
        for name in sorted(self.active):
            self.switch(name, on=False)

    def _press_output(self) -> None:
        self.instrument.cause = "NONE"
        self.instrument.switch(on=True)
