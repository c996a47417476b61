"""Processes that begin with what takes long to load, and have nothing of the project in memory."""

import os
import signal
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

# What takes long to load and has nothing of ours. Each process has it from its beginning.
import hypothesis  # noqa: F401
import numpy as np  # noqa: F401
import pydantic  # noqa: F401
import pytest  # noqa: F401
import scipy.optimize
import scipy.stats  # noqa: F401

KEPT = Path(__file__).parents[2] / ".mutants"
"""Where results are kept, so that a run goes on where it was stopped."""
OUTPUT = KEPT / "output.txt"
"""What the last process wrote."""


def exit_code(work: Callable[[], int], within_s: float) -> int:
    """Return what `work` returns in a process of its own; below 0 if it is ended, by time as well.

    What it may have left behind in its process group is ended.
    """
    KEPT.mkdir(exist_ok=True)
    if (process := os.fork()) == 0:
        _do(work)
    end_s = time.monotonic() + within_s
    done, status = 0, 0
    while not done and time.monotonic() < end_s:
        done, status = os.waitpid(process, os.WNOHANG)
        time.sleep(0.0 if done else 0.01)
    with suppress(ProcessLookupError):
        os.killpg(process, signal.SIGKILL)
    if not done:
        _, status = os.waitpid(process, 0)
    code = os.waitstatus_to_exitcode(status)
    if code == -signal.SIGTERM:
        raise SystemExit("ended from outside: nothing is known of what was tried last")
    return code


def _do(work: Callable[[], int]) -> None:
    code = 1
    try:
        os.setsid()
        with OUTPUT.open("w") as output:
            os.dup2(output.fileno(), 1)
            os.dup2(output.fileno(), 2)
        code = work()
    finally:
        os._exit(code)
