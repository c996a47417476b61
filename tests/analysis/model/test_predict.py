"""Batch prediction: what goes in comes out, and a bad cell is named."""

import csv
import io
import math
import re
from random import Random

import numpy as np
import pytest

from analysis.model.predict import (
    OUTPUTS,
    PredictOptions,
    predict,
    predicted_table,
    study_defaults,
    study_rig,
)
from analysis.model.scene_table import column_table
from device.beam.beam import Beam
from device.friction.calibration import Calibration
from device.friction.coefficient import friction_coefficient
from device.friction.laws import LAWS
from device.friction.rungs import rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene
from protocol.study_file.loading import parsed_study, template


def _rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_a_row_is_the_scene_it_describes() -> None:
    text = "voltage_v,frequency_hz,x_m,direction,finger_load_n\n150,24000,0.03,left,0.7\n"
    row = _rows(predict("s.csv", text, PredictOptions(rung="mode")))[0]
    scene = Scene(
        drive=Drive(voltage_v=150.0, frequency_hz=24000.0),
        touch=FingerContact(x_m=0.03, finger_load_n=0.7),
        direction="left",
    )
    assert float(row["mu_effective"]) == pytest.approx(friction_coefficient(scene)[0], rel=1e-15)
    assert (row["voltage_v"], row["direction"], row["rung"]) == ("150", "left", "mode")


def test_blank_cells_and_absent_columns_take_the_papers_values() -> None:
    row = _rows(predict("s.csv", "voltage_v,x_m\n,\n"))[0]
    named = {name: row[name] for name in ("voltage_v", "frequency_hz", "x_m", "coverage", "mode")}
    assert named == {
        "voltage_v": "100",
        "frequency_hz": "resonance",
        "x_m": "0.0414",
        "coverage": "local",
        "mode": "6",
    }
    assert row["finger_load_n"] == ""


def test_a_studys_values_stand_for_blank_cells() -> None:
    defaults = study_defaults(parsed_study(template("paper")))
    row = _rows(predict("s.csv", "voltage_v\n100\n", None, defaults))[0]
    assert (row["finger_load_n"], row["sliding_speed_m_s"]) == ("0.5", "0.04")


def test_rows_of_every_kind_keep_their_order() -> None:
    text = "mode,direction,coverage,finger_load_n,same_direction_fraction\n"
    cells = ["6,right,local,,", "3,left,local,0.5,", "6,right,full,,0.3", "6,left,full,,"] * 3
    rows = _rows(predict("s.csv", text + "\n".join(cells) + "\n"))
    assert [row["mode"] for row in rows] == ["6", "3", "6", "6"] * 3
    assert rows[2]["same_direction_ratio"] == rows[2]["same_direction_fraction"]
    assert rows[0]["mu_effective"] == rows[4]["mu_effective"]


def test_the_error_bound_is_the_tolerance_and_kept() -> None:
    places = "x_m\n" + "\n".join(f"{0.001 * k}" for k in range(1, 100)) + "\n"
    coarse = _rows(predict("s.csv", places, PredictOptions(tolerance=1e-3)))
    fine = _rows(predict("s.csv", places, PredictOptions(tolerance=1e-7)))
    for ours, best in zip(coarse, fine, strict=True):
        assert (ours["error_bound"], best["error_bound"]) == ("0.001", "1e-07")
        assert 0 < abs(float(ours["mu_effective"]) - float(best["mu_effective"])) < 1e-3


@pytest.mark.parametrize("rung", ["eq15", "mode", "own-mode"])
def test_a_rung_with_a_model_of_its_own_has_no_error_bound(rung: str) -> None:
    (row,) = _rows(predict("s.csv", "x_m\n0.03\n", PredictOptions(rung=rung)))
    assert (row["rung"], row["error_bound"]) == (rung, "")


@pytest.mark.parametrize("former", ["auto", "timoshenko-modes", "timoshenko-patched"])
def test_former_names_of_the_whole_beam_are_understood(former: str) -> None:
    table = "x_m\n0.03\n"
    assert predict("s.csv", table, PredictOptions(rung=former)) == predict("s.csv", table)


def test_a_table_without_scenes_gives_a_table_without_predictions() -> None:
    assert _rows(predict("s.csv", "x_m\n")) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_m\n0.01\n0.2\n", "s.csv, line 3, column x_m: must lie in [0, 0.1], got '0.2'"),
        (
            "body_load_n\n-1\n",
            "column body_load_n: must be a finite number above 0, got '-1'",
        ),
        ("damping_ratio\n1\n", "damping_ratio: must lie strictly between 0 and 1, got '1'"),
        ("voltage_v\nnan\n", "column voltage_v: must be a finite number of at least 0, got 'nan'"),
        ("contact_m\n1_0\n", "column contact_m: must be a finite number above 0, got '1_0'"),
        ("frequency_hz\nfast\n", "must be `resonance` or a finite number above 0, got 'fast'"),
        ("direction\nup\n", "column direction: must be one of right, left, got 'up'"),
        ("mode\n1.5\n", "column mode: must be a whole number of at least 1, got '1.5'"),
        ("mode\n30\n", "line 2, column mode: must lie below the beam's cut-off at 218 kHz"),
        ("x_m,mode\n0,6\n0,41\n", "line 3, column mode: must lie in [1, 40], got '41'"),
        ("mode\n1e300\n", "line 2, column mode: must lie in [1, 40], got '1e300'"),
        (
            "frequency_hz\n24000\n218500\n",
            "line 3, column frequency_hz: must be at most the beam's cut-off, 218428, got 218500.0",
        ),
        ("frequency_hz\n1e-300\n", "line 2, column frequency_hz: must lie in [1e-09, 1e+09]"),
        ("frequency_hz\n1e300\n", "must lie in [1e-09, 1e+09], got '1e300'"),
        ("voltage_v\n1e308\n", "must be 0 or lie in [1e-09, 1e+09], got '1e308'"),
        ("x_m\n5e-324\n", "column x_m: must be 0 or lie in [1e-09, 1e+09]"),
        ("volts\n1\n", "s.csv, line 1: unknown column 'volts'"),
        ("x_m,x_m\n0,0\n", "s.csv, line 1: column 'x_m' stands twice"),
        ("x_m,mode\n0.01\n", "s.csv, line 2: 2 cells are due, got 1"),
        ("", "s.csv, line 1: a line of column names is due, got none"),
        ("x_m;mode\n0.01;6\n", "s.csv, line 1: the cells are separated by semicolons; save the"),
        ('x_m,mode\n0,"6\n0,6\n', "s.csv, line 2: a quotation mark is opened and never closed; cl"),
        ("x_m\n0\n" + "9" * 200_000, "line 3: a cell must have at most 131072 characters, got mo"),
        ("x_m\n" + "9" * 200, f"line 2, column x_m: must lie in [0, 0.1], got '{'9' * 76}..."),
        ("x" * 200, f"s.csv, line 1: unknown column '{'x' * 76}...; known: voltage_v, "),
    ],
)
def test_a_bad_cell_is_named(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        predict("s.csv", text)


SHORT = "x_m,contact_m\n0.0218,0.01\n0.0218,0.005\n"


@pytest.mark.parametrize("law", ["consistent", "coulomb"])
def test_a_contact_too_short_for_eq15_is_refused_under_the_repaired_laws(law: str) -> None:
    message = (
        "s.csv, line 3, column contact_m: must be longer at x_m = 0.0218 on the rung eq15, where "
        "it makes a/u 1.74, outside [0, 1]; take a longer contact or another rung, got 0.005"
    )
    with pytest.raises(ValueError, match=re.escape(message)):
        predict("s.csv", SHORT, PredictOptions(law=law, rung="eq15"))
    assert [row["note"] for row in _rows(predict("s.csv", SHORT, PredictOptions(law=law)))] == [
        "",
        "",
    ]


@pytest.mark.parametrize("rung", ["eq15", "mode", "beam"])
def test_an_impossible_ratio_of_the_printed_law_is_noted_with_a_warning(rung: str) -> None:
    message = "in 1 of 2 scenes, first in line 3 of s.csv: a/u 1.74 makes mu_effective -0.0959;"
    with pytest.warns(UserWarning, match=message):
        rows = _rows(predict("s.csv", SHORT, PredictOptions(law="printed", rung=rung)))
    assert [row["note"] for row in rows] == ["", "a/u outside 0 to 1"]
    assert float(rows[1]["same_direction_ratio"]) == pytest.approx(1.74)


def test_eq15_stays_within_0_and_1_for_the_papers_contact() -> None:
    places = "x_m\n" + "\n".join(f"{k / 1e4:g}" for k in range(1001)) + "\n"
    for law in LAWS:
        rows = _rows(predict("s.csv", places, PredictOptions(law=law, rung="eq15")))
        assert {row["note"] for row in rows} == {""}


def test_the_highest_mode_below_the_cut_off_depends_on_the_rung() -> None:
    assert _rows(predict("s.csv", "mode\n40\n", PredictOptions(rung="mode")))
    assert _rows(predict("s.csv", "mode\n27\n", PredictOptions(rung="beam")))
    with pytest.raises(ValueError, match=r"cut-off at 218 kHz \(27 modes\), got 28"):
        predict("s.csv", "mode\n28\n", PredictOptions(rung="beam"))


def test_a_mode_with_a_small_share_of_the_motion_does_not_stand_for_it() -> None:
    with pytest.raises(ValueError, match=r"s\.csv, line 3, .*mode 26 has 0\.63 .*take beam"):
        predict("s.csv", "mode\n6\n26\n", PredictOptions(rung="own-mode"))


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("far-field", "; take mode"),
        ("euler-patched", "; take beam"),
        ("timoshenko", "; take beam"),
        ("modes:12", "; take beam"),
        ("exact", ""),
    ],
)
def test_any_other_rung_is_refused_with_the_one_to_take(name: str, instead: str) -> None:
    message = f"rung must be one of eq15, mode, own-mode, beam{instead}, got '{name}'"
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        PredictOptions(rung=name)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, 9e-9, math.nan])
def test_a_tolerance_below_the_least_is_refused(tolerance: float) -> None:
    with pytest.raises(ValueError, match=f"^tolerance must be at least 1e-08, got {tolerance}$"):
        PredictOptions(tolerance=tolerance)


_SIZES: dict[str, tuple[str, ...]] = {
    "voltage_v": ("0", "1e-9", "100", "1e9"),
    "frequency_hz": ("resonance", "1e-9", "24000", "2e5"),
    "x_m": ("0", "1e-9", "0.05", "0.1"),
    "contact_m": ("1e-9", "0.01", "1e9"),
    "direction": ("left", "right"),
    "coverage": ("local", "full"),
    "ratio": ("eq15", "mode"),
    "body_count": ("1", "1e9"),
    "body_load_n": ("1e-9", "20", "1e9"),
    "finger_load_n": ("", "1e-9", "1e9"),
    "body_mass_kg": ("0", "1e-9", "1e9"),
    "friction_coefficient": ("1e-9", "0.4", "1e9"),
    "damping_ratio": ("1e-9", "0.999999999"),
    "mode": ("1", "6", "12"),
    "sliding_speed_m_s": ("1e-9", "0.04", "1e9"),
    "body_height_m": ("0", "1e-9", "1e9"),
}


@pytest.mark.filterwarnings("ignore:by Eq 15")  # most of these contacts are not the paper's
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("rung", ["eq15", "mode", "own-mode", "beam"])
def test_every_value_within_reach_gives_finite_numbers(law: str, rung: str) -> None:
    choice = Random(1)
    of = dict(_SIZES)
    if rung == "eq15" and law != "printed":
        of["contact_m"] = ("0.01", "1e9")
    rows = [",".join(choice.choice(sizes) for sizes in of.values()) for _ in range(200)]
    text = "\n".join([",".join(_SIZES), *rows]) + "\n"
    for row in _rows(predict("s.csv", text, PredictOptions(law=law, rung=rung))):
        assert all(math.isfinite(float(row[name])) for name in OUTPUTS), row


def test_the_highest_frequency_and_mode_are_within_reach() -> None:
    text = "frequency_hz,mode\n1e8,1\nresonance,40\n"
    rows = _rows(predict("s.csv", text, PredictOptions(rung="mode")))
    assert [round(float(row["mu_effective"]), 3) for row in rows] == [0.4, 0.401]


@pytest.mark.parametrize("rung", ["mode", "own-mode", "beam"])
def test_a_calibrated_rig_has_its_own_gain_and_resonance(rung: str) -> None:
    own = Calibration(gain=1.2, resonance_hz=24_163.0, origin="session slide/1")
    beside = rung_resonance_hz(rung, Beam(), 6) * 0.99
    rows = _rows(
        predict(
            "s.csv",
            f"voltage_v,frequency_hz\n50,{0.99 * 24_163!r}\n50,resonance\n",
            PredictOptions(rung=rung, rig=own),
        )
    )
    due = _rows(
        predict(
            "s.csv",
            f"voltage_v,frequency_hz\n60,{beside!r}\n60,resonance\n",
            PredictOptions(rung=rung),
        )
    )
    for row, same in zip(rows, due, strict=True):
        assert float(row["mu_effective"]) == pytest.approx(float(same["mu_effective"]), rel=1e-9)
    assert rows[0]["voltage_v"] == "50"


def test_a_calibrated_rigs_values_stand_for_blank_cells() -> None:
    own = Calibration(damping_ratio=0.004, body_height_m=1.2e-3, origin="session slide/1")
    study = parsed_study(template("paper"))
    of_papers = study_defaults(study)
    assert (of_papers["damping_ratio"], of_papers["body_height_m"]) == (0.005, 0.001)
    row = _rows(predict("s.csv", "voltage_v\n100\n", None, study_defaults(study, own)))[0]
    assert (row["damping_ratio"], row["body_height_m"]) == ("0.004", "0.0012")


@pytest.mark.parametrize("rung", ["mode", "own-mode", "beam"])
def test_in_a_study_a_drive_in_hz_is_as_far_from_the_resonance_as_on_the_rig(rung: str) -> None:
    study = parsed_study(template("paper"))
    nominal_hz = study.rig.nominal_resonance_hz
    options = PredictOptions(rung=rung, rig=study_rig(study))
    text = f"voltage_v,frequency_hz\n180,resonance\n180,{nominal_hz}\n180,{0.99 * nominal_hz}\n"
    by_word, by_hz, beside = (
        float(it["mu_effective"]) for it in _rows(predict("s", text, options))
    )
    assert by_hz == pytest.approx(by_word, rel=1e-9)
    assert beside > by_hz + 0.01
    fitted = Calibration(resonance_hz=23_900.0, origin="session slide/1")
    assert study_rig(study, fitted) == fitted


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("rung", ["mode", "own-mode", "beam"])
@pytest.mark.parametrize("frequency", ["resonance", "24000"])
@pytest.mark.parametrize("touch", ["local,", "full,", "full,0.3"])
def test_a_scene_at_many_places_is_as_if_each_place_had_its_own_scene(
    law: str, rung: str, frequency: str, touch: str
) -> None:
    coverage, fraction = touch.split(",")
    places = np.linspace(0.0, 0.1, 40)
    words = {"frequency_hz": frequency, "coverage": coverage, "same_direction_fraction": fraction}
    shared = {name: np.array([word]) for name, word in words.items()}
    options = PredictOptions(law=law, rung=rung)
    table = predicted_table(column_table("s", {"x_m": places, **shared}, places.size), options)
    # The first scene's own voltage keeps the others from sharing one.
    text = f"x_m,voltage_v,{','.join(words)}\n0.05,99,{frequency},{touch}\n"
    text += "".join(f"{x!r},100,{frequency},{touch}\n" for x in places.tolist())
    rows = _rows(predict("s", text, options))[1:]
    for name in OUTPUTS:
        due = [float(row[name]) for row in rows]
        assert table.predictions[name] == pytest.approx(due, rel=1e-12, abs=0)
    assert {table.rung} == {row["rung"] for row in rows}
