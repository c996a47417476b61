"""Long runs: thousands of simulated studies, skipped unless they are asked for."""

import os

# As the commands that compute: one thread is faster for small matrices, and sums in one order.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


import shutil
from collections.abc import Iterator

import pytest
from hypothesis import settings

from tests.runner.window.person import virtual_display

# No test is timed: a loaded machine says nothing about the program.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

REASON = "takes minutes; run it with `make soak`"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
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
