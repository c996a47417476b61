"""Claims about the vibration: what a change of frequency does to the mode."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.claims import vibration
from device.beam.beam import Beam
from device.friction.rungs import TOP_RUNG, rung_resonance_hz
from device.friction.scenes import Drive
from tests.analysis.claims.conftest import Find


def test_the_mode_changes_between_resonances_but_not_near_one(find: Find) -> None:
    found = find("frequency-changes-mode")
    assert found.scope == (False, True)
    zones = [found.computed[f"zones_of_mode_{mode}"] for mode in (5, 6, 7)]
    assert zones == [9, 11, 13]  # mode i has 2i - 1 zones: i - 1 nodes and i - 1 inner antinodes
    assert found.computed["zones_at_0.9_of_resonance"] == 11
    assert found.computed["zones_at_1.1_of_resonance"] == 11
    assert 1e-4 < found.computed["largest_shift_within_2_percent_m"] < 2e-3


@pytest.mark.parametrize(
    ("zones_off_resonance", "zones_of_mode_7", "verdict"),
    [(12, 13, "holds"), (11, 13, "partly"), (11, 11, "fails")],
)
def test_the_verdict_moves_with_the_number_of_zones(
    find: Find,
    monkeypatch: pytest.MonkeyPatch,
    zones_off_resonance: int,
    zones_of_mode_7: int,
    verdict: str,
) -> None:
    resonance_hz = rung_resonance_hz(TOP_RUNG, Beam(), 6)

    def field(_: str, __: Beam, drive: Drive) -> Any:
        off = drive.frequency_hz not in ("resonance", resonance_hz)
        count = {5: 9, 6: zones_off_resonance if off else 11, 7: zones_of_mode_7}[drive.mode]
        edges_m = np.linspace(0, 0.1, count + 1)
        return SimpleNamespace(pattern=SimpleNamespace(edges_m=edges_m))

    monkeypatch.setattr(vibration, "rung_field", field)
    monkeypatch.setattr(vibration, "MotionPattern", SimpleNamespace)
    assert find("frequency-changes-mode").verdict == verdict
