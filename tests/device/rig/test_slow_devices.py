"""Devices that take long to answer: set up and measured; refused, with nothing on, if too slow.

Over the real link and rig, on simulated time: the device works at one line after the other.
"""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain, pairwise, repeat

import pytest

from device.errors import DeviceError, OutputUnknown
from device.rig import LONGEST_CALL_S, RAMP_STEP_S, Rig
from device.simulator.device import dialects
from device.simulator.in_process import InProcessDevice, InProcessHand, in_process_rig
from tests.device.rigs import DRIVE, LIMITS


class Slow:
    """A device that works for so long at each line, and at its first one; its rig, and a hand."""

    def __init__(
        self, model: str, work_s: float, first_s: float = 0.0, watchdog_s: float = 5.0
    ) -> None:
        lines: Iterator[float] = chain([first_s] if first_s else [], repeat(work_s))
        self.was_on = False
        self.device = InProcessDevice(1, model, work_s=lambda: next(lines))
        self.device.on_step = self._look
        limits = replace(LIMITS, watchdog_s=watchdog_s)
        self.rig: Rig = in_process_rig(self.device, limits, model.partition("-")[0])
        self.hand = InProcessHand(self.device, self.rig)

    def _look(self) -> None:
        self.was_on = self.was_on or self.device.inside.instrument.output

    def live(self, seconds: float) -> None:
        """Let the session live on; the rig makes its ramp meanwhile."""
        end_s = self.device.now_s() + seconds
        while self.device.now_s() < end_s:
            self.rig.beat()
            self.hand.pass_time(1.5 * RAMP_STEP_S)

    def took_s(self, call: Callable[[], object]) -> float:
        """How long a call takes, on the device's clock."""
        begin_s = self.device.now_s()
        call()
        return self.device.now_s() - begin_s


def set_up(slow: Slow) -> str:
    """Arm; return what was refused, '' if nothing was."""
    try:
        slow.rig.arm()
    except DeviceError as error:
        return str(error)
    return ""


TIMES_MS = (5, 26, 50, 100, 200)
TOO_SLOW = {"rigol": 100, "rigol-DG1062Z": 100, "siglent": 200}
"""From which time of an answer on a drive takes too long, ms: these take one query a line."""
MODELS = tuple(dialects())


@pytest.mark.parametrize("answer_ms", TIMES_MS)
@pytest.mark.parametrize("model", MODELS)
def test_a_slow_device_is_set_up_and_driven_or_refused_with_what_was_measured(
    model: str, answer_ms: int
) -> None:
    slow = Slow(model, answer_ms / 1e3)
    refused = set_up(slow)
    assert not slow.was_on
    if answer_ms < TOO_SLOW.get(model, 300):
        assert refused == ""
        shown = slow.rig.drive(DRIVE)
        assert shown.output
        slow.live(2.0)
        assert slow.rig.read_back().voltage_v == pytest.approx(DRIVE.voltage_v)
        slow.rig.off()
        assert not slow.device.inside.instrument.output
    else:
        said = rf"takes {answer_ms + 1} ms to answer, .* a drive would take up to [\d.]+ s to begin"
        assert re.search(said, refused)
        assert refused.endswith("; nothing was driven; output off, read back")


@pytest.mark.parametrize("then_ms", [5, 100])
@pytest.mark.parametrize("model", MODELS)
def test_a_device_may_take_3_s_for_its_first_answer(model: str, then_ms: int) -> None:
    slow = Slow(model, then_ms / 1e3, first_s=3.0)
    refused = set_up(slow)
    assert "UNKNOWN" not in refused
    assert (refused == "") == (then_ms < TOO_SLOW.get(model, 300))


@pytest.mark.parametrize("model", MODELS)
def test_one_that_cannot_be_watched_is_refused_with_the_time_that_it_needs(model: str) -> None:
    answer_ms = {"board": 260, "siglent": 50}.get(model, 100 if "keysight" in model else 26)
    slow = Slow(model, answer_ms / 1e3, watchdog_s=0.5)
    refused = set_up(slow)
    said = re.search(r"takes (\d+) ms .* rig\.watchdog_s is 0\.5; .* to ([\d.]+) or more", refused)
    if model == "board":  # there a drive takes too long before that
        slow = Slow(model, 0.2, watchdog_s=0.1)
        said = re.search(r"takes (\d+) ms .* is 0\.1; .* to ([\d.]+) or m", set_up(slow))
        answer_ms = 200
    assert said is not None, refused
    assert int(said[1]) == answer_ms + 1
    assert not slow.was_on
    again = Slow(model, answer_ms / 1e3, watchdog_s=float(said[2]))
    assert set_up(again) == "", "with what the message says"
    again.rig.drive(DRIVE)
    again.live(2.0)
    again.rig.off()


@pytest.mark.parametrize("model", MODELS)
def test_the_operator_is_told_of_a_slow_device_and_of_what_follows(model: str) -> None:
    quick, slow = Slow(model, 0.005), Slow(model, 0.04)
    assert not any("to answer" in remark for remark in quick.rig.arm().remarks)
    *_, remark = slow.rig.arm().remarks
    said = re.fullmatch(
        r"this device takes 41 ms to answer: a drive begins up to ([\d.]+) s and ends up to "
        r"([\d.]+) s late(?:, and a soft start rises in steps of up to (\d+) V)?",
        remark,
    )
    assert said is not None, remark
    begins_s, ends_s = float(said[1]) + 0.05, float(said[2]) + 0.05
    assert begins_s < LONGEST_CALL_S
    assert slow.took_s(lambda: slow.rig.drive(DRIVE)) < begins_s
    volts = [slow.device.inside.instrument.target_v]
    for _ in range(200):
        slow.live(0.01)
        volts.append(slow.device.inside.instrument.target_v)
    assert slow.took_s(slow.rig.off) < ends_s
    if model == "board":
        assert said[3] is None
    else:
        largest_v = max(after - before for before, after in pairwise(volts))
        # A poll that is due comes between two steps.
        assert largest_v <= min(3 * float(said[3]), DRIVE.voltage_v)


@pytest.mark.parametrize("model", MODELS)
def test_a_device_that_falls_silent_while_it_is_set_up_was_off(model: str) -> None:
    """Off was read back before, and nothing was on since."""
    slow = Slow(model, 0.0)
    lines = 0
    inside, answer = slow.device.inside, slow.device.inside.answer

    def silent_in_the_end(line: str, wall_s: float) -> str | None:
        nonlocal lines
        lines += 1
        return answer(line, wall_s) if lines < 20 else None

    inside.answer = silent_in_the_end  # type: ignore[method-assign]
    for call in (slow.rig.arm, slow.rig.off):
        with pytest.raises(OutputUnknown, match=r"; the output was off when it was last read back"):
            call()
    assert not slow.was_on


def test_a_device_that_becomes_slower_while_it_is_driven_is_a_fault() -> None:
    work_s = 0.001
    device = InProcessDevice(1, "keysight", work_s=lambda: work_s)
    rig = in_process_rig(device, LIMITS, "keysight")
    rig.arm()
    rig.drive(DRIVE)
    work_s = 0.5
    with pytest.raises(DeviceError, match="in time"):
        rig.read_back()
