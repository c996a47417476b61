"""A touch, moment by moment: what is driven, read, shown and kept."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from device.drivers.limits import SLOWEST_RAMP_V_PER_S, Setpoint
from device.drivers.pace import Pace
from device.errors import DeviceError
from protocol.journal.events import (
    BeamMounted,
    DeviceArmed,
    Event,
    TouchEnded,
    TouchStarted,
    TrialStarted,
)
from protocol.journal.records import ReadBack
from protocol.study.touch import Touch
from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.journal.store import Journal
from runner.screens import Response, Screen, Welcome
from runner.session.session import SessionContext
from runner.session.trial import touch
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator, FakeParticipant, context

TEXT = template("paper").replace("hold_s = 2.0", "hold_s = 2.0\nlead_in_s = 0.6")
HZ = 24_000.0


class Scene:
    """A session within a trial; what happens is written down with its time."""

    def __init__(
        self,
        journal: Journal,
        made: SessionContext,
        device: "Device",
        participant: "Participant",
    ) -> None:
        self.journal = journal
        self.made = made
        self.device = device
        self.participant = participant
        self.lines: list[str] = []
        device.scene = participant.scene = self

    def happens(self, what: str) -> None:
        assert isinstance(self.made.clock, FakeClock)
        self.lines.append(f"{self.made.clock.passed_s:.2f} {what}")

    def touched(self, number: int, to_make: Touch) -> list[Event]:
        """Make a touch and return what the journal has of it."""
        begun = len(self.events())
        touch(self.made, number, to_make)
        return self.events()[begun:]

    @property
    def operator(self) -> FakeOperator:
        assert isinstance(self.made.operator, FakeOperator)
        return self.made.operator

    def events(self) -> list[Event]:
        return [event.record for event in self.journal.events("P01/1")]

    def driven(self) -> list[str]:
        return [line for line in self.lines if " drive " in line or line.endswith(" off")]


class Device(FakeDevice):
    scene: Scene
    takes_s = 0.0
    """How long it takes to be driven."""
    fails_after_off = False

    def drive(self, setpoint: Setpoint) -> ReadBack:
        self.scene.made.clock.sleep(self.takes_s)
        self.scene.happens(
            f"drive {setpoint.voltage_v:g} V {setpoint.frequency_hz:.0f} Hz "
            f"{setpoint.ramp_v_per_s:.6g} V/s"
        )
        return super().drive(setpoint)

    def read_back(self) -> ReadBack:
        self.scene.happens("read")
        return super().read_back()

    def off(self) -> None:
        self.scene.happens("off")
        super().off()

    def beat(self) -> None:
        super().beat()
        if self.fails_after_off and not self.on:
            raise DeviceError("the program stood still")


class Participant(FakeParticipant):
    scene: Scene
    takes_s = 0.0
    """How long the window takes."""

    def poll(self) -> Response | None:
        self.scene.made.clock.sleep(self.takes_s)
        return super().poll()

    def show(self, screen: Screen) -> None:
        text = getattr(screen, "text", "")
        self.scene.happens(f"show {type(screen).__name__} {text}")
        super().show(screen)


@contextmanager
def scene(folder: Path, text: str = TEXT) -> Iterator[Scene]:
    folder.mkdir(exist_ok=True)
    device, participant = Device(), Participant(shown=[Welcome()])
    with open_journal(folder / "study.db") as journal:
        made = context(journal, device, participant, text, FakeOperator(device))
        made.resonance_hz = HZ
        made.log.append(DeviceArmed(idn="fake", boot=1, device_time_s=0.0))
        made.log.append(BeamMounted(beam="1 mm"))
        longest = max(made.session.plan.trials, key=lambda trial: len(trial.touches))
        made.log.append(TrialStarted(index=longest.index, kind=longest.kind))
        yield Scene(journal, made, device, participant)


def hold(voltage_v: float = 100, **more: object) -> Touch:
    return Touch.model_validate({"place": "smooth", "voltage_v": voltage_v, **more})


BEFORE = [
    "0.00 show Instruction touch.smooth",
    "0.00 show LeadIn touch.smooth",
    "0.00 drive 100 V 24000 Hz 400 V/s",
    "0.00 read",
    "0.20 read",
    "0.40 read",
    "0.60 read",
    "0.60 show Pacing touch.smooth",
    "0.60 read",
]
"""The same whatever follows: steady, and read as often as later, before the mark moves."""


def test_a_held_drive_is_read_five_times_a_second(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        started, ended = made.touched(0, hold(duration_s=1.0))
    reads = ["0.60 read", "0.80 read", "1.00 read", "1.20 read", "1.40 read", "1.60 read"]
    assert made.lines == [*BEFORE, *reads, "1.60 off", "1.60 show Notice touch.end"]
    assert isinstance(started, TouchStarted)
    assert isinstance(ended, TouchEnded)
    commanded = started.commanded
    assert (commanded.voltage_v, commanded.frequency_hz) == (100, HZ)
    assert started.instruction is not None
    assert (started.touch, started.instruction.answer) == (0, "ready")
    assert len(ended.read_back) == 2, "of a drive that stays, the first and the last"
    assert len(ended.trace) == 7
    views = [view.device for view in made.operator.seen if view.device is not None]
    assert [view.voltage_v for view in views] == [100] * 3, "driven, first and last"


def test_a_ramp_and_a_sweep_go_on_in_even_steps_to_their_ends(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        _, ended = made.touched(0, hold(ramp_to_v=0, sweep_to=1.1, duration_s=0.3))
    steps = [f"{0.60 + 0.03 * step:.2f} drive 0 V {24_000 + 240 * step} Hz 333.333 V/s"
             for step in range(11)]  # fmt: skip
    assert made.driven() == ["0.00 drive 100 V 24000 Hz 400 V/s", *steps, "0.90 off"]
    assert isinstance(ended, TouchEnded)
    assert len(ended.read_back) == len(ended.trace) == 4, "each one of a drive that changes"


def test_each_read_back_of_a_ramp_alone_is_kept(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        _, ended = made.touched(0, hold(ramp_to_v=0, duration_s=0.6))
    assert isinstance(ended, TouchEnded)
    assert len(ended.read_back) == len(ended.trace) == 5


def test_a_sweep_with_a_slow_device_and_window_does_not_pass_its_end(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        made.device.takes_s = made.participant.takes_s = 0.11
        made.touched(0, hold(sweep_to=1.1, duration_s=0.3))
    swept = [float(line.split()[4]) for line in made.driven() if " drive " in line]
    assert max(swept) == swept[-1] == 26_400


@pytest.mark.parametrize(
    ("lasts_s", "step_s", "steps"), [(0.1, 0.02, 5), (0.5, 0.05, 10), (1.0, 0.1, 10)]
)
def test_a_sweep_takes_ten_steps_a_second_or_ten_in_all(
    tmp_path: Path, lasts_s: float, step_s: float, steps: int
) -> None:
    with scene(tmp_path) as made:
        made.touched(0, hold(sweep_to=1.1, duration_s=lasts_s))
    each = [
        f"{0.6 + step * step_s:.2f} drive 100 V {24_000 + 2400 * step / steps:.0f} Hz 400 V/s"
        for step in range(1, steps + 1)
    ]
    assert made.driven()[1:-1] == each


def test_a_long_sweep_is_stepped_ten_times_a_second(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        made.touched(0, hold(sweep_to=0.9, duration_s=2.0))
    swept = made.driven()[1:-1]
    assert swept[:2] == [
        "0.70 drive 100 V 23880 Hz 400 V/s",
        "0.80 drive 100 V 23760 Hz 400 V/s",
    ]
    assert swept[-1] == "2.60 drive 100 V 21600 Hz 400 V/s"
    assert len(swept) == 20


def test_a_ramp_of_nearly_nothing_keeps_to_the_slowest_one(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        made.touched(0, hold(ramp_to_v=100.0001, duration_s=5))
    slowest = f"{SLOWEST_RAMP_V_PER_S:.6g} V/s"
    assert made.driven()[1] == f"0.60 drive 100 V 24000 Hz {slowest}"


def test_a_steep_ramp_keeps_to_that_of_the_rig(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        made.touched(0, hold(ramp_to_v=180, duration_s=0.1))
    assert made.driven()[1] == "0.60 drive 180 V 24000 Hz 400 V/s"


def test_a_touch_waits_after_another_one_alone(tmp_path: Path) -> None:
    for number, waits_s in ((0, 0.0), (1, 1.5), (2, 1.5)):
        with scene(tmp_path / str(number), f"{TEXT}\n[timing]\nbetween_touches_s = 1.5\n") as made:
            made.touched(number, hold(duration_s=1.0))
        assert made.lines[0] == f"{waits_s:.2f} show Instruction touch.smooth"


def test_a_touch_has_its_own_beam_or_that_of_the_study(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        made.touched(0, hold(beam="no bodies"))
        made.touched(1, hold())
        made.touched(2, hold(beam="1 mm"))
    assert made.operator.mounts == ["no bodies", "1 mm"]


def test_a_finger_that_does_not_follow_is_told_to_the_operator(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        verdict = touch(made.made, 0, Touch(place="path", voltage_v=100, direction="left"))
    assert verdict.missed
    assert made.operator.seen[-1].warning == (
        f"the touch did not follow the instruction: {' and '.join(verdict.missed)}"
    )
    with scene(tmp_path / "still") as made:
        assert touch(made.made, 0, hold()).missed == ()
    assert made.operator.seen[-1].warning == ""


def test_the_device_is_beaten_at_each_step(tmp_path: Path) -> None:
    with scene(tmp_path) as made:
        made.touched(0, hold(duration_s=1.0))
        beats = made.device.calls.count("beat")
        made.touched(1, hold(sweep_to=1.1, duration_s=0.1))
        assert made.device.calls.count("beat") - beats == 20 + 12 + 5 + 1, "before and after it"
    assert beats == 12 + 20 + 1, "each twentieth of a second, of lead-in and touch, and at its end"


@pytest.mark.parametrize("slow_s", [0.2, 0.4])
def test_a_touch_that_ended_over_a_second_late_does_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, slow_s: float
) -> None:
    """Nothing stood still: the device alone took long, at the first look, the last and off."""
    with scene(tmp_path) as made:
        clock, read_back, off = made.made.clock, made.device.read_back, made.device.off

        def slow(call: Callable[[], Any]) -> Callable[[], Any]:
            def called() -> Any:
                clock.sleep(slow_s)
                return call()

            return called

        monkeypatch.setattr(made.device, "off", slow(off))
        monkeypatch.setattr(made.device, "read_back", slow(read_back))
        late = r"^a touch of 1 s ended 1\.\d s late, because .* too slow; it does not count$"
        if slow_s > 0.3:
            with pytest.raises(DeviceError, match=late):
                made.touched(0, hold(duration_s=1.0))
            assert not any(isinstance(event, TouchEnded) for event in made.events())
            assert not made.device.on
        else:
            made.touched(0, hold(duration_s=1.0))


@pytest.mark.parametrize(("takes_s", "counts"), [(0.5, True), (1.4, False), (3.0, False)])
def test_who_stands_still_while_the_output_goes_on_is_late(
    tmp_path: Path, takes_s: float, counts: bool
) -> None:
    """The output may be on from the first moment of that call, shorter than a watchdog sees."""
    with scene(tmp_path) as made:
        made.device.takes_s = takes_s
        if counts:
            made.touched(0, hold(duration_s=1.0))
        else:
            with pytest.raises(DeviceError, match=r"too slow; it does not count$"):
                made.touched(0, hold(duration_s=1.0))
        assert any(isinstance(event, TouchEnded) for event in made.events()) == counts


def test_a_device_may_take_the_time_to_begin_that_was_measured_when_it_was_armed(
    tmp_path: Path,
) -> None:
    with scene(tmp_path) as made:
        made.device.takes_s = 1.4
        made.device.pace = Pace(answer_s=0.02, watch_s=0.6, begin_s=1.5, end_s=0.2, late_s=0.5)
        made.touched(0, hold(duration_s=1.0))
        assert any(isinstance(event, TouchEnded) for event in made.events())


def test_a_fault_that_is_found_as_a_touch_ends_keeps_it_from_counting(tmp_path: Path) -> None:
    """As of a program that stood still when it turned the output off."""
    with scene(tmp_path) as made:
        made.device.fails_after_off = True
        with pytest.raises(DeviceError, match="stood still"):
            made.touched(0, hold(duration_s=1.0))
        assert not any(isinstance(event, TouchEnded) for event in made.events())
