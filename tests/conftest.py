"""Long runs: thousands of simulated studies, skipped unless they are asked for."""

import os

# As the commands that compute: one thread is faster for small matrices, and sums in one order.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A warning of numpy is an error in the processes that tests start, too.
os.environ.setdefault("PYTHONWARNINGS", "error::RuntimeWarning")

import gc
import shutil
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from tests.runner.window.person import virtual_display

# Underflow is none of these: the likelihood far out in a tail is 0.
np.seterr(divide="raise", over="raise", invalid="raise")

# No test is timed: a loaded machine says nothing about the program.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

REASON = "takes minutes; run it with `make soak`"
_DISPLAYS = {"small_display", "large_display"}


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no file without a test of the only kind that is asked for."""
    kind = config.getoption("-m").partition(" ")[0]
    if kind not in {"soak", "waits"} or not collection_path.name.startswith("test_"):
        return None
    return f"mark.{kind}" not in collection_path.read_text(encoding="utf-8") or None


def pytest_collectstart() -> None:
    gc.disable()  # everything that collecting the tests makes is kept to the end


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    gc.freeze()
    # As the commands do: looking for cycles again and again takes a fifteenth of the time.
    gc.set_threshold(20_000, 20, 20)
    gc.enable()
    # Whole sessions at a display last longest: no worker is left alone with one at the end.
    seated = {item.path for item in items if _DISPLAYS.intersection(_fixtures(item))}
    items.sort(key=lambda item: item.path not in seated)
    if "soak" in config.getoption("-m"):
        return
    for item in items:
        if item.get_closest_marker("soak"):
            item.add_marker(pytest.mark.skip(reason=REASON))


def _fixtures(item: pytest.Item) -> list[str]:
    return item.fixturenames if isinstance(item, pytest.Function) else []


def _require_tools() -> None:
    missing = [name for name in ("Xvfb", "xdotool") if shutil.which(name) is None]
    if missing:
        pytest.skip(f"no {' and no '.join(missing)} on this machine; make test installs them")


@pytest.fixture
def figures_as_svg(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write figures as SVG under all names: other bytes for another figure, and soon drawn."""
    module = import_module("analysis.report.drawing")
    svg = module._reproducible_svg
    monkeypatch.setattr(module, "_saved", lambda figure, *_: svg(figure).encode())


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
