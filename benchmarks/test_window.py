"""What the participant's window costs: its opening, and the frame before a touch begins."""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.compared import compare, tell
from protocol.study.participant_texts import study_wording
from protocol.study_file.loading import parsed_study, template
from runner.screens import Instruction, Pacing, Screen
from runner.window.client import Peer, participant_window
from runner.window.messages import Settings, show_message
from runner.window.preflight import study_window
from tests.runner.window.person import virtual_display

TOUCHBEAM = str(Path(sys.executable).with_name("touchbeam"))
PAPER = parsed_study(template("paper"))
FRAME_S = 1 / 60
ROUNDS = 5
TOUCHES = 60

BARE = """
from psychopy import visual
window = visual.Window(size=(1920, 1080), fullscr=True, units="pix", checkTiming=False)
window.flip()
print("opened", flush=True)
"""


@pytest.fixture(scope="module")
def display() -> Iterator[None]:
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb on this machine; make test installs it")
    before = os.environ.get("DISPLAY")
    with virtual_display(1920, 1080) as name:
        os.environ["DISPLAY"] = name
        yield
    os.environ.pop("DISPLAY")
    if before is not None:
        os.environ["DISPLAY"] = before


def _bare_window_s() -> float:
    start = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-c", BARE], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "opened\n"
        return time.perf_counter() - start


class _Seen(Exception):
    """Enough was seen: nobody waits for the last page to be read."""


def _first_screen_s() -> float:
    start = time.perf_counter()
    settings = Settings(wording=study_wording(PAPER, "en"))
    with suppress(_Seen), participant_window([TOUCHBEAM, "participant-window"], settings):
        took_s = time.perf_counter() - start
        raise _Seen
    return took_s


@pytest.mark.usefixtures("display")
def test_the_first_screen_takes_at_most_half_as_long_again_as_a_bare_window(
    benchmark: BenchmarkFixture,
) -> None:
    _bare_window_s()
    pairs = [(_first_screen_s(), _bare_window_s()) for _ in range(ROUNDS)]
    work = "start the window and show its first page"
    peer = "PsychoPy, an empty window"
    ratio = compare(benchmark, work, peer, *zip(*pairs, strict=True))
    benchmark.pedantic(_first_screen_s, rounds=1)
    assert ratio <= 1.5


@pytest.mark.usefixtures("display")
def test_the_window_shows_a_touch_within_one_frame(
    benchmark: BenchmarkFixture,
) -> None:
    settings = Settings(wording=study_wording(PAPER, "en"))
    window = study_window([TOUCHBEAM], PAPER, settings, None)
    with suppress(_Seen), window as participant:
        screens = Screens(participant.peer)
        for _ in range(40):  # until all that is foreseen was built
            screens.shown_s(Instruction(text="remember"))
        waits = [_wait_s(screens) for _ in range(TOUCHES)]
        benchmark.pedantic(_wait_s, args=(screens,), rounds=5)
        raise _Seen
    waited = f"{1000 * median(waits):.1f} ms, at most {1000 * max(waits):.1f} ms"
    tell(benchmark, "two pages of the window, one after the other", the_second_is_seen_after=waited)
    assert median(waits) <= FRAME_S


@dataclass
class Screens:
    """Shows screens one after another by the window's own messages."""

    window: Peer
    number: int = 0

    def shown_s(self, screen: Screen) -> float:
        """Show `screen`; return when its first frame was seen, on the clock that is journalled."""
        self.number += 1
        self.window.send(show_message(self.number, screen))
        while True:
            for message in self.window.received():
                if message.get("shown") == self.number:
                    return float(message["at_s"])
            time.sleep(0.002)


def _wait_s(screens: Screens) -> float:
    """Return the time from the session's wish to the touch's first frame."""
    screens.shown_s(Instruction(text="remember"))
    pacing = Pacing(start_m=0.01, end_m=0.081, duration_s=1.775, force_n=0.5, direction="right")
    asked_s = time.monotonic()
    return screens.shown_s(pacing) - asked_s
