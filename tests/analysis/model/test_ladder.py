"""The ladder: its table, its picture, and its timing."""

from dataclasses import asdict

import pytest

from analysis.model import ladder
from analysis.model.ladder import LadderRow, ladder_lines, ladder_panel
from analysis.report.drawing import panels_files


def test_the_ladder_is_written_and_drawn() -> None:
    rows = tuple(
        LadderRow(
            rung=name,
            setup_us=t,
            setup_us_range=(t - 1, 2 * t),
            us_per_1000=80.0,
            us_per_1000_range=(79.0, 90.0),
            max_error=e,
            rms_error=e / 2,
            resonance_hz=2e4,
        )
        for name, t, e in (("mode", 9.0, 0.04), ("timoshenko-patched", 5e3, 0.0))
    )
    assert asdict(rows[0])["max_error"] == 0.04
    assert ladder_lines(rows)[1] == [
        "mode",
        "9 (8 to 18)",
        "80 (79 to 90)",
        "0.040",
        "0.0200",
        "20000.0",
    ]
    assert asdict(rows[0])["setup_us_range"] == (8.0, 18.0)
    drawings = panels_files([ladder_panel(rows)], ["svg", "png"])
    assert drawings["svg"].startswith(b"<svg")
    assert drawings["png"].startswith(b"\x89PNG")
    assert drawings == panels_files([ladder_panel(rows)], ["svg", "png"])


def test_the_ladder_times_its_rungs_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pause of the computer in one round changes no median."""
    clock = iter(float(k) for k in range(10_000))
    readings = iter(range(10_000))
    late = 0.0

    def now() -> float:
        nonlocal late
        late += 1e3 if 100 <= next(readings) < 110 else 0.0
        return next(clock) + late

    monkeypatch.setattr(ladder, "perf_counter", now)
    for row in ladder.measured_ladder():
        assert row.setup_us == row.us_per_1000 == 1e6
        assert row.setup_us_range[0] == 1e6
