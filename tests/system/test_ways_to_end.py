"""Every way in which a Python program can end while its rig is on: who turns the output off.

The table of docs/how-to/script.md is made of these rows: `python -m tests.system.test_ways_to_end`
prints it.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from device.simulator.client import ControlClient, Endpoints, simulator_process
from protocol.study_file.loading import template
from tests.device.rigs import TOUCHBEAM, until

pytestmark = pytest.mark.waits

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "script.md"
OFF_WITHIN_S = 0.7
"""The watchdog's 0.5 s, and what the control socket takes to tell."""
PROGRAM = """\
import os, signal, sys, threading, time
from concurrent.futures import ThreadPoolExecutor
import touchbeam

# A shell starts what runs beside it with Ctrl-C ignored, and nohup with SIGHUP.
signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGHUP, signal.SIG_DFL)
url, folder = sys.argv[1:]


def on():
    rig = touchbeam.open_rig(folder, url)
    rig.drive(100, 24_221.37)
    rig.wait(0.4)
    return rig


def ends():
    print("ends", time.monotonic(), flush=True)


def drive_on(rig):
    ends()
    while True:
        rig.wait(0.05)


def daemon(work):
    threading.Thread(target=work, daemon=True).start()


def slow_to_close(rig, meanwhile=lambda: None):
    # The port is busy for a while when it is asked to turn the output off.
    off, asked = rig._rig.device.off, threading.Event()

    def slow():
        asked.set()
        meanwhile()
        time.sleep(0.2)
        off()

    rig._rig.device.off = slow
    return asked


"""
US = "touchbeam, and reads it back"
WATCHDOG, GUARDIAN, NOBODY = "its watchdog", "its guardian", "**nobody**"


@dataclass(frozen=True, kw_only=True)
class Way:
    """A way to end: in words for the page, the end of the program, and who turns the output off.

    `signals` are sent once the program has said that it ends; one that `stays` does not end by
    itself.
    """

    name: str
    words: str
    code: str
    signals: tuple[str, ...] = ()
    board: str = US
    generator: str = US
    stays: bool = False


def killed(name: str, words: str, code: str, *signals: str, stays: bool = False) -> Way:
    """Return a way that Python does not notice."""
    return Way(
        name=name,
        words=words,
        code=code,
        signals=signals,
        board=WATCHDOG,
        generator=GUARDIAN,
        stays=stays,
    )


NORMAL = "the `with` block or the program is over; `sys.exit`; an exception"
FORGOTTEN = "no name leads to the rig any more, in any thread; a generator is closed"
THREADS = "a thread or a task of a pool ends or fails; a daemon is still at work at the end"
PROCESSES = "a process of `multiprocessing` or of a pool ends or is terminated"
SIGNALS = (
    "Ctrl-C, SIGTERM, SIGHUP, SIGQUIT, also while a thread drives or a second rig is open, if the "
    "main thread has opened a rig"
)
UNSEEN = "SIGTERM, SIGHUP, SIGQUIT, if only other threads have opened rigs"
CRASHED = "kill -9, SIGUSR1 and others, a crash, `os._exit`, `os.exec*`"
STANDS = "SIGSTOP, Ctrl-Z; a call in C that keeps the interpreter to itself"

WAYS = [
    Way(name="with", words=NORMAL, code="with on() as rig:\n    ends()\n"),
    Way(name="exception", words=NORMAL, code="with on() as rig:\n    ends()\n    1 / 0\n"),
    Way(name="exit", words=NORMAL, code="with on() as rig:\n    ends()\n    sys.exit(3)\n"),
    Way(name="end", words=NORMAL, code="rig = on()\nends()\n"),
    Way(
        name="generator-closed",
        words=FORGOTTEN,
        code="""\
def trials():
    with on():
        yield 1
        yield 2

steps = trials()
next(steps)
ends()
steps.close()
time.sleep(1)
""",
    ),
    Way(name="deleted", words=FORGOTTEN, code="rig = on()\nends()\ndel rig\ntime.sleep(1)\n"),
    Way(
        name="cycle",
        words=FORGOTTEN,
        code="""\
import gc

circle = [on()]
circle.append(circle)
ends()
del circle
gc.collect()
time.sleep(1)
""",
    ),
    Way(
        name="deleted-in-daemon",
        words=FORGOTTEN,
        code="""\
held = [on()]
asked = slow_to_close(held[0])
ends()
daemon(held.clear)
asked.wait()
""",
    ),
    Way(
        name="thread",
        words=THREADS,
        code="""\
def work():
    with on():
        ends()
        raise ValueError("mine")

threading.Thread(target=work).start()
""",
    ),
    Way(
        name="thread-pool",
        words=THREADS,
        code="""\
def work():
    with on():
        ends()
        raise ValueError("mine")

with ThreadPoolExecutor() as pool:
    print(pool.submit(work).exception())
time.sleep(1)
""",
    ),
    Way(
        name="daemon",
        words=THREADS,
        code="""\
ready = threading.Event()

def work():
    rig = on()
    ready.set()
    while True:
        rig.wait(0.01)

daemon(work)
ready.wait()
ends()
""",
    ),
    Way(
        name="closed-in-daemon",
        words=THREADS,
        code="rig = on()\nasked = slow_to_close(rig)\nends()\ndaemon(rig.close)\nasked.wait()\n",
    ),
    Way(
        name="process",
        words=PROCESSES,
        code="""\
import multiprocessing

def work():
    global rig
    rig = on()
    ends()

process = multiprocessing.get_context("fork").Process(target=work)
process.start()
process.join()
time.sleep(1)
""",
    ),
    Way(
        name="process-pool",
        words=PROCESSES,
        code="""\
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

def work():
    global rig
    rig = on()

with ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as pool:
    pool.submit(work).result()
    ends()
time.sleep(1)
""",
    ),
    Way(
        name="process-terminated",
        words=PROCESSES,
        code="""\
import multiprocessing

def work(ready):
    rig = on()
    ready.set()
    while True:
        rig.wait(0.05)

context = multiprocessing.get_context("fork")
ready = context.Event()
process = context.Process(target=work, args=(ready,))
process.start()
ready.wait()
ends()
process.terminate()
process.join()
time.sleep(1)
""",
    ),
    Way(
        name="fork",
        words="the program ends after a fork of it (`os.fork`) ended, which leaves the rig alone",
        code="""\
def forked(end):
    child = os.fork()
    if child == 0:
        end()
        sys.exit()
    for _ in range(100):
        rig.wait(0.05)
        if os.waitpid(child, os.WNOHANG)[0]:
            return
    os.kill(child, signal.SIGKILL)
    sys.exit("the fork hangs")

with on() as rig:
    for end in (lambda: None, rig.close, lambda: os._exit(0), lambda: 1 / 0):
        forked(end)
        assert rig.read_back().output
    ends()
""",
    ),
    *(
        Way(name=name, words=SIGNALS, code="with on() as rig: drive_on(rig)\n", signals=(name,))
        for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
    ),
    *(
        Way(
            name=f"{name}-while-a-thread-drives",
            words=SIGNALS,
            code="""\
with on() as rig, ThreadPoolExecutor() as pool:
    pool.submit(drive_on, rig).result()
""",
            signals=(name,),
        )
        for name in ("SIGINT", "SIGTERM")
    ),
    *(
        Way(
            name=f"{name}-once-the-main-thread-is-over",
            words=SIGNALS,
            code="rig = on()\nthreading.Thread(target=drive_on, args=(rig,)).start()\n",
            signals=(name,),
        )
        for name in ("SIGINT", "SIGTERM")
    ),
    *(
        Way(
            name=f"{name}-while-it-closes",
            words=SIGNALS,
            code=f"""\
with on() as rig:
    slow_to_close(rig, lambda: os.kill(os.getpid(), signal.{name}))
    ends()
""",
        )
        for name in ("SIGINT", "SIGTERM")
    ),
    Way(
        name="SIGTERM-with-two-rigs",
        words=SIGNALS,
        code="first = touchbeam.open_rig()\nrig = on()\nfirst.close()\ndrive_on(rig)\n",
        signals=("SIGTERM",),
    ),
    *(
        killed(
            f"{name}-in-a-thread-alone",
            UNSEEN,
            "threading.Thread(target=lambda: drive_on(on())).start()\n",
            name,
        )
        for name in ("SIGTERM", "SIGHUP")
    ),
    killed("SIGTERM-in-a-pool-alone", UNSEEN, """\
with ThreadPoolExecutor() as pool:
    pool.submit(lambda: drive_on(on())).result()
""", "SIGTERM"),
    killed("SIGKILL", CRASHED, "drive_on(on())\n", "SIGKILL"),
    killed("SIGUSR1", CRASHED, "drive_on(on())\n", "SIGUSR1"),
    killed("SIGSEGV", CRASHED, "drive_on(on())\n", "SIGSEGV"),
    killed("os._exit", CRASHED, "rig = on()\nends()\nos._exit(0)\n"),
    killed("exec", CRASHED, """\
rig = on()
ends()
os.execv(sys.executable, [sys.executable, "-c", "import time; time.sleep(2)"])
"""),
    killed("SIGSTOP", STANDS, "drive_on(on())\n", "SIGSTOP", stays=True),
    killed("SIGTSTP", STANDS, "drive_on(on())\n", "SIGTSTP", stays=True),
    killed("C-call", STANDS, """\
import ctypes

rig = on()
ends()
ctypes.PyDLL(None).sleep(3)
""", stays=True),
    Way(
        name="hangs",
        words="the program hangs otherwise, or calls none of the rig's methods for too long",
        code="rig = on()\nends()\ntime.sleep(60)\n",
        board=WATCHDOG,
        stays=True,
    ),
]  # fmt: skip
# No program can show these.
NOT_TRIED = (
    "the computer, its power or the cable fails; program and guardian are killed together",
)


@pytest.fixture(scope="module", params=["board", "keysight"])
def simulator(request: pytest.FixtureRequest) -> Iterator[tuple[str, Endpoints]]:
    wire = "pty" if request.param == "board" else "tcp"
    with simulator_process(
        TOUCHBEAM, seed=1, dialect=request.param, wire=wire, keep=True
    ) as endpoints:
        yield request.param, endpoints


@pytest.fixture(scope="module")
def folder(simulator: tuple[str, Endpoints], tmp_path_factory: pytest.TempPathFactory) -> Path:
    dialect, _ = simulator
    folder = tmp_path_factory.mktemp("study")
    more = f'[rig]\ndialect = "{dialect}"\namplifier_gain = 20\ngenerator_max_vpp = 20\n'
    (folder / "study.toml").write_text(template("paper").replace("[rig]\n", more))
    (folder / "calibration.json").write_text(
        json.dumps({"frequency_hz": 24_221.0, "tip_m_per_v": 9.0e-9})
    )
    return folder


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.name)
def test_a_program_that_ends_has_its_output_turned_off(
    simulator: tuple[str, Endpoints], folder: Path, way: Way
) -> None:
    dialect, endpoints = simulator
    command = [sys.executable, "-c", PROGRAM + way.code, endpoints.url, str(folder)]
    with (
        ControlClient(endpoints.control) as control,
        subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            process_group=0,  # as a shell does: SIGTSTP does not stop an orphaned group
        ) as process,
    ):
        control.reset()
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            assert line.startswith("ends"), process.communicate()
            ended_s = float(line.split()[1])
            for name in way.signals:
                assert control.state()["output"] is True
                ended_s = time.monotonic()
                os.kill(process.pid, getattr(signal, name))
            assert until(lambda: control.state()["output"] is False, within_s=3)
            off_s, state = time.monotonic() - ended_s, control.state()
            assert state["voltage_v"] == 0
            assert off_s <= OFF_WITHIN_S
            if dialect == "board":
                assert state["tripped"] is (way.board == WATCHDOG)
            if not way.stays:
                _, said = process.communicate(timeout=15)
                assert "UNKNOWN" not in said
                assert "hangs" not in said
        finally:
            process.kill()


def table() -> str:
    """Return the table of the page."""
    lines = ["| how the program ends | a board | a generator |", "|---|---|---|"]
    for words in dict.fromkeys(way.words for way in WAYS):
        way = next(way for way in WAYS if way.words == words)
        lines.append(f"| {words} | {way.board} | {way.generator} |")
    lines += [f"| {words} | {WATCHDOG} | {NOBODY} |" for words in NOT_TRIED]
    return "\n".join(lines)


def test_the_page_promises_what_the_table_shows() -> None:
    assert table() in PAGE.read_text(encoding="utf-8")


if __name__ == "__main__":
    print(table())
