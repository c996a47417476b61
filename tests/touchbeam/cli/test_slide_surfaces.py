"""`touchbeam slide` on a beam of the study's own, on a table and without a model; its table."""

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest

from device.friction.surfaces import MeasuredSurface, beam_surface
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from protocol.study_file.loading import template
from runner.study.calibration import fitted_calibration
from runner.study.folder import StudyFolder
from tests.runner.command_line import everything, typed
from tests.touchbeam.cli.test_model import BAR

FEW = """[slide]
frequencies = [0.99, 1.0]
frequencies_hz = []
references = 1
speeds_m_s = [0.02]

"""
TWO_WAYS = FEW.replace("[slide]", '[slide]\ndirections = ["right", "left"]')
OPENING = template("paper").split("[[condition]]", 1)[0]
"""The template without its conditions, which a table at 0 and 100 V cannot hold."""
DIRECTION = """[[condition]]
name = "direction"
question = "places"
expected = "swapped"
touches = [
  { place = "path", voltage_v = 100, direction = "right" },
  { place = "path", voltage_v = 100, direction = "left" },
]
"""


def study_with(folder: Path, before_touch: str, text: str = OPENING + DIRECTION) -> Path:
    folder.mkdir(exist_ok=True)
    text = text.replace("[touch]", f"{before_touch}[touch]", 1)
    text = text.replace("path_m = [0.010, 0.081]", "path_m = [0.015, 0.075]")
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.usefixtures("figures_as_svg")
def test_damping_of_another_beam_is_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = study_with(tmp_path / "bar", BAR.removesuffix("[touch]"))
    assert typed("slide", study, "--device", "sim", "--json", "--calibrate") == 0
    found = json.loads(capsys.readouterr().out)
    file = StudyFolder(path=study).study()
    surface = beam_surface(file.surface)
    hidden = SimulatedBeam(
        file.study.seed, surface=surface, nominal_hz=file.rig.nominal_resonance_hz
    )
    true = {
        "damping_ratio": hidden.beam.damping_ratio,
        "resonance_hz": hidden.resonance_hz,
        "gain": hidden.gain,
        "body_height_m": 1e-3,
        "patch_centre_m": 0.032,
    }
    assert true["damping_ratio"] != pytest.approx(0.005, rel=0.02), "nor the assumed one"
    for name, value in true.items():
        low, high = found["fit"][name]["ci"]
        assert low < value < high, name
    best = min(found["models"], key=lambda one: one["rmse"])
    assert (best["law"], best["rung"], best["fitted"]) == ("consistent", "beam", True)
    assert "eq15" not in {one["rung"] for one in found["models"]}
    drives = {one["drive"] for one in found["passes"]}
    assert "23200 Hz" not in drives, "which is the paper's"
    places_m = found["mu"]["x_m"]
    assert (min(places_m), max(places_m)) == pytest.approx((0.015, 0.075), abs=2e-3)
    kept = fitted_calibration(study, file)
    assert kept.surface == surface
    assert kept.damping_ratio == found["fit"]["damping_ratio"]["value"]
    study_with(study, BAR.removesuffix("[touch]").replace("0.003", "0.004"))
    assert typed("check", study) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "fitted is of another beam than [surface] describes; move the file away" in line


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study whose beam was drawn over both ways at two frequencies."""
    folder = tmp_path_factory.mktemp("measured") / "study"
    study = study_with(folder, TWO_WAYS)
    assert typed("slide", study, "--device", "sim", "--json") == 0
    return study


@pytest.mark.usefixtures("figures_as_svg")
def test_the_table_is_what_was_measured_and_a_study_predicts_it(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "own"
    own.mkdir()
    assert typed("slide", measured, "--analyse", "--table", own / "friction.csv") == 0
    assert "rows of friction, from a rehearsal, at " in capsys.readouterr().out
    assert typed("slide", measured, "--analyse", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    written = (own / "friction.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(written.splitlines()))
    assert {row["frequency"] for row in rows} == {"0.99", "1"}
    assert {row["direction"] for row in rows} == {"left", "right"}

    surface = '[surface]\nkind = "measured"\nlength_m = 0.1\ntable = "friction.csv"\n\n'
    study_with(own, surface)
    assert typed("check", own, "--json") == 0
    shown = json.loads(capsys.readouterr().out)
    rig = fitted_calibration(own, StudyFolder(path=own).study())
    assert isinstance(rig.surface, MeasuredSurface)
    table = rig.surface.table
    assert table.resonance_hz == pytest.approx(record["setting"]["frequency_hz"])
    for curve in record["curves"]:
        setting, x_m = curve["setting"], np.array(curve["x_m"])
        inside = (x_m > 0.012) & (x_m < 0.079)
        predicted = table.friction(
            {
                "voltage_v": np.array(setting["voltage_v"]),
                "frequency": np.array(
                    round(setting["frequency_hz"] / record["setting"]["frequency_hz"], 4)
                ),
                "place_m": x_m[inside],
                "direction": setting["direction"],
            }
        )
        # The table has the middles of bins, between which it is interpolated.
        error = np.log(predicted / np.array(curve["mu"])[inside])
        assert np.sqrt(np.mean(error**2)) < 0.01
    # What is asked about directions is the difference of the two curves.
    (contrast,) = {
        trial["predicted_contrast"]
        for one in shown["participants"]
        for trial in one["trials"]
        if trial["condition"] == "direction" and trial["kind"] == "trial"
    }
    places_m = np.linspace(0.015, 0.075, 143)
    at = {"voltage_v": np.array(100.0), "frequency": np.array(1.0), "place_m": places_m}
    right, left = (table.friction(at | {"direction": way}) for way in ("right", "left"))
    due = math.sqrt(np.mean(np.log(left / right) ** 2))
    assert contrast == pytest.approx(due, rel=1e-3)
    assert due > 0.05


@pytest.mark.usefixtures("figures_as_svg")
def test_a_table_that_lacks_a_pass_is_one_clear_error(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = ("--participant", "slide", "--trial", "1", "--reason", "the block tilted")
    assert typed("exclude", measured, *one) == 0
    capsys.readouterr()
    assert typed("slide", measured, "--analyse", "--table", tmp_path / "t.csv") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no pass counts with" in line
    assert "the table needs all of [slide]" in line
    assert everything(tmp_path) == set()
    assert typed("include", measured, *one) == 0
    assert typed("slide", measured, "--analyse", "--table", tmp_path / "t.toml") == 2
    assert "--table must end in .csv" in capsys.readouterr().err


@pytest.mark.usefixtures("figures_as_svg")
def test_on_a_table_the_resonance_alone_is_calibrated(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "own"
    own.mkdir()
    assert typed("slide", measured, "--analyse", "--table", own / "friction.csv") == 0
    surface = '[surface]\nkind = "measured"\nlength_m = 0.1\ntable = "friction.csv"\n\n'
    study_with(own, FEW + surface)
    capsys.readouterr()
    assert typed("slide", own, "--device", "sim", "--calibrate", "--table", own / "again.csv") == 0
    said = capsys.readouterr().out
    assert "Friction on this surface comes from a table: only the resonance is calibrated." in said
    kept = json.loads((own / "calibration.json").read_text(encoding="utf-8"))["fitted"]
    assert kept.keys() == {"session", "data_sha256", "resonance_hz", "rehearsal"}
    rig = fitted_calibration(own, StudyFolder(path=own).study())
    assert rig.resonance_hz == kept["resonance_hz"]["value"]
    page = (own / "slide" / "slide.html").read_text(encoding="utf-8")
    assert "Laws and rungs" not in page
    assert len((own / "again.csv").read_text(encoding="utf-8").splitlines()) > 300


@pytest.mark.usefixtures("figures_as_svg")
def test_without_a_model_nothing_is_fitted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = FEW + '[surface]\nkind = "given"\nlength_m = 0.12\n\n'
    study = study_with(tmp_path / "plate", given)
    before = everything(study)
    assert typed("slide", study, "--device", "sim", "--calibrate") == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--calibrate keeps nothing of a surface of kind given" in line
    assert everything(study) == before
    assert typed("slide", study, "--device", "sim") == 0
    said = capsys.readouterr().out
    assert "No model predicts friction on this surface: nothing is fitted or calibrated." in said
    assert "property" not in said
    record = json.loads((study / "slide" / "slide.json").read_text(encoding="utf-8"))
    assert set(record["fit"]["damping_ratio"]) == {"reason"}
    assert record["models"] == record["troughs"] == []
    assert len(record["curves"]) == 3
