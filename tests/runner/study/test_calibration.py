"""The kept calibration: a sweep's resonance and a fitted rig in one file, and who names them."""

import json
from pathlib import Path
from typing import Any

import pytest

from device.friction.calibration import NOMINAL
from device.resonance import Resonance
from protocol.errors import BadInput
from protocol.journal.events import ResonanceMeasured
from protocol.study_file.loading import parsed_study, template
from runner.study.calibration import (
    FILE,
    fitted_calibration,
    keep_calibration,
    keep_fit,
    kept_calibration,
)
from tests.runner.command_line import assert_matches, typed

STUDY = parsed_study(template("paper"))
FOUND = Resonance(frequency_hz=24_150.0, tip_m_per_v=1e-8)
SLID = ResonanceMeasured(frequency_hz=24_140.0, tip_m_per_v=2e-8)
WHEN = "2026-11-22T10:00:00+00:00"


def known(value: float) -> dict[str, float]:
    return {"value": value, "low": 0.9 * value, "high": 1.1 * value}


FITTED: dict[str, Any] = {
    "session": "slide/1",
    "data_sha256": "0" * 64,
    "damping_ratio": known(0.0042),
    "gain": known(1.05),
    "resonance_hz": known(24_163.0),
    "patch_centre_m": known(0.0857),
    "friction_coefficient": known(0.31),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "study.toml").write_text(template("paper"), encoding="utf-8")
    return tmp_path


def test_without_a_file_the_papers_rig_is_taken(folder: Path) -> None:
    assert fitted_calibration(folder, STUDY) == NOMINAL
    keep_calibration(folder, FOUND, "BOARD", WHEN)
    assert fitted_calibration(folder, STUDY) == NOMINAL


def test_a_fitted_rig_is_read_back_with_its_session_and_digest(folder: Path) -> None:
    keep_fit(folder, SLID, "BOARD", FITTED)
    found = fitted_calibration(folder, STUDY)
    assert (found.damping_ratio, found.gain, found.resonance_hz) == (0.0042, 1.05, 24_163.0)
    assert found.body_height_m == NOMINAL.body_height_m
    assert_matches(r"^session slide/1, calibration SHA-256 [0-9a-f]{12}$", found.origin)
    keep_fit(folder, SLID, "BOARD", {**FITTED, "gain": known(1.06)})
    assert fitted_calibration(folder, STUDY).origin != found.origin


def test_sweep_and_fit_each_keep_what_the_other_stored(folder: Path) -> None:
    keep_fit(folder, SLID, "BOARD", FITTED)
    assert kept_calibration(folder) == Resonance(frequency_hz=24_140.0, tip_m_per_v=2e-8)
    keep_calibration(folder, FOUND, "BOARD", WHEN)
    assert kept_calibration(folder) == FOUND
    assert fitted_calibration(folder, STUDY).gain == 1.05
    keep_fit(folder, SLID, "BOARD", {**FITTED, "gain": known(0.97)})
    assert kept_calibration(folder) == FOUND
    assert fitted_calibration(folder, STUDY).gain == 0.97


def test_a_rehearsal_is_named_as_one(folder: Path) -> None:
    keep_fit(folder, SLID, "BOARD", {**FITTED, "rehearsal": True})
    assert fitted_calibration(folder, STUDY).origin.startswith("session slide/1, a rehearsal, ")


def test_a_rehearsal_replaces_no_fit_of_a_rig(folder: Path) -> None:
    keep_fit(folder, SLID, "BOARD", FITTED)
    before = (folder / FILE).read_bytes()
    with pytest.raises(BadInput, match="the fit of session slide/1 is not replaced by a rehearsal"):
        keep_fit(folder, SLID, "SIM", {**FITTED, "rehearsal": True})
    assert (folder / FILE).read_bytes() == before


def test_the_resonance_of_a_rehearsal_gives_way_to_that_of_a_rig(folder: Path) -> None:
    rehearsed = ResonanceMeasured(frequency_hz=24_000.0, tip_m_per_v=1e-8)
    keep_fit(folder, rehearsed, "SIM", {**FITTED, "rehearsal": True})
    keep_fit(folder, SLID, "BOARD", FITTED)
    assert kept_calibration(folder) == Resonance(frequency_hz=24_140.0, tip_m_per_v=2e-8)
    assert json.loads((folder / FILE).read_text())["idn"] == "BOARD"


def test_a_damaged_file_is_replaced(folder: Path) -> None:
    (folder / FILE).write_text("{")
    keep_calibration(folder, FOUND, "BOARD", WHEN)
    assert kept_calibration(folder) == FOUND


def test_a_rehearsal_replaces_no_damaged_file(folder: Path) -> None:
    (folder / FILE).write_text('{"fitted": {"session": "slide/1",')
    with pytest.raises(BadInput, match=r"calibration.json: not a calibration .*; measure it again"):
        keep_fit(folder, SLID, "SIM", {**FITTED, "rehearsal": True})
    assert (folder / FILE).read_text() == '{"fitted": {"session": "slide/1",'
    keep_fit(folder, SLID, "BOARD", FITTED)
    assert fitted_calibration(folder, STUDY).gain == 1.05


def test_a_fit_needs_a_study(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match=r"no study here \(study\.toml is missing\)"):
        keep_fit(tmp_path, SLID, "BOARD", FITTED)


@pytest.mark.parametrize(
    ("fitted", "message"),
    [
        ({"damping_ratio": known(0.005)}, r"not a calibration \(fitted is not what a slide"),
        (
            {**FITTED, "gain": {"value": "1.05 V"}},
            r"fitted.gain.value must be a finite number, got '1.05",
        ),
        ({**FITTED, "gain": [1.05]}, r"fitted.gain.value must be a finite number, got \[1.05\]"),
        ({**FITTED, "gain": known(-1.0)}, r"fitted: gain must be a finite number above 0, got -1"),
        (
            {**FITTED, "damping_ratio": {"value": "high"}},
            r"damping_ratio.value must be a .* got 'high'\)",
        ),
        ([], r"not a calibration \(fitted is not what"),
    ],
)
def test_a_damaged_fit_is_refused(folder: Path, fitted: object, message: str) -> None:
    (folder / FILE).write_text(json.dumps({"fitted": fitted}))
    with pytest.raises(BadInput, match=message):
        fitted_calibration(folder, STUDY)


def test_check_uses_and_names_the_calibration(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("check", folder, "--json") == 0
    before = json.loads(capsys.readouterr().out)
    keep_fit(folder, SLID, "BOARD", FITTED)
    assert typed("check", folder, "--json") == 0
    after = json.loads(capsys.readouterr().out)
    assert "contrast_rig" not in before
    assert_matches("damping ratio 0.0042, gain 1.05, .*session slide/1", after["contrast_rig"])
    trials = [found["participants"][0]["trials"][1] for found in (before, after)]
    assert trials[0]["predicted_contrast"] != trials[1]["predicted_contrast"]
    assert typed("check", folder) == 0
    assert_matches(r"Rig: damping ratio 0\.0042, gain 1\.05", capsys.readouterr().out)


def test_predict_uses_and_names_the_calibration(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenes, out = folder / "scenes.csv", folder / "out.csv"
    scenes.write_text("frequency_hz\n24163\nresonance\n")
    keep_fit(folder, SLID, "BOARD", FITTED)
    assert typed("predict", scenes, "-o", out, "--study", folder) == 0
    assert_matches(
        r"2 scenes predicted on the rig with damping ratio 0\.0042, gain 1\.05, bodies 1 mm high, "
        r"resonance 24163 Hz \(session slide/1, calibration SHA-256 [0-9a-f]{12}\): ",
        " ".join(capsys.readouterr().out.split()),
    )
    header, driven, resonant = (row.split(",") for row in out.read_text().splitlines())
    mu, damping = header.index("mu_effective"), header.index("damping_ratio")
    # A drive at the rig's own resonance is a drive at the model's.
    assert float(driven[mu]) == pytest.approx(float(resonant[mu]), abs=0.01)
    assert driven[damping] == "0.0042"
    assert driven[header.index("frequency_hz")] == "24163"
