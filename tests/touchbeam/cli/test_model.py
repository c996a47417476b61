"""`touchbeam predict` and `touchbeam ladder`: rungs, tolerances, JSON and exit codes."""

import csv
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import touchbeam
from analysis.model import ladder
from device.friction.fineness import TOLERANCES
from protocol.study_file.loading import template
from tests.protocol.surfaces import ALUMINIUM
from tests.runner.command_line import typed


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    path = tmp_path / "scenes.csv"
    path.write_text("x_m\n0.03\n0.05\n")
    return path


def _predicted(scenes: Path, *options: str) -> list[dict[str, str]]:
    out = scenes.with_name("out.csv")
    assert typed("predict", scenes, "-o", out, *options) == 0
    with out.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("options", "rung", "bound"),
    [
        ((), "beam", "1e-06"),
        (("--tolerance", "1e-4"), "beam", "0.0001"),
        (("--rung", "auto", "--tolerance", "0.02"), "beam", "0.02"),
        (("--rung", "timoshenko-patched"), "beam", "1e-06"),
        (("--rung", "timoshenko-modes"), "beam", "1e-06"),
        (("--rung", "own-mode"), "own-mode", ""),
        (("--rung", "mode", "--tolerance", "1e-4"), "mode", ""),
        (("--rung", "eq15"), "eq15", ""),
    ],
)
def test_the_rung_and_its_error_bound_are_told(
    scenes: Path, options: tuple[str, ...], rung: str, bound: str
) -> None:
    rows = _predicted(scenes, *options)
    assert [(row["rung"], row["error_bound"]) for row in rows] == [(rung, bound)] * 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            ("--rung", "timoshenko"),
            "one of eq15, mode, own-mode, beam; take beam, got 'timoshenko'",
        ),
        (("--rung", "far-field"), "own-mode, beam; take mode, got 'far-field'"),
        (("--rung", "modes:12"), "own-mode, beam; take beam, got 'modes:12'"),
        (("--rung", "best"), "rung must be one of eq15, mode, own-mode, beam, got 'best'"),
        (("--tolerance", "1e-9"), "tolerance must be at least 1e-08, got 1e-09"),
    ],
)
def test_what_there_is_not_is_refused_with_one_line(
    scenes: Path,
    options: tuple[str, ...],
    message: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = scenes.with_name("out.csv")
    assert typed("predict", scenes, "-o", out, *options) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not out.exists()


def test_friction_in_python_is_what_the_command_predicts(scenes: Path) -> None:
    for rung in ("beam", "own-mode"):
        due = [float(row["mu_effective"]) for row in _predicted(scenes, "--rung", rung)]
        assert touchbeam.friction(x_m=[0.03, 0.05], rung=rung).tolist() == due
    assert touchbeam.friction(rung="auto") == touchbeam.friction(rung="timoshenko-patched")
    apart = touchbeam.friction(x_m=0.05, tolerance=1e-3) - touchbeam.friction(x_m=0.05)
    assert 0 < abs(apart) < 1e-3


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ladder, "_ROUNDS", 1)


@pytest.mark.usefixtures("quick")
def test_the_ladder_as_json_has_the_rungs_and_the_tolerances_of_the_beam(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert typed("ladder", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["tolerance"] for row in rows] == [None, None, None, *TOLERANCES]
    assert [row["rung"] for row in rows[:4]] == ["eq15", "mode", "own-mode", "beam"]
    for row in rows:
        numbers = [row[name] for name in ("setup_us", "us_per_1000", "max_error", "rms_error")]
        assert np.isfinite(numbers).all()
        assert row["resonance_hz"] == pytest.approx(22e3, rel=0.1)


@pytest.mark.usefixtures("quick")
def test_the_ladder_as_a_table_and_a_plot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plot = tmp_path / "ladder.svg"
    assert typed("ladder", "--plot", plot) == 0
    cells = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[1] for row in cells if row[:1] == ["beam"]] == [f"{of:g}" for of in TOLERANCES]
    assert "beam 1e-07" in plot.read_text(encoding="utf-8")
    assert typed("ladder", "--plot", tmp_path / "ladder.gif") == 2


BAR = ALUMINIUM.replace("centre_m = 0.072", "centre_m = 0.032") + "\n[touch]"


@pytest.mark.usefixtures("quick")
def test_the_ladder_of_a_study_is_that_of_its_beam(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = template("paper").replace("[touch]", BAR, 1)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert typed("ladder", tmp_path, "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["rung"] for row in rows[:3]] == ["mode", "own-mode", "beam"]
    assert {(row["length_m"], row["mode"]) for row in rows} == {(0.12, 6)}
    assert rows[-1]["resonance_hz"] == pytest.approx(19_421, abs=1)
    assert 1e-3 < rows[0]["max_error"] < 0.1
    for row in rows[2:]:
        assert row["max_error"] <= row["tolerance"]
    assert typed("ladder", tmp_path) == 0
    said = capsys.readouterr().out.splitlines()
    assert "The beam: 120 mm, clamped at both ends, mode 6 at 19421 Hz" in " ".join(said)
    (refused,) = (line for line in said if line.startswith("Not on this beam: "))
    assert "on the rung eq15" in refused


def test_there_is_no_ladder_without_a_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = template("paper").replace(
        "[touch]", '[surface]\nkind = "given"\nlength_m = 0.1\n[touch]'
    )
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert typed("ladder", tmp_path) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "has kind given: no model predicts its friction" in line


def test_what_no_model_predicts_is_told_to_each_in_its_own_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, scenes = tmp_path / "plate", tmp_path / "scenes.csv"
    assert typed("new", study, "--template", "plate") == 0
    assert typed("run", study, "--participant", "P01", "--ratings", "virtual") == 0
    scenes.write_text("voltage_v\n50\n", encoding="utf-8")
    capsys.readouterr()
    assert typed("predict", scenes, "--study", study, "-o", tmp_path / "out.csv") == 2
    told = "has kind given: no model predicts its friction; "
    assert f"{told}leave --study out for the paper's beam" in capsys.readouterr().err
    loaded = touchbeam.load(study, rehearsals=True)
    with pytest.raises(ValueError, match=f"{told}touchbeam.predict takes the paper's beam"):
        loaded.predict(pd.DataFrame({"voltage_v": [50.0]}))
