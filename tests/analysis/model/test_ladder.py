"""The ladder: its rows, their table and their plot."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from analysis.model import ladder
from analysis.model.ladder import LadderRow, ladder_lines, ladder_panel, measured_ladder
from analysis.report.drawing import panels_files
from device.beam.beam import Beam
from device.beam.spectral import natural_frequency_hz
from device.friction.fineness import TOLERANCES
from device.friction.rungs import RUNG_NAMES
from device.friction.scenes import Scene, Structure


@pytest.fixture(scope="module")
def measured() -> tuple[LadderRow, ...]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ladder, "_ROUNDS", 2)
        return measured_ladder()


def test_there_is_a_row_for_each_rung_and_each_tolerance(measured: tuple[LadderRow, ...]) -> None:
    steps = [(row.rung, row.tolerance) for row in measured]
    assert steps == [
        ("eq15", None),
        ("mode", None),
        ("own-mode", None),
        *(("beam", tolerance) for tolerance in TOLERANCES),
    ]
    assert {rung for rung, _ in steps} == set(RUNG_NAMES)
    assert {"rung", "tolerance", "setup_us", "us_per_1000", "max_error", "rms_error"} | {
        "resonance_hz"
    } <= asdict(measured[0]).keys()


def test_a_rung_errs_by_its_model_and_a_tolerance_by_its_numbers(
    measured: tuple[LadderRow, ...],
) -> None:
    of_rung = {row.rung: row for row in measured if row.tolerance is None}
    assert of_rung["eq15"].max_error == pytest.approx(0.112, abs=1e-3)
    assert of_rung["mode"].max_error == pytest.approx(0.0397, abs=1e-3)
    assert of_rung["own-mode"].max_error == pytest.approx(1.6e-4, abs=1e-5)
    for row in measured:
        assert row.rms_error <= row.max_error
        if row.tolerance is not None:
            assert row.max_error <= row.tolerance
            assert (row.max_error > 0) == (row.tolerance != TOLERANCES[-1])


def test_the_resonance_is_the_rungs_own(measured: tuple[LadderRow, ...]) -> None:
    own = {row.rung: round(row.resonance_hz, 1) for row in measured}
    assert own == {"eq15": 24105.1, "mode": 24105.1, "own-mode": 21624.8, "beam": 21624.8}


def test_another_scene_has_a_ladder_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ladder, "_ROUNDS", 1)
    beam = replace(Beam(), thickness_m=4e-3)
    rows = measured_ladder(Scene(structure=Structure(beam=beam)))
    assert rows[-1].resonance_hz == natural_frequency_hz(beam, 6) < 20e3


def test_the_steps_are_timed_in_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pause of the computer in one round changes no median."""
    clock = iter(float(k) for k in range(10_000))
    readings = iter(range(10_000))
    late = 0.0

    def now() -> float:
        nonlocal late
        late += 1e3 if 80 <= next(readings) < 90 else 0.0
        return next(clock) + late

    monkeypatch.setattr(ladder, "_ROUNDS", 3)
    monkeypatch.setattr(ladder, "perf_counter", now)
    rows = measured_ladder()
    assert any(row.setup_us_range[1] > 1e6 for row in rows)
    for row in rows:
        assert row.setup_us == row.us_per_1000 == 1e6
        assert row.setup_us_range[0] == 1e6


def test_each_round_sets_the_beam_up_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    beams = []

    def seen(name: str, beam: Beam, *others: object) -> None:
        beams.append(beam)

    monkeypatch.setattr(ladder, "_ROUNDS", 3)
    monkeypatch.setattr(ladder, "rung_field", seen)
    measured_ladder()
    assert len(set(beams)) == len(beams) == 4 * len(ladder.STEPS)


def _row(rung: str, tolerance: float | None, setup_us: float, error: float) -> LadderRow:
    return LadderRow(
        rung=rung,
        tolerance=tolerance,
        setup_us=setup_us,
        setup_us_range=(setup_us - 1, 2 * setup_us),
        us_per_1000=80.0,
        us_per_1000_range=(79.0, 90.0),
        max_error=error,
        rms_error=error / 2,
        resonance_hz=2e4,
    )


def test_the_ladder_is_written_and_drawn() -> None:
    of_beam = _row("beam", 1e-6, 5e3, 2e-11), _row("beam", TOLERANCES[-1], 7e3, 0.0)
    rows = (_row("mode", None, 9.0, 0.04), *of_beam)
    assert ladder_lines(rows)[1:] == [
        ["mode", "", "9 (8 to 18)", "80 (79 to 90)", "0.04", "0.02", "20000.0"],
        ["beam", "1e-06", "5000 (4999 to 10000)", "80 (79 to 90)", "2e-11", "1e-11", "20000.0"],
        ["beam", "1e-08", "7000 (6999 to 14000)", "80 (79 to 90)", "", "", "20000.0"],
    ]
    (points,) = ladder_panel(rows).series
    assert points.names == ["mode", "beam 1e-06"]
    assert np.array_equal(points.x, [89.0, 5080.0])
    drawings = panels_files([ladder_panel(rows)], ["svg", "png"])
    assert drawings["svg"].startswith(b"<svg")
    assert drawings["png"].startswith(b"\x89PNG")
    assert drawings == panels_files([ladder_panel(rows)], ["svg", "png"])
