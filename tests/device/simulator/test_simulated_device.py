"""The simulated device as a whole: a dialect that it speaks is a file among the models."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from device.simulator import models
from device.simulator.device import SimulatedDevice, dialects

NEXT_MODEL = """
from device.simulator.models.board_model import BoardDialect

class NextDialect(BoardDialect):
    idn = "NEXT,1"

MODELS = {"next": NextDialect}
"""


@pytest.fixture
def next_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A dialect whose model a new file brings."""
    (tmp_path / "next_model.py").write_text(NEXT_MODEL)
    monkeypatch.setattr(models, "__path__", [*models.__path__, str(tmp_path)])
    dialects.cache_clear()
    yield "next"
    dialects.cache_clear()
    sys.modules.pop("device.simulator.models.next_model", None)


def test_the_next_simulated_dialect_is_one_new_file(next_model: str) -> None:
    device = SimulatedDevice(seed=1, wall_s=lambda: 0.0, dialect=next_model)
    assert device.answer("*IDN?", wall_s=0.0) == "NEXT,1"
    known = ["board", "keysight", "keysight-33220A", "rigol", "rigol-DG1062Z", "siglent"]
    assert sorted(dialects()) == sorted([*known, "next"])
