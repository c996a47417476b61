"""The watch over the device: the simulator itself says what is at the output, at every step."""

import json
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from device.drivers.board import MONITOR_ABS_TOL_V
from device.resonance import SWEEP_VOLTAGE_V
from device.rig import RAMP_STEP_S
from device.simulator.in_process import InProcessDevice
from device.simulator.models.generator_model import (
    AMPLIFIER_GAIN,
    DEFAULT_LIMIT_V,
    OPEN_OHM,
    GeneratorDialect,
)
from protocol.journal.records import PlannedTrial
from protocol.study.rig_settings import Rig
from protocol.study.study import Study
from protocol.study.touch import Touch, touch_s
from tests.system.day.invariants import require
from tests.system.day.people import said_of_output

HOT = "hot"
"""A fault that only a host notices which asks for the temperature: protection does not trip."""
SLACK = "slack"
"""A fault in which somebody gives the watchdog more time; a host must look before it drives."""
SLACK_S = 9.0
LEAK = "leak"
"""A fault in which a few volts come out beside what is driven."""
STAYS_ON = {LEAK, "relay-stuck", "stage-shorted", "panel-on", "off-ignored"}
"""Faults in which the device gives a voltage that nobody asked for."""
PANEL = {"panel-changed", "modulated", "signal-added"}
"""Faults in which a generator gives something else; a board has no such panel."""
EXCEEDS = {HOT, "read-back-differs", "peak-to-peak", "scale-wrong", "frequency-changed", *PANEL}
"""Faults in which it gives something else than it was asked for, or may."""
FORGETS = {SLACK, "limits-lost", "panel-changed", "panel-on", "brown-out"}
"""Faults in which it forgets its limit or its watchdog, or goes on by itself."""
TELLS = {
    HOT: "must not be hotter than|too hot",
    SLACK: "SYST:WATC was set to|watchdog did not trip",
    # In the middle of an exchange, a restart is first seen as an answer that does not fit.
    # It also lacks what was set before: the watchdog, without which a board does not go on.
    "brown-out": "the device restarted|the device must answer|reads back as|no watchdog|"
    "watchdog did not trip",
    "endless-errors": "error queue does not end",
    "error-after-set": "was refused by the device: -310 System error",
    "monitor-wrong": "the monitor must show",
    "off-ignored": "says that its output is on",
    "over-temperature": "over-temperature|hotter than|too hot|protection tripped",
    # While a session drives 0 V its output is on, and only the amplitude is somebody else's.
    "panel-on": r"nobody here switched it on|the amplitude must not exceed 0\.0 V",
    "stage-shorted": "its monitor still shows",
    "watchdog-trip": "its watchdog tripped: it says that it heard nothing|protection tripped;",
}
"""What the operator is told of a fault of a board that stands alone."""
CUT_OFF = {"vanish", "dead-peer", "deaf"}
"""Faults in which the host does not reach the device: its watchdog must end the output."""
_UNGUARDED = {*CUT_OFF, "brown-out"}
"""Faults in which a generator gives something else: it has no watchdog that a restart forgets, so
that it takes the rest of a drive in whose middle it restarted."""
DEAD_WATCHDOG = {SLACK, "watchdog-dead"}
"""Faults in which nothing ends what a process has switched on that is killed."""
NO_WATCHDOG = {*DEAD_WATCHDOG, "relay-stuck", "stage-shorted"}
NOTICED_S = 0.45
"""Within this time, and that of a poll, a session that lives turns off what is wrong."""
TOLD_S = 3.0
"""Within this time it says that it cannot: it asks several times, and waits for a discharge."""
OFF_V = 2.1 * MONITOR_ABS_TOL_V
"""Off may be said below this; a broken monitor shows half of it."""
_TOLERANCE_V = 1e-6
_EXCHANGES = 60
"""With a generator, each setting is a line of its own: those of a poll, and of a step of a ramp."""


@dataclass
class Watch:
    """Looks at the output and compares it with what the journal says should be there."""

    device: InProcessDevice
    study: Study
    touch: Touch | None = None
    """What is touched now, according to the journal."""
    searching: bool = False
    """Whether the resonance is searched for, likewise."""
    resonance_hz: float = 0.0
    hanging_from_s: float = float("inf")
    has_guardian: bool = False
    """Whether a generator has one: not on every system."""
    stood_still: bool = False
    """Whether the process stood still while the present touch was driven."""
    _driven_s: tuple[float, float] | None = None
    """When the present touch was at the output, from and to."""
    told_unknown: bool = False
    faults_s: dict[str, float] = field(default_factory=dict)
    """When each fault was last switched on, as far as it may still have an effect."""
    thermometer: bool = True
    """Whether a board measures its temperature."""
    late_s: float = 0.0
    """The longest delay of the line."""
    _on: bool = False
    _shown: str = ""
    """What the operator was last shown of the output."""
    _wrong_from_s: float | None = None
    planned: dict[str, dict[int, PlannedTrial]] = field(default_factory=dict)
    """The trials of each session that was opened."""
    left_out: set[tuple[str, int]] = field(default_factory=set)
    """Those that the stop of a track made needless."""
    polled: bool = False
    """Whether a process lives that has armed the device."""
    armed: bool = False
    """Whether the last process has armed it, and has not completed its session."""
    _began_s: float = 0.0
    _trial: PlannedTrial | None = None
    _target_v: float = 0.0
    _set_s: float = 0.0
    """When the amplitude began to move to `_target_v`, in the device's time."""

    @cached_property
    def is_board(self) -> bool:
        """Whether the device has a watchdog, a monitor and sensors; a generator has none."""
        return self.rig.dialect == "board"

    @cached_property
    def rig(self) -> Rig:
        """The rig of the study."""
        return self.study.rig

    def fault(self, name: str) -> None:
        """Break the device."""
        self.faults_s[name] = self.device.now_s()
        if name == HOT:
            self.device.inside.instrument.hot = True
        elif name == SLACK:
            self.device.inside.instrument.watchdog_s = SLACK_S
        elif name != LEAK:
            self.device.fault(name)

    def repair(self) -> None:
        """Switch every fault off; what they have changed in the device stays."""
        self.mended()
        self.faults_s.clear()
        self.touch, self.searching = None, False
        self.told_unknown, self._wrong_from_s = False, None

    def mended(self) -> None:
        """Let the device work again in the middle of a session."""
        self.device.inside.instrument.hot = False
        self.device.inside.broken.clear()
        self.device.fault("vanish", on=False)

    def begin(self) -> None:
        """Take note that a process begins or resumes a session."""
        self.polled, self._began_s = True, self.device.now_s()

    def stored(self, session: str, tag: str, payload: str) -> None:  # noqa: C901, PLR0912 - a table
        """Take note of an event that is in the journal now."""
        match tag:
            case "session-opened":
                opened = json.loads(payload)
                trials = [PlannedTrial.from_json(trial) for trial in opened["trials"]]
                self.planned[session] = {trial.index: trial for trial in trials}
            case "device-armed":
                self.touch, self.searching = None, self.is_board
            case "resonance-measured":
                self.searching = False
                self.resonance_hz = json.loads(payload)["frequency_hz"]
            case "trial-started":
                self._trial = self.planned[session][json.loads(payload)["index"]]
            case "touch-started":
                self.stood_still, self._driven_s = False, None
                assert self._trial is not None
                started = json.loads(payload)
                touch = self._trial.touches[started["touch"]]
                if track := self._trial.track:
                    compared = track.role != "catch" and started["touch"] + 1 == track.interval
                    volts, levels = started["commanded"]["voltage_v"], self.study.track[0].values
                    known = levels if compared else (touch["voltage_v"],)
                    require(9, volts in known, f"{volts} V in a touch of a track, not of {known}")
                    touch = {**touch, "voltage_v": volts}
                if hertz := touch.get("frequency_hz"):  # it follows no resonance
                    touch = {**touch, "frequency": hertz / self.resonance_hz}
                self.touch = Touch.model_construct(**{**_NOTHING, **touch})
                self._require_mounted(self.touch.beam or self.study.touch.beam)
            case "touch-ended":
                assert self.touch is not None
                require(9, not self.stood_still, "a touch counts that stood still")
                self._require_length(self.touch)
                if not self.faults_s:
                    self._as_planned(self.touch, json.loads(payload)["read_back"])
                self.touch = None
            case "trials-not-needed":
                self.left_out |= {(session, index) for index in json.loads(payload)["indices"]}
            case "trial-aborted" | "device-off":
                self.touch, self.searching = None, False
        if tag in {"device-armed", "session-completed"}:
            self.armed = tag == "device-armed"
        if tag == "device-off" and json.loads(payload)["confirmed"]:
            self._require_off("the journal", self._newer_than_heard())
            heard_s = self.device.inside.instrument.heard_wall_s
            require(5, heard_s >= self._began_s, "off is confirmed, but nobody asked the device")

    def _require_mounted(self, beam: str | None) -> None:
        """The model of a beam knows only whether it has bodies."""
        if beam is not None:
            bodies = self.study.beams[beam] > 0
            there = self.device.inside.beam.body_height_m > 0
            require(9, bodies == there, f"another beam than {beam} is mounted")

    def _as_planned(self, touch: Touch, read_back: list[dict[str, Any]]) -> None:
        """The drive goes from its beginning to its end, the amplitude evenly once it is set.

        A slow line delays the steps of a sweep.
        """
        seconds = touch_s(touch, self.study.touch)
        ends = touch.end_voltage_v, touch.end_frequency
        wanted = 2 if ends == (touch.voltage_v, touch.frequency) else 3
        require(9, len(read_back) >= wanted, f"{touch} read back {len(read_back)} times")
        if not self.is_board:
            self._between_ends(touch, read_back)
            return
        times_s = [shown["device_time_s"] for shown in read_back]
        change_v = touch.end_voltage_v - touch.voltage_v
        in_time = not change_v or times_s[0] <= self._set_s <= times_s[1]
        require(9, in_time, f"ramp set at {self._set_s:g} s, read back at {times_s} s")
        shares = [min(max((at_s - self._set_s) / seconds, 0.0), 1.0) for at_s in times_s[:-1]]
        for share, shown in zip((*shares, 1.0), read_back, strict=True):
            off_v = abs(shown["monitor_v"] - touch.voltage_v - share * change_v)
            require(9, off_v < 3.0, f"{shown['monitor_v']:g} V at {share:g} of {touch}")
        hertz = [shown["frequency_hz"] for shown in read_back]
        begin_hz, end_hz = (
            share * self.resonance_hz for share in (touch.frequency, touch.end_frequency)
        )
        off_hz = max(abs(hertz[0] - begin_hz), abs(hertz[-1] - end_hz))
        even = hertz == sorted(hertz, reverse=end_hz < begin_hz)
        require(9, even and off_hz < 1e-3, f"{hertz} Hz, planned {begin_hz:g} to {end_hz:g}")

    def _between_ends(self, touch: Touch, read_back: list[dict[str, Any]]) -> None:
        """The drive of a generator, which has no clock, goes from its beginning to its end.

        The program makes its ramps in steps, which are late on a slow line.
        """
        if not touch.peak_voltage_v:
            return  # at 0 V a generator is off, and its frequency is not set
        lag_v = self.rig.ramp_v_per_s * (RAMP_STEP_S + _EXCHANGES * self.late_s)
        places = range(len(read_back))
        for place, shown in zip(places, read_back, strict=True):
            from_share, to_share = float(place == places[-1]), float(place > 0)
            volts, hertz = (
                [begin + share * (end - begin) for share in (from_share, to_share)]
                for begin, end in (
                    (touch.voltage_v, touch.end_voltage_v),
                    (touch.frequency * self.resonance_hz, touch.end_frequency * self.resonance_hz),
                )
            )
            least_v, most_v = min(volts) - lag_v, max(volts) * 1.001
            fits = least_v <= shown["voltage_v"] <= most_v
            require(9, fits, f"{shown['voltage_v']:g} V, planned {volts}")
            fits = min(hertz) * (1 - 1e-6) <= shown["frequency_hz"] <= max(hertz) * (1 + 1e-6)
            require(9, fits, f"{shown['frequency_hz']:g} Hz, planned {hertz}")

    def stands_still(self, seconds: float) -> None:
        """Take note that the process stands still from now on; a short while is allowed."""
        if self.is_board or self.has_guardian:
            self.hanging_from_s = self.device.now_s()
        self.stood_still |= self.is_driven and seconds > self.rig.watchdog_s

    @property
    def is_driven(self) -> bool:
        """Whether a touch is at the output."""
        return self.touch is not None and self.device.inside.instrument.output_v > _TOLERANCE_V

    def _require_length(self, touch: Touch) -> None:
        """A touch that counts was on for as long as was planned."""
        if self._driven_s is None or self.faults_s:
            return
        began_s, ended_s = self._driven_s
        rises_s = touch.voltage_v / self.rig.ramp_v_per_s
        planned_s = max(self.study.touch.lead_in_s, rises_s) + touch_s(touch, self.study.touch)
        over_s = ended_s - began_s - planned_s
        require(
            9, over_s <= 1 + 2 * self._poll_s, f"a touch counts that was {over_s:.1f} s too long"
        )

    def alone(self) -> None:
        """Take note that no process drives the device; one that was killed did not turn it off."""
        self.polled, self.hanging_from_s = False, float("inf")

    def forget(self, *, killed: bool) -> None:
        """Allow no longer what a process drove that has ended.

        A kill and a dead watchdog are two faults, and so are a kill and a generator out of order:
        what was on stays on, and stays allowed, until the device is repaired or armed again.
        """
        left_on = self.device.inside.instrument.output_v > _TOLERANCE_V
        if self.is_board:
            guarded = not self.faults_s.keys() & DEAD_WATCHDOG
        else:
            guarded = self.has_guardian and not self.faults_s
        if guarded or not (killed and left_on):
            self.touch, self.searching = None, False

    def said(self, line: str, *, last: bool = False) -> str:
        """Take note of a line to the operator; return what it says of the output."""
        said = said_of_output(line)
        if said == "off":
            excused = self._newer_than_heard() if last else self._new(TOLD_S)
            self._require_off(line, excused)
        if last and self.polled:
            require(
                11, said in {"off", "was off", "unknown"}, f"nothing is said of the output: {line}"
            )
        if last and said == "unknown" and self.polled:
            require(5, self._shown == said, f"shown at last: output {self._shown}, but: {line}")
        self._shown = "" if last else said or self._shown
        self.told_unknown |= said in {"unknown", "was off"}
        return said

    def look(self) -> None:
        """Compare what is at the output with what may be there."""
        instrument = self.device.inside.instrument
        if not (instrument.output or instrument.left_v):  # as it is most of the time
            self._on, self._wrong_from_s = False, None
            return
        self._require_promises(instrument.output)
        if instrument.target_v != self._target_v:
            self._target_v, self._set_s = instrument.target_v, instrument.time_s
        output_v, hertz = instrument.output_v, instrument.frequency_hz
        if output_v <= _TOLERANCE_V:
            self._wrong_from_s = None
            return
        if self.touch is not None:
            now_s = self.device.now_s()
            self._driven_s = (self._driven_s or (now_s, now_s))[0], now_s
        if self._outlasts():
            require(3, False, f"{self._output()}, silent or hanging for too long")
        allowed_v, allowed_hz = self._allowed()
        least_hz = 0.0 if self.touch is None else self._least_hz(self.touch)
        faults = self.faults_s.keys()
        cool = not (instrument.hot and self.rig.max_temperature_c and self.thermometer)
        if output_v <= allowed_v + _TOLERANCE_V and least_hz <= hertz <= allowed_hz and cool:
            self._wrong_from_s = None
        elif faults & (STAYS_ON | EXCEEDS) or (faults & _UNGUARDED and not self.is_board):
            self._wrong_for_long()
        else:
            cut_off = faults & CUT_OFF and output_v <= self.rig.max_voltage_v
            require(4, cut_off, f"{self._output()}; {allowed_v:g} V, {allowed_hz:g} Hz allowed")

    def _outlasts(self) -> bool:
        """Whether the output is on though the device hears nothing, or the session hangs."""
        now_s, within_s = self.device.now_s(), self.rig.watchdog_s
        silent_s = now_s - self.device.inside.instrument.heard_wall_s
        hung_s = now_s - self.hanging_from_s
        if self.is_board:
            guarded = not self.faults_s.keys() & NO_WATCHDOG
            return guarded and (silent_s > within_s or hung_s > 1.3 * within_s)
        return not self.faults_s and hung_s > 1.3 * within_s + self._poll_s

    def _output(self) -> str:
        instrument = self.device.inside.instrument
        volts, hertz = instrument.output_v, instrument.frequency_hz
        return f"{volts:g} V, {hertz:g} Hz at {self.device.now_s():.3f} s"

    def _require_promises(self, on: bool) -> None:
        """When the output goes on, the device has the limit and the watchdog of the study."""
        if on and not self._on:
            asked_s = self.device.now_s() - 0.1 - self._poll_s
            forgot = any(self.faults_s.get(name, 0.0) > asked_s for name in FORGETS)
            kept, wanted = self._promises()
            holds = forgot or kept == wanted
            require(4, holds, f"on with limit and watchdog {kept}, not {wanted}")
        self._on = on

    def _promises(self) -> tuple[tuple[float | None, ...], tuple[float | None, ...]]:
        """Return what the device keeps of its promises, and what it must keep."""
        inside = self.device.inside
        if not isinstance(inside.dialect, GeneratorDialect):
            kept = inside.instrument.limit_v, inside.instrument.watchdog_s
            return kept, (self.rig.max_voltage_v, self.rig.watchdog_s)
        first = inside.dialect.channels[0]
        most_v = self.rig.max_voltage_v / AMPLIFIER_GAIN if first.limited else DEFAULT_LIMIT_V
        settings = first.load_ohm, first.emf_offset_v, first.limit_low_v, first.limit_high_v
        return settings, (OPEN_OHM, 0.0, -most_v, most_v)

    def drive_set(self) -> tuple[float, ...]:
        """Return what changes once a drive is sent; a generator is polled at any time."""
        instrument = self.device.inside.instrument
        if self.is_board:
            return (instrument.heard_wall_s,)
        return instrument.output, instrument.target_v, instrument.frequency_hz

    @property
    def _poll_s(self) -> float:
        """The longest time that the line takes of the exchanges in which all is asked for."""
        return (20 if self.is_board else _EXCHANGES) * self.late_s

    def _allowed(self) -> tuple[float, float]:
        """Return the largest amplitude and frequency that may be at the output."""
        if self.touch is not None:
            hertz = self.touch.peak_frequency * self.resonance_hz * (1 + 1e-6)
            return self.touch.peak_voltage_v, min(hertz, self.rig.max_frequency_hz)
        if self.searching:
            return min(SWEEP_VOLTAGE_V, self.rig.max_voltage_v), self.rig.max_frequency_hz
        return 0.0, 0.0

    def _least_hz(self, touch: Touch) -> float:
        return min(touch.frequency, touch.end_frequency) * self.resonance_hz * (1 - 1e-6)

    def _wrong_for_long(self) -> None:
        """A device that gives what nobody asked for is noticed soon, once somebody polls it."""
        now_s = self.device.now_s()
        if self._wrong_from_s is None or not self.polled:
            self._wrong_from_s = now_s
        wrong_s = now_s - self._wrong_from_s
        alone = len(self.faults_s) == 1 and self.faults_s.keys() <= EXCEEDS
        longest_s = NOTICED_S + self._poll_s if alone else TOLD_S
        noticed = wrong_s <= longest_s or self.told_unknown or not self.polled
        require(4, noticed, f"{self._output()}, wrong for {wrong_s:.1f} s")

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
