"""Long runs: thousands of simulated studies, skipped unless they are asked for."""

import os

# As the commands that compute: one thread is faster for small matrices, and sums in one order.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# A warning of numpy is an error in the processes that tests start, too.
os.environ.setdefault("PYTHONWARNINGS", "error::RuntimeWarning")

import atexit
import gc
import shutil
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# What commands keep goes to a folder of this run's own, which its workers share.
if "TOUCHBEAM_CACHE" not in os.environ:
    os.environ["TOUCHBEAM_CACHE"] = tempfile.mkdtemp(prefix="touchbeam-kept-")
    atexit.register(shutil.rmtree, os.environ["TOUCHBEAM_CACHE"], ignore_errors=True)

from runner.study import kept_files
from tests.runner.window.person import virtual_display

OF_THIS_RUN = Path(os.environ["TOUCHBEAM_CACHE"])


class Pooled(kept_files.KeptFiles):
    """Kept results of a study, which all studies of this run share: the same call, the same name.

    A test that looks at what is kept names a cache of its own, as a user does.
    """

    pool = kept_files.KeptFiles(OF_THIS_RUN / "pool")

    def get(self, name: str) -> bytes | None:
        return super().get(name) or (self.pool.get(name) if self._is_of_this_run else None)

    def put(self, name: str, content: bytes) -> None:
        super().put(name, content)
        if self._is_of_this_run:
            self.pool.put(name, content)

    @property
    def _is_of_this_run(self) -> bool:
        return self._folder.parent == OF_THIS_RUN


kept_files.KeptFiles = Pooled  # type: ignore[misc]

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
    """Write figures as SVG under all names: other bytes for another figure, and soon drawn.

    For what is beside them; nothing of it is kept for other tests, since a lambda has no name.
    """
    made = "analysis.report.drawing"
    files, svg = import_module(made).drawing, import_module(made)._reproducible_svg
    monkeypatch.setattr(f"{made}._saved", lambda figure, *_: svg(figure).encode())
    monkeypatch.setattr(f"{made}._files_of", lambda draw, words: files(draw, words).files())


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
