"""The watch over the device: the simulator itself says what is at the output, at every step."""

import json
from dataclasses import dataclass, field
from typing import Any

from device.drivers.board import MONITOR_ABS_TOL_V
from device.resonance import SWEEP_VOLTAGE_V
from device.simulator.in_process import InProcessDevice
from protocol.journal.records import PlannedTrial
from protocol.study.rig_settings import Rig
from protocol.study.touch import Touch
from tests.system.day.invariants import require
from tests.system.day.people import said_of_output

STAYS_ON = {"relay-stuck", "stage-shorted", "panel-on", "off-ignored"}
"""Faults in which the device gives a voltage that nobody asked for."""
EXCEEDS = {"peak-to-peak", "scale-wrong", "frequency-changed"}
"""Faults in which it gives more than it was asked for."""
CUT_OFF = {"vanish", "dead-peer", "deaf"}
"""Faults in which the host does not reach the device: its watchdog must end the output."""
NO_WATCHDOG = {"watchdog-dead", "relay-stuck", "stage-shorted"}
NOTICED_S = 3.0
"""Within this time a session that lives turns off what is wrong, or says that it cannot."""
OFF_V = 2.1 * MONITOR_ABS_TOL_V
"""Off may be said below this; a broken monitor shows half of it."""
_TOLERANCE_V = 1e-6


@dataclass
class Watch:
    """Looks at the output and compares it with what the journal says should be there."""

    device: InProcessDevice
    rig: Rig
    touch: Touch | None = None
    """What is touched now, according to the journal."""
    searching: bool = False
    """Whether the resonance is searched for, likewise."""
    resonance_hz: float = 0.0
    hanging_from_s: float = float("inf")
    told_unknown: bool = False
    faults_s: dict[str, float] = field(default_factory=dict)
    """When each fault was last switched on, as far as it may still have an effect."""
    largest_v: float = 0.0
    _wrong_from_s: float | None = None
    planned: dict[str, dict[int, PlannedTrial]] = field(default_factory=dict)
    """The trials of each session that was opened."""
    polled: bool = False
    """Whether a process lives that has armed the device."""
    _trial: PlannedTrial | None = None

    def fault(self, name: str) -> None:
        """Break the device."""
        self.faults_s[name] = self.device.now_s()
        self.device.fault(name)

    def repair(self) -> None:
        """Switch every fault off; what they have changed in the device stays."""
        self.mended()
        self.faults_s.clear()
        self.told_unknown, self._wrong_from_s = False, None

    def mended(self) -> None:
        """Let the device work again in the middle of a session."""
        self.device.inside.broken.clear()
        self.device.fault("vanish", on=False)

    def stored(self, session: str, tag: str, payload: str) -> None:
        """Take note of an event that is in the journal now."""
        match tag:
            case "session-opened":
                opened = json.loads(payload)
                trials = [PlannedTrial.from_json(trial) for trial in opened["trials"]]
                self.planned[session] = {trial.index: trial for trial in trials}
            case "device-armed":
                self.searching = True
            case "resonance-measured":
                self.searching = False
                self.resonance_hz = json.loads(payload)["frequency_hz"]
            case "trial-started":
                self._trial = self.planned[session][json.loads(payload)["index"]]
            case "touch-started":
                assert self._trial is not None
                touch = self._trial.touches[json.loads(payload)["touch"]]
                self.touch = Touch.model_construct(**{**_NOTHING, **touch})
            case "touch-ended" | "trial-aborted" | "device-off":
                self.touch, self.searching = None, False
        if tag == "device-off" and json.loads(payload)["confirmed"]:
            self._require_off("the journal", self._newer_than_heard())

    def alone(self, *, killed: bool) -> None:
        """Take note that no process drives the device; one that was killed did not turn it off."""
        if not killed:
            self.touch, self.searching = None, False
        self.polled, self.hanging_from_s = False, float("inf")

    def said(self, line: str, *, last: bool = False) -> str:
        """Take note of a line to the operator; return what it says of the output."""
        said = said_of_output(line)
        if said == "off":
            excused = self._newer_than_heard() if last else self._new(NOTICED_S)
            self._require_off(line, excused)
        self.told_unknown |= said == "unknown"
        return said

    def look(self) -> None:
        """Compare what is at the output with what may be there."""
        instrument, now_s = self.device.inside.instrument, self.device.now_s()
        output_v, silent_s = instrument.output_v, now_s - instrument.heard_wall_s
        self.largest_v = max(self.largest_v, output_v)
        if output_v <= _TOLERANCE_V:
            self._wrong_from_s = None
            return
        faults = self.faults_s.keys()
        shown = f"{output_v:g} V at {now_s:.3f} s"
        if not faults & NO_WATCHDOG:
            require(3, silent_s <= self.rig.watchdog_s, f"{shown}, silent for {silent_s:.3f} s")
            hung_s = now_s - self.hanging_from_s
            most_s = 1.3 * self.rig.watchdog_s
            require(3, hung_s <= most_s, f"{shown}, the session hangs for {hung_s:.3f} s")
        allowed_v, allowed_hz = self._allowed()
        hertz = instrument.frequency_hz
        if output_v <= allowed_v + _TOLERANCE_V and hertz <= allowed_hz:
            self._wrong_from_s = None
        elif faults & (STAYS_ON | EXCEEDS):
            self._wrong_for_long(now_s, shown)
        else:
            cut_off = faults & CUT_OFF and output_v <= self.rig.max_voltage_v
            require(
                4, cut_off, f"{shown}, {hertz:g} Hz; {allowed_v:g} V, {allowed_hz:g} Hz allowed"
            )

    def _allowed(self) -> tuple[float, float]:
        """Return the largest amplitude and frequency that may be at the output."""
        if self.touch is not None:
            hertz = self.touch.peak_frequency * self.resonance_hz * (1 + 1e-6)
            return self.touch.peak_voltage_v, min(hertz, self.rig.max_frequency_hz)
        if self.searching:
            return min(SWEEP_VOLTAGE_V, self.rig.max_voltage_v), self.rig.max_frequency_hz
        return 0.0, 0.0

    def _wrong_for_long(self, now_s: float, shown: str) -> None:
        """A device that gives what nobody asked for is noticed soon, while somebody polls it."""
        if self._wrong_from_s is None:
            self._wrong_from_s = now_s
        wrong_s = now_s - self._wrong_from_s
        noticed = wrong_s <= NOTICED_S or self.told_unknown or not self.polled
        require(4, noticed, f"{shown}, wrong for {wrong_s:.1f} s")

    def _newer_than_heard(self) -> bool:
        """Whether a fault came after the device was last heard."""
        heard_s = self.device.inside.instrument.heard_wall_s
        return any(at_s >= heard_s for at_s in self.faults_s.values())

    def _new(self, within_s: float) -> bool:
        return any(self.device.now_s() - at_s <= within_s for at_s in self.faults_s.values())

    def _require_off(self, who: str, excused: bool) -> None:
        output_v = self.device.inside.instrument.output_v
        require(5, output_v < OFF_V or excused, f"{output_v:g} V at the output, but: {who}")


_NOTHING: dict[str, Any] = {
    name: field.default for name, field in Touch.model_fields.items() if not field.is_required()
}
