"""One touch: the right beam, the instruction, the drive, the finger's way, and off again."""

from dataclasses import asdict
from typing import Any

from device.records import Setpoint
from protocol.texts import touch_text
from protocol.touch import Touch
from runner.judging import Sample, judged, samples_of
from runner.pacing import pacing
from runner.preparing import mount
from runner.room import Room
from runner.screens import Instruction, Notice, Response
from runner.waiting import pass_time, response
from runner.watching import show_where_we_are

SAMPLE_EVERY_S = 0.2
SWEEP_STEP_S = 0.1


def touch(room: Room, number: int, to_make: Touch) -> dict[str, Any]:
    """Carry out one touch of a trial and return how it was done.

    The output is off before and after it; it goes on only once the journal says that it will.
    """
    study = room.session.study
    mount(room, to_make.beam or study.touch.beam)
    if number > 0:
        pass_time(room, study.timing.between_touches_s)
    ready = _instructed(room, to_make)
    start = _setpoint(room, to_make.voltage_v, to_make.frequency)
    room.log.append(
        "touch-started", touch=number, commanded=asdict(start), instruction=asdict(ready)
    )
    stimulus = _Stimulus(room, to_make)
    stimulus.deliver(start)
    room.device.off()
    room.participant.show(Notice(text="touch.end"))
    verdict = judged(stimulus.pacing, stimulus.samples)
    room.log.append("touch-ended", touch=number, **stimulus.record(), judged=verdict)
    show_where_we_are(room, warning=_warning(verdict))
    return verdict


def _instructed(room: Room, to_make: Touch) -> Response:
    """Say how to touch, and nothing else, until the participant is ready."""
    way = pacing(to_make, room.session.study.touch).touch
    room.participant.show(Instruction(text=touch_text(to_make), touch=way))
    return response(room)


class _Stimulus:
    """What the device does while the finger is on the beam, and what was read back meanwhile."""

    def __init__(self, room: Room, to_make: Touch) -> None:
        self._room = room
        self._touch = to_make
        self._read_back: list[dict[str, Any]] = []
        self._next_sample_s = 0.0
        self._next_step_s = 0.0
        self.samples: list[Sample] = []
        self.pacing = pacing(to_make, room.session.study.touch)

    def deliver(self, start: Setpoint) -> None:
        """Soft start, the touch itself with its ramp or sweep; the output stays on."""
        room, to_make = self._room, self._touch
        show_where_we_are(room, device=room.device.drive(start))
        pass_time(room, start.voltage_v / start.ramp_v_per_s)
        room.participant.show(self.pacing)
        self._look()
        if to_make.end_voltage_v != to_make.voltage_v:
            self._ramp()
        self._began_s = room.clock.monotonic_s()
        pass_time(room, self.pacing.duration_s, self._meanwhile)
        self._look()

    def record(self) -> dict[str, Any]:
        """Return what was read back: drive at start and end, the finger's trace in between."""
        trace = [[entry.t_s, entry.force_n, entry.position_m] for entry in self.samples]
        return {"read_back": self._read_back, "trace": trace}

    def _look(self) -> None:
        read_back = self._room.device.read_back()
        self._read_back.append(asdict(read_back))
        self.samples += samples_of(read_back)
        show_where_we_are(self._room, device=read_back)

    def _ramp(self) -> None:
        change_v = abs(self._touch.end_voltage_v - self._touch.voltage_v)
        end = _setpoint(self._room, self._touch.end_voltage_v, self._touch.frequency)
        self._room.device.drive(
            Setpoint(
                voltage_v=end.voltage_v,
                frequency_hz=end.frequency_hz,
                ramp_v_per_s=change_v / self.pacing.duration_s,
            )
        )

    def _meanwhile(self) -> None:
        """Look at the finger now and then; move the frequency on if it sweeps."""
        passed_s = self._room.clock.monotonic_s() - self._began_s
        if passed_s >= self._next_sample_s:
            self._next_sample_s += SAMPLE_EVERY_S
            self.samples += samples_of(self._room.device.read_back())
        if self._touch.sweep_to is not None and passed_s >= self._next_step_s:
            self._next_step_s += SWEEP_STEP_S
            self._step_frequency(min(passed_s / self.pacing.duration_s, 1.0))

    def _step_frequency(self, share: float) -> None:
        to_make = self._touch
        frequency = to_make.frequency + share * (to_make.end_frequency - to_make.frequency)
        self._room.device.drive(_setpoint(self._room, to_make.end_voltage_v, frequency))


def _setpoint(room: Room, voltage_v: float, frequency: float) -> Setpoint:
    return Setpoint(
        voltage_v=voltage_v,
        frequency_hz=frequency * room.resonance_hz,
        ramp_v_per_s=room.session.study.rig.ramp_v_per_s,
    )


def _warning(verdict: dict[str, Any]) -> str:
    missed = [name for name in ("force", "place") if verdict[f"{name}_ok"] is False]
    return f"the touch was not as asked: {' and '.join(missed)}" if missed else ""
