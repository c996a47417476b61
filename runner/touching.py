"""One touch: the right beam, the instruction, the drive, the finger's way, and off again."""

from dataclasses import asdict, dataclass, field

from device.records import Setpoint
from protocol.study import Touch
from protocol.texts import touch_text
from runner.ports import Clock, Device, Operator, Participant
from runner.screens import Instruction, Notice, Pacing
from runner.session import Session
from runner.session_log import SessionLog
from runner.waiting import awaited, pass_time, response


@dataclass
class Touching:
    """Prepares the rig and carries out touches, each written down before and after."""

    session: Session
    device: Device
    participant: Participant
    operator: Operator
    clock: Clock
    log: SessionLog
    resonance_hz: float = field(default=0.0, init=False)

    def prepare(self) -> None:
        """Arm the device and find the beam's resonance, before anybody touches it."""
        self.log.append("device-armed", **asdict(self.device.arm()))
        self._mount(self.session.study.touch.beam)
        rig = self.session.study.rig
        found = self.device.resonance(rig.nominal_resonance_hz, self.clock.sleep)
        self.log.append("resonance-measured", **asdict(found))
        self.resonance_hz = found.frequency_hz

    def touch(self, number: int, touch: Touch) -> None:
        """Carry out one touch of a trial; the output is off before and after it."""
        self._mount(touch.beam or self.session.study.touch.beam)
        self.participant.show(Instruction(text=touch_text(touch)))
        response(self.participant, self.device, self.clock)
        start = self._setpoint(touch, touch.voltage_v, self.session.study.rig.ramp_v_per_s)
        self.log.append("touch-started", touch=number, commanded=asdict(start))
        read_back = self._stimulus(touch, start)
        self.device.off()
        self.participant.show(Notice(text="touch.end"))
        self.log.append("touch-ended", touch=number, read_back=read_back)

    def _stimulus(self, touch: Touch, start: Setpoint) -> list[dict[str, object]]:
        """Drive the beam while it is touched; return what the device said at start and end."""
        self.device.drive(start)
        pass_time(start.voltage_v / start.ramp_v_per_s, self.participant, self.device, self.clock)
        pacing = self._pacing(touch)
        self.participant.show(pacing)
        at_start = self.device.read_back()
        if touch.end_voltage_v != touch.voltage_v:
            change_v = abs(touch.end_voltage_v - touch.voltage_v)
            ramp_v_per_s = change_v / pacing.duration_s
            self.device.drive(self._setpoint(touch, touch.end_voltage_v, ramp_v_per_s))
        pass_time(pacing.duration_s, self.participant, self.device, self.clock)
        return [asdict(at_start), asdict(self.device.read_back())]

    def _setpoint(self, touch: Touch, voltage_v: float, ramp_v_per_s: float) -> Setpoint:
        return Setpoint(
            voltage_v=voltage_v,
            frequency_hz=touch.frequency * self.resonance_hz,
            ramp_v_per_s=ramp_v_per_s,
        )

    def _pacing(self, touch: Touch) -> Pacing:
        defaults = self.session.study.touch
        force_n = defaults.force_n * touch.press
        if touch.place == "smooth":
            place_m = defaults.smooth_place_m
            start_m, end_m, duration_s = place_m, place_m, defaults.hold_s
        else:
            left_m, right_m = defaults.path_m
            start_m, end_m = (left_m, right_m) if touch.direction == "right" else (right_m, left_m)
            duration_s = (right_m - left_m) / defaults.sliding_speed_m_s
        return Pacing(
            start_m=start_m,
            end_m=end_m,
            duration_s=touch.duration_s or duration_s,
            force_n=force_n,
            direction=touch.direction,
        )

    def _mount(self, beam: str | None) -> None:
        """Have the operator swap beams, with the output off, unless it is there already."""
        if beam is None or beam == self.log.state.beam:
            return
        self.operator.mount(beam)
        awaited(lambda: self.operator.mounted() or None, self.device, self.clock)
        self.log.append("beam-mounted", beam=beam)
