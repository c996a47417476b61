"""Virtual displays, one of each size for all tests."""

import shutil
from collections.abc import Iterator

import pytest

from tests.runner.window.person import virtual_display


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
