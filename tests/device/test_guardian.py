"""The guardian of an output: a process of its own on a real descriptor, and the sign of life."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import psutil
import pytest

from device.errors import DeviceError
from device.guardian import Guardian, Pulse, guardian_of
from device.guardian_process import passed_s
from tests.device.lying import SteppedClock
from tests.device.rigs import until

pytestmark = pytest.mark.waits

OFF = b"\nOUTP OFF\n"
LIMIT_S = 0.3


@dataclass
class Line:
    """A line to a device that a guardian shares."""

    program_end: int
    device_end: int
    guardian: Guardian = field(init=False)

    def __post_init__(self) -> None:
        self.guardian = Guardian(self.program_end, OFF, LIMIT_S)
        self.guardian.start()

    def heard(self, within_s: float) -> bytes:
        """What the device hears within `within_s`, at once if there is something."""
        ready, _, _ = select.select([self.device_end], [], [], within_s)
        return os.read(self.device_end, 100) if ready else b""

    def is_told(self) -> bool:
        """Whether the program hears of it within a while."""
        return until(self.guardian.has_tripped, within_s=5)

    @property
    def process(self) -> int:
        assert self.guardian._process is not None
        return self.guardian._process.pid


@pytest.fixture
def line() -> Iterator[Line]:
    device_end, program_end = os.pipe()
    line = Line(program_end, device_end)
    try:
        yield line
    finally:
        line.guardian.close()
        os.close(program_end)
        os.close(device_end)


def test_off_is_sent_once_the_program_is_silent_and_the_program_is_told(line: Line) -> None:
    line.guardian.hears(passed_s(), on=True)
    assert line.heard(LIMIT_S / 2) == b""
    assert line.heard(5) == OFF
    assert line.is_told()


def test_nothing_is_sent_while_the_program_lives(line: Line) -> None:
    for _ in range(20):
        line.guardian.hears(passed_s(), on=True)
        assert line.heard(0.02) == b""
    assert not line.guardian.has_tripped()
    line.guardian.hears(passed_s(), on=False)


def test_nothing_is_sent_of_an_output_that_is_off_however_long_the_silence(line: Line) -> None:
    line.guardian.hears(passed_s(), on=True)
    line.guardian.hears(passed_s(), on=False)
    assert line.heard(3 * LIMIT_S) == b""
    line.guardian.close()
    assert line.heard(0) == b"", "nor at the end"


def test_off_is_sent_twice_when_the_program_is_gone(line: Line) -> None:
    """It may have died in the middle of a line, which the second off then does not follow."""
    line.guardian.hears(passed_s(), on=True)
    line.guardian.close()
    assert line.heard(1) == OFF + OFF


def test_a_gap_between_two_beats_counts_also_if_it_is_over_when_it_is_seen(line: Line) -> None:
    """As of a guardian that got no time to look: the beats wait for it with their times."""
    now_s = passed_s()
    os.kill(line.process, signal.SIGSTOP)
    line.guardian.hears(now_s, on=True)
    line.guardian.hears(now_s + 2 * LIMIT_S, on=True)
    line.guardian.hears(now_s + 2 * LIMIT_S, on=False)
    os.kill(line.process, signal.SIGCONT)
    assert line.heard(5) == OFF
    assert line.is_told()


def test_a_guardian_that_looks_late_sends_nothing_if_the_beats_came_in_time(line: Line) -> None:
    os.kill(line.process, signal.SIGSTOP)
    for _ in range(20):
        line.guardian.hears(passed_s(), on=True)
        time.sleep(LIMIT_S / 10)
    line.guardian.hears(passed_s(), on=False)
    os.kill(line.process, signal.SIGCONT)
    assert line.heard(2 * LIMIT_S) == b""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGTSTP", "SIGPIPE"])
def test_signals_that_end_or_stop_a_program_do_not_end_its_guardian(line: Line, name: str) -> None:
    line.guardian.hears(passed_s(), on=True)
    os.kill(line.process, getattr(signal, name))
    assert line.heard(5) == OFF
    assert os.getpgid(line.process) != os.getpgid(0), "Ctrl-C and Ctrl-Z do not reach it"


def test_a_guardian_that_was_killed_is_a_fault(line: Line) -> None:
    os.kill(line.process, signal.SIGKILL)
    assert line.guardian._process is not None
    line.guardian._process.wait()
    line.guardian.hears(passed_s(), on=True)
    with pytest.raises(DeviceError, match=r"^the guardian of the output has ended \(was it k"):
        line.guardian.has_tripped()


def test_a_guardian_that_was_stopped_is_a_fault(line: Line) -> None:
    os.kill(line.process, signal.SIGSTOP)
    try:
        for _ in range(10_000):
            line.guardian.hears(passed_s(), on=False)
        with pytest.raises(DeviceError, match=r"^the guardian of the output does not listen$"):
            line.guardian.has_tripped()
    finally:
        os.kill(line.process, signal.SIGCONT)


def test_a_guardian_that_was_killed_is_replaced_at_the_next_start(line: Line) -> None:
    os.kill(line.process, signal.SIGKILL)
    assert line.guardian._process is not None
    line.guardian._process.wait()
    line.guardian.start()
    line.guardian.hears(passed_s(), on=True)
    assert line.heard(5) == OFF


def test_off_is_sent_once_more_to_what_a_stopped_program_had_on_its_way(line: Line) -> None:
    line.guardian.hears(passed_s(), on=True)
    assert line.heard(5) == OFF
    line.guardian.hears(passed_s(), on=True)  # it goes on, and so does its command
    assert line.heard(LIMIT_S / 2) == OFF
    line.guardian.hears(passed_s(), on=False)
    assert line.heard(2 * LIMIT_S) == b""


def test_a_guardian_that_cannot_write_does_not_say_that_it_turned_anything_off(line: Line) -> None:
    os.close(line.device_end)
    line.guardian.hears(passed_s(), on=True)
    assert not until(line.guardian.has_tripped, within_s=2 * LIMIT_S)
    line.guardian.hears(passed_s(), on=False)
    line.device_end, unused = os.pipe()
    os.close(unused)


WITHOUT_STREAMS = """\
import os, sys
from device.guardian import Guardian
from device.guardian_process import passed_s
line = int(sys.argv[1])
os.close(0), os.close(1)
assert (os.dup(line), os.dup(line)) == (0, 1)
guardian = Guardian(1, bytes.fromhex(sys.argv[2]), 0.3)
guardian.start()
guardian.hears(passed_s(), on=True)
os._exit(9)
"""


def test_a_port_at_the_number_of_a_standard_stream_is_guarded_too() -> None:
    """As of a program that was started without them, by cron for one."""
    device_end, program_end = os.pipe()
    command = [sys.executable, "-c", WITHOUT_STREAMS, str(program_end), OFF.hex()]
    subprocess.run(command, pass_fds=(program_end,), check=False)
    os.close(program_end)
    with os.fdopen(device_end, "rb") as device:
        assert device.read() == OFF + OFF


def test_a_guardian_that_cannot_start_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    read, write = os.pipe()
    try:
        for executable, why in (("/nowhere/python", "No such file"), ("/bin/true", "ended at on")):
            monkeypatch.setattr("sys.executable", executable)
            with pytest.raises(DeviceError, match=rf"guardian of the output cannot start: .*{why}"):
                Guardian(write, OFF, LIMIT_S).start()
    finally:
        os.close(read)
        os.close(write)


@pytest.mark.parametrize(("system", "descriptor"), [("nt", 3), ("posix", None)])
def test_a_port_that_no_other_process_can_hold_has_no_guardian(
    monkeypatch: pytest.MonkeyPatch, system: str, descriptor: int | None
) -> None:
    monkeypatch.setattr("device.guardian.os.name", system)
    guardian = guardian_of(descriptor, OFF, LIMIT_S)
    monkeypatch.undo()  # before pytest looks for paths
    assert guardian is None


@pytest.fixture
def pulse() -> tuple[Pulse, SteppedClock]:
    clock = SteppedClock()
    return Pulse(clock, 0.5), clock


@pytest.mark.parametrize("renewed_by", ["beat", "watch", "release"])
def test_nothing_renews_the_sign_of_life_without_looking_at_the_gap_before_it(
    pulse: tuple[Pulse, SteppedClock], renewed_by: str
) -> None:
    sign, clock = pulse
    sign.watch()
    clock.advance(3.4)
    why = getattr(sign, renewed_by)() or sign.broken()
    assert why == (
        "the program stood still for 3.4 s (it was stopped, or the computer slept or was too busy)"
    )
    assert sign.broken() == "", "said once"


def test_a_pause_within_the_limit_or_with_the_output_off_is_none(
    pulse: tuple[Pulse, SteppedClock],
) -> None:
    sign, clock = pulse
    clock.advance(60)
    sign.watch()
    for _ in range(10):
        clock.advance(0.5)
        sign.beat()
    assert sign.release() == ""
    clock.advance(60)
    sign.beat()
    assert sign.broken() == ""


FORKED = """\
import os, sys, time
from device.guardian import Guardian
from device.guardian_process import passed_s
guardian = Guardian(int(sys.argv[1]), bytes.fromhex(sys.argv[2]), 0.3)
guardian.start()
guardian.hears(passed_s(), on=sys.argv[3] == "on")
print(guardian._process.pid, flush=True)
if os.fork() == 0:
    os.close(1)
    time.sleep(float(sys.argv[4]))
os._exit(9)
"""


@pytest.mark.parametrize(("state", "heard"), [("on", OFF + OFF), ("off", b"")])
def test_a_fork_of_the_program_that_lives_on_keeps_no_guardian_alive(
    state: str, heard: bytes
) -> None:
    """It holds the guardian's connection open, and could let it send off to later sessions."""
    device_end, program_end = os.pipe()
    lasts_s = 20.0
    made = subprocess.run(
        [sys.executable, "-c", FORKED, str(program_end), OFF.hex(), state, str(lasts_s)],
        pass_fds=(program_end,),
        stdout=subprocess.PIPE,
        check=False,
    )
    began_s = time.monotonic()
    while psutil.pid_exists(int(made.stdout)) and time.monotonic() - began_s < lasts_s / 2:
        time.sleep(0.05)
    assert not psutil.pid_exists(int(made.stdout))
    os.set_blocking(device_end, False)
    try:
        assert os.read(device_end, 1000).startswith(heard) if heard else True
        with pytest.raises(BlockingIOError):
            os.read(device_end, 1000)
    finally:
        os.close(device_end)
        os.close(program_end)


class Ended(Guardian):
    """One that was killed."""

    def hears(self, at_s: float, *, on: bool) -> None: ...

    def has_tripped(self) -> bool:
        raise DeviceError("the guardian has ended")


def test_off_is_off_also_without_a_guardian() -> None:
    clock = SteppedClock()
    sign = Pulse(clock, 0.5, Ended(-1, OFF, 0.5))
    sign.watch()
    assert sign.release() == "the guardian has ended"
    clock.advance(60)
    assert sign.release() == "the guardian has ended"
