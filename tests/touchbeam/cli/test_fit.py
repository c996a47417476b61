"""`touchbeam fit`: its JSON, its table, and its exit codes."""

import json
from pathlib import Path

import pytest

import touchbeam
from tests.analysis.tables.books import book
from tests.runner.command_line import typed

DATA = Path(__file__).parents[2] / "data" / "vibration_speed.csv"
ASKED = ("--task", "yes or no", "--shape", "normal")


def test_the_json_of_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("fit", DATA, *ASKED, "--json") == 0
    tracks = json.loads(capsys.readouterr().out)["tracks"]
    assert len(tracks) == 18
    for track in tracks:
        assert track["threshold_ci"][0] < track["threshold"] < track["threshold_ci"][1]
        assert track["slope_ci"][0] < track["slope"] < track["slope_ci"][1]
        assert track["lapse_ci"][0] < track["lapse"] < track["lapse_ci"][1]
        assert track["jnd"] == pytest.approx(0.67449 / track["slope"], rel=1e-4)
        assert 0 <= track["deviance_p"] <= 1
        assert track["flags"] == []
    assert typed("fit", DATA, *ASKED, "--json") == 0
    assert json.loads(capsys.readouterr().out)["tracks"] == tracks


def test_names_in_the_json_are_those_of_the_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        f"{name},{track},{level},20,{right}"
        for name in ("Ann", "Ben")
        for track in ("dry", "wet")
        for level, right in ((1, 10), (2, 13), (4, 18), (8, 20))
    ]
    table = tmp_path / "t.csv"
    table.write_text("\n".join(("Name,track,level,trials,correct", *rows)))
    assert typed("fit", table, "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert [track["participant"] for track in found["tracks"]] == ["Ann", "Ann", "Ben", "Ben"]
    assert [each["participant"] for each in found["comparisons"]] == ["Ann", "Ben"]


def test_yes_and_no_that_are_fitted_as_two_intervals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "t.csv"
    rows = (f"P1,{level},20,{yes}" for level, yes in ((1, 0), (2, 3), (3, 9), (4, 17), (5, 20)))
    table.write_text("\n".join(("subject,volts,n,yes", *rows)))
    said = 'if the answers are yes and no, add --task "yes or no".'
    assert typed("fit", table) == 0
    assert said in capsys.readouterr().out
    assert typed("fit", table, "--task", "yes or no") == 0
    assert said not in capsys.readouterr().out


def test_what_cannot_be_estimated_is_null(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "one.csv"
    table.write_text("participant,track,level,correct\nP01,T,1,1\n")
    assert typed("fit", table, "--json") == 0
    (track,) = json.loads(capsys.readouterr().out)["tracks"]
    assert (track["threshold"], track["threshold_ci"]) == (None, [None, None])
    assert typed("fit", table) == 0
    assert "nan" not in capsys.readouterr().out


def test_the_table_says_which_share_defines_the_threshold(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert typed("fit", DATA, "--threshold-at", "0.8") == 0
    shown = capsys.readouterr().out
    assert "Thresholds at 0.8 correct" in shown
    assert "does not rise" not in shown
    assert typed("fit", DATA, *ASKED) == 0
    assert "Thresholds at 0.5 of the curve" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--threshold-at", "0.4"), "must lie above 0.5, which is chance in two intervals"),
        (
            ("--task", "four"),
            "task must be one of yes or no, two intervals, three int",
        ),
        (("--lapse", "0.6"), "the lapse rate must lie in [0, 0.5), got 0.6"),
        (("--lapse", "nan"), "the lapse rate must lie in [0, 0.5), got nan"),
        (("--lapse", "0.3", "--threshold-at", "0.8"), "and below 0.7, which lapses leave, got 0.8"),
    ],
)
def test_wrong_options(
    arguments: tuple[str, ...], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("fit", DATA, *arguments) == 2
    shown = capsys.readouterr().err
    assert message in shown
    assert shown.count("\n") == 1


def test_a_table_that_is_missing_or_a_device(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("fit", "none.csv") == 2
    assert "none.csv: no such file" in capsys.readouterr().err
    assert typed("fit", "/dev/zero") == 2
    assert "must be a file, got a pipe or a device" in capsys.readouterr().err


def test_a_studys_folder_is_fitted_with_its_own_task(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "study"
    assert typed("new", study, "--template", "threshold") == 0
    assert typed("run", study, "--participant", "P01", "--ratings", "virtual") == 0
    capsys.readouterr()
    assert typed("fit", study) == 2
    assert "no trials of sessions here; add --rehearsals" in capsys.readouterr().err
    assert typed("fit", study, "--rehearsals", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["task"] == "two intervals"
    assert {each["track"] for each in found["tracks"]} == {"by a staircase", "smallest amplitude"}
    (compared,) = found["comparisons"]
    assert compared["of"] == "ratio"
    assert compared["ci"][0] < compared["value"] < compared["ci"][1]


def test_a_study_without_tracks_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study, out = tmp_path / "study", tmp_path / "out"
    said = "the study has no tracks; touchbeam report has its scores"
    assert typed("new", study, "--template", "plate") == 0
    capsys.readouterr()
    assert typed("fit", study) == 2  # though it has no sessions that could be read
    assert capsys.readouterr().err == f"touchbeam: {study}: {said}\n"
    assert typed("run", study, "--participant", "P01", "--ratings", "virtual") == 0
    with pytest.raises(ValueError, match=f"^answers: {said}$"):
        touchbeam.fit(touchbeam.load(study, rehearsals=True).trials)
    assert typed("export", study, out, "--format", "csv", "--rehearsals") == 0
    capsys.readouterr()
    assert typed("fit", out / "trials.csv") == 2
    assert capsys.readouterr().err == f"touchbeam: {out / 'trials.csv'}: {said}\n"


def test_the_dialects_of_import_are_those_of_fit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows: list[tuple[object, ...]] = [("subject", "condition", "level", "trials", "correct")]
    rows += [
        ("P01", name, level, 20, right)
        for name, rights in (("dry", (10, 13, 17, 20)), ("wet", (9, 11, 12, 19)))
        for level, right in zip((1.5, 2.0, 4.0, 8.0), rights, strict=True)
    ]
    plain = "\n".join(";".join(map(str, row)) for row in rows)
    (tmp_path / "t.csv").write_text(plain.replace(".", ",") + "\nP01;dry;9;20;NA\n")
    (tmp_path / "t.xlsx").write_bytes(book(S=rows))
    assert typed("fit", tmp_path / "t.csv") == 0
    shown = capsys.readouterr().out
    assert "Tracks compared" in shown
    assert "1 row was left out: 1 without an answer." in shown
    assert typed("fit", tmp_path / "t.xlsx") == 0
    assert capsys.readouterr().out.splitlines()[:8] == shown.splitlines()[:8]


def test_a_table_that_is_too_large_is_measured_in_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with (tmp_path / "t.csv").open("wb") as file:
        file.truncate(2**27)
    assert typed("fit", tmp_path / "t.csv") == 2
    assert "must have at most 64 MiB, got 128\n" in capsys.readouterr().err


def test_what_is_left_out_and_pooled_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [
        f"A,{hand},{level},{'longer' if level > 2 + at else word}\n"
        for at, hand in enumerate(("L", "R"))
        for level in (1, 2, 3, 4)
        for word in ("longer", "shorter", "99")
    ]
    (tmp_path / "t.csv").write_text("id,hand,volts,felt\n" + "".join(rows))
    options = ("--columns", "answer=felt", "--answers", "longer=1,shorter=0", "--missing", "99")
    assert typed("fit", tmp_path / "t.csv", *options) == 0
    shown = capsys.readouterr().out
    assert "5 rows were left out: 5 without an answer." in shown
    said = "Left out: column hand (2 values: L, R). A threshold for each value: add --columns condi"
    assert said in shown
    assert typed("fit", tmp_path / "t.csv", *options, "--json") == 0
    streams = capsys.readouterr()
    assert said in streams.err
    assert len(json.loads(streams.out)["tracks"]) == 1
