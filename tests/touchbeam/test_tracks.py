"""What a track would ask after given answers: on the command line and in Python."""

import json
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from typer.testing import CliRunner

import touchbeam
from protocol.study_file.loading import template
from runner.journal.names import session_name
from runner.journal.opening import open_journal
from tests.analysis.tracks import TRACKS, session
from touchbeam.cli.app import app


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "study"
    place.mkdir()
    (place / "study.toml").write_text(template("threshold"), encoding="utf-8")
    return place


def test_the_command_and_python_say_the_same(folder: Path) -> None:
    printed = CliRunner().invoke(
        app, ["track", str(folder), "smallest amplitude", "--answers", "1 1 0", "--json"]
    )
    told = json.loads(printed.stdout)
    assert told == json.loads(json.dumps(touchbeam.track(folder, "smallest amplitude", [1, 1, 0])))
    assert told["levels"] == [23, 20, 18]
    assert told["values"][0] == pytest.approx(4 * 40 ** (23 / 40))
    assert told["next"]["index"] == 27
    assert told["next"]["volts"] == told["next"]["value"]
    assert told["estimate"]["threshold_at"] == 0.75
    low, high = told["estimate"]["threshold_ci"]
    assert low < told["estimate"]["threshold"] < high


def test_a_staircase_says_its_levels_and_the_mean_of_its_reversals(folder: Path) -> None:
    answers = [1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1, 0]
    told = touchbeam.track(folder, "by a staircase", answers)
    # 4 dB until the second reversal, then 1 dB.
    assert told["levels"] == [30, 30, 30, 26, 26, 26, 22, 26, 26, 26, 25, 26, 26, 26, 25]
    assert told["estimate"]["reversals"] == 5
    assert told["estimate"]["reversals_in_mean"] == 3
    assert told["estimate"]["reversal_mean_at"] == 0.7937
    last = [told["values"][number] for number in (10, 13, 14)]
    assert told["estimate"]["reversal_mean"] == pytest.approx(
        (last[0] * last[1] * last[2]) ** (1 / 3)
    )


def test_without_answers_nothing_is_known(folder: Path) -> None:
    told = touchbeam.track(folder, "smallest amplitude", [])
    assert told["estimate"]["threshold"] is None
    assert told["next"]["index"] == 23


def test_an_ended_track_asks_nothing(folder: Path) -> None:
    told = touchbeam.track(folder, "smallest amplitude", [1, 0, 1, 1] * 10)
    assert told["next"] is None
    with pytest.raises(ValueError, match="ends after 40 of these 41 answers: leave the rest out"):
        touchbeam.track(folder, "smallest amplitude", [1] * 41)


def test_a_name_or_an_answer_that_is_not_there_is_refused(folder: Path) -> None:
    known = "no track is called 'x'; known: 'smallest amplitude', 'by a staircase'"
    with pytest.raises(ValueError, match=known):
        touchbeam.track(folder, "x", [])
    with pytest.raises(ValueError, match=r"must be 1 \(correct, or yes\) or 0, got 2"):
        touchbeam.track(folder, "smallest amplitude", [1, 2])


@pytest.mark.parametrize("missing", [None, "", float("nan")])
def test_a_missing_answer_is_refused_and_not_taken_for_a_wrong_one(
    folder: Path, missing: Any
) -> None:
    with pytest.raises(ValueError, match=f"must be 1 .correct, or yes. or 0, got {missing!r}$"):
        touchbeam.track(folder, "smallest amplitude", [1, missing])


def test_check_shows_each_track(folder: Path) -> None:
    printed = CliRunner().invoke(app, ["check", str(folder), "--json"])
    first, second = json.loads(printed.stdout)["tracks"]
    assert (first["name"], first["task"], first["method"], first["trials"]) == (
        "smallest amplitude",
        "two intervals",
        "quest+",
        40,
    )
    assert first["levels"] == first["volts"]
    assert (first["levels"][0], first["levels"][-1]) == (4, 160)
    assert first["converges_at"] is None
    assert second["converges_at"] == 0.7937
    assert 1.5 < first["expected"]["rmse_db"] < 4
    assert 20 < first["expected"]["interval_db"] < 30
    said = CliRunner().invoke(app, ["check", str(folder)]).stdout
    assert "its rule converges to 0.7937 correct" in said
    assert "41 levels of voltage, 4 to 160 V; contrast 0.00235 to 0.263" in said
    assert "about 3.3 dB (RMSE) after 40 trials" in said


def test_check_refuses_a_contrast_that_cannot_be_reached(folder: Path) -> None:
    file = folder / "study.toml"
    text = file.read_text(encoding="utf-8").replace('axis = "voltage"', 'axis = "contrast"', 1)
    file.write_text(text, encoding="utf-8")
    printed = CliRunner().invoke(app, ["check", str(folder), "--json"])
    assert printed.exit_code == 2
    problem = json.loads(printed.stdout)["problems"][0]
    assert problem["where"] == "track smallest amplitude, levels"
    assert (
        problem["line"]
        == text.splitlines().index(
            'levels = { from = 4, to = 160, count = 41, spaced = "equal ratios" }'
        )
        + 1
    )


def test_check_tells_the_largest_drive_of_any_level(folder: Path) -> None:
    file = folder / "study.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text[: text.index("# Scored beside")], encoding="utf-8")
    printed = CliRunner().invoke(app, ["check", str(folder), "--json"])
    told = json.loads(printed.stdout)
    assert told["max_voltage_v"] == 160
    assert told["max_slew_v_per_us"] > 24
    said = CliRunner().invoke(app, ["check", str(folder)]).stdout
    assert "Carry-over" not in said, "a study without conditions has none"


def test_a_level_beyond_the_end_of_the_beam_is_refused(folder: Path) -> None:
    file = folder / "study.toml"
    text = file.read_text(encoding="utf-8")
    beyond = """
[[track]]
name = "place"
task = "two intervals"
method = "constant"
axis = "place"
levels = { from = 0.05, to = 0.4, count = 5 }
standard = { place = "smooth", voltage_v = 100, place_m = 0.0414 }
comparison = { place = "smooth", voltage_v = 100 }
trials = 10
"""
    file.write_text(text[: text.index("[[track]]")] + beyond, encoding="utf-8")
    said = CliRunner().invoke(app, ["check", str(folder)]).output
    assert "track place, levels: must lie on the beam, which ends at 0.1 m, got 0.4 m" in said


def test_power_says_how_thresholds_err(folder: Path) -> None:
    given = ["power", str(folder), "--studies", "4", "--participants", "3", "--json"]
    report = json.loads(CliRunner().invoke(app, given).stdout)
    names = ["threshold of smallest amplitude, dB", "threshold of by a staircase, dB"]
    assert [estimate["name"] for estimate in report["estimates"]] == names
    assert all(0 < estimate["rmse"] < estimate["width"] for estimate in report["estimates"])
    said = CliRunner().invoke(app, given[:-1]).stdout
    assert "Estimates: 3 participants x 1 repeat" in said


def test_the_live_protocol_of_a_laboratory_needs_no_code(folder: Path) -> None:
    """5 dB then 1 dB, 3 correct answers of any order, 5 reversals: it says that it is 79.4%."""
    file = folder / "study.toml"
    text = file.read_text(encoding="utf-8")
    text = text.replace("step_db = [4, 4, 1]", 'step_db = [5, 1]\nstreak = "cumulative"')
    file.write_text(text.replace("reversals = 12", "reversals = 5"), encoding="utf-8")
    assert (
        "its rule converges to 0.7500 correct"
        in CliRunner().invoke(app, ["check", str(folder)]).stdout
    )


def test_documents_have_what_others_rely_on(folder: Path, tmp_path: Path) -> None:
    table = tmp_path / "table.csv"
    rows = [f"P1,T,{level},20,{right}" for level, right in ((1, 9), (2, 12), (4, 17), (8, 20))]
    table.write_text("\n".join(["participant,track,level,trials,correct", *rows]) + "\n")

    def told(*arguments: object) -> dict[str, Any]:
        made = CliRunner().invoke(app, [*map(str, arguments), "--json"])
        assert made.exit_code == 0, made.output
        found: dict[str, Any] = json.loads(made.stdout)
        return found

    of_check = ["name", "task", "method", "levels", "volts", "trials", "converges_at", "expected"]
    for track in told("check", folder)["tracks"]:
        assert set(of_check) <= set(track)
        assert {"rmse_db", "interval_db"} <= set(track["expected"])
        assert len(track["volts"]) == len(track["levels"])
    asked = told("track", folder, "smallest amplitude", "--answers", "1 0")
    assert {"levels", "values", "next", "estimate"} <= set(asked)
    assert {"index", "value", "volts"} <= set(asked["next"])
    assert {"threshold", "threshold_ci"} <= set(asked["estimate"])
    ended = told("track", folder, "smallest amplitude", "--answers", "1 " * 40)
    assert ended["next"] is None
    of_fit = [
        "participant",
        "track",
        "threshold",
        "threshold_ci",
        "slope",
        "slope_ci",
        "jnd",
        "lapse",
        "lapse_ci",
    ]
    found = {}
    for shape in ("normal", "weibull"):
        (fit,) = told("fit", table, "--task", "two intervals", "--shape", shape)["tracks"]
        assert {*of_fit, "deviance_p", "flags"} <= set(fit)
        (higher,) = told(
            *("fit", table, "--task", "two intervals", "--shape", shape, "--threshold-at", 0.9)
        )["tracks"]
        assert fit["threshold"] < higher["threshold"]
        found[shape] = fit["slope"]
    assert found["normal"] != found["weibull"]


def test_recorded_trials_are_fitted_at_their_levels_and_not_at_the_numbers_of_these(
    tmp_path: Path,
) -> None:
    """As a data frame, and as the file that an export writes; catch trials have no level."""
    study = tmp_path / "study"
    study.mkdir()
    (study / "study.toml").write_text(TRACKS, encoding="utf-8")
    with open_journal(study / "study.db") as journal:
        for slot, who in enumerate(("P01", "P02")):
            for stored in session(TRACKS, who, slot, threshold=40.0):
                journal.append(session_name(who, 1), stored)
    trials = touchbeam.load(study).trials
    found = touchbeam.fit(trials)
    asked = trials[trials.track_role.ne("catch")]
    by_hand = pd.DataFrame(
        {
            "participant": asked.participant,
            "track": asked.track,
            "level": asked.level_value,
            "correct": asked.correct.astype(int),
        }
    )
    pd.testing.assert_frame_equal(
        found.drop(columns="left_out"), touchbeam.fit(by_hand).drop(columns="left_out")
    )
    catch = trials.track_role.eq("catch").groupby([trials.participant, trials.track]).sum()
    assert found.set_index(["participant", "track"]).left_out.to_dict() == catch.to_dict()
    # 15.6 and 22 are the numbers of levels near the threshold of 40 V.
    assert (found.threshold[found.track.eq("by a staircase")] > 25).all()

    out = tmp_path / "out"
    assert (
        CliRunner().invoke(app, ["export", str(study), str(out), "--format", "csv"]).exit_code == 0
    )
    made = CliRunner().invoke(app, ["fit", str(out / "trials.csv"), "--json"])
    told = json.loads(made.stdout)["tracks"]
    assert [one["threshold"] for one in told] == found.threshold.tolist()
    assert [one["left_out"] for one in told] == found.left_out.tolist()
    shown = CliRunner().invoke(app, ["fit", str(out / "trials.csv")]).stdout
    assert f"{catch.sum()} rows were left out: {catch.sum()} catch trials." in shown
