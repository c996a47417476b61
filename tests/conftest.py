"""Long runs: thousands of simulated studies, skipped unless they are asked for."""

import os

# As the commands that compute: one thread is faster for small matrices, and sums in one order.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A warning of numpy is an error in the processes that tests start, too.
os.environ.setdefault("PYTHONWARNINGS", "error::RuntimeWarning")

import atexit
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# What commands keep goes to a folder of this run's own, which its workers share.
if "TOUCHBEAM_CACHE" not in os.environ:
    os.environ["TOUCHBEAM_CACHE"] = tempfile.mkdtemp(prefix="touchbeam-kept-")
    atexit.register(shutil.rmtree, os.environ["TOUCHBEAM_CACHE"], ignore_errors=True)

from tests.runner.window.person import virtual_display

# Underflow is none of these: the likelihood far out in a tail is 0.
np.seterr(divide="raise", over="raise", invalid="raise")

# No test is timed: a loaded machine says nothing about the program.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

REASON = "takes minutes; run it with `make soak`"
LONGEST = (
    "system/test_window_sessions.py",
    "system/test_report_sections.py",
    "handbook/test_examples.py",
    "system/test_round_trip.py",
    "system/test_terminal_output.py",
    "system/test_recorded_sessions.py",
    "system/test_slide.py",
    "system/test_power_workers.py",
    "system/test_planted.py",
    "system/day/test_day.py",
    "runner/cli/test_app.py",
    "runner/test_pytest_plugin.py",
    "system/test_window_failures.py",
    "system/test_results_on_disk.py",
    "system/test_report_in_browser.py",
    "runner/cli/test_slide.py",
    "runner/cli/test_export.py",
    "runner/cli/test_power.py",
    "analysis/export/test_rocrate.py",
    "system/test_free_study.py",
    "system/test_operator_terminal.py",
)
"""These files come first, so that no worker is left alone with one of them at the end."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    places = {Path(__file__).parent / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path, len(places)))
    if "soak" in config.getoption("-m"):
        return
    for item in items:
        if item.get_closest_marker("soak"):
            item.add_marker(pytest.mark.skip(reason=REASON))


def _require_tools() -> None:
    missing = [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"no {' and no '.join(missing)} on this machine; make test installs them")


@pytest.fixture(scope="session")
def small_display() -> Iterator[str]:
    _require_tools()
    with virtual_display(800, 600) as name:
        yield name


@pytest.fixture(scope="session")
def large_display() -> Iterator[str]:
    _require_tools()
    with virtual_display(1920, 1080) as name:
        yield name
