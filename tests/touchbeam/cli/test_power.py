"""The command `power`: its document, its tables, and what it refuses."""

import json
from pathlib import Path
from typing import Any

import pytest

from analysis.power.null_cohorts import KINDS
from protocol.study_file.loading import text_digest
from tests.runner.command_line import typed

FEW = ("--participants", "4", "--workers", "1")
QUICK = (*FEW, "--studies", "30", "--null-studies", "20", "--tests-only")


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert typed("new", tmp_path / "mine") == 0
    capsys.readouterr()
    return tmp_path / "mine"


def document(folder: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    assert typed("power", folder, *options, "--json") == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_the_document_has_what_others_rely_on(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = document(folder, capsys, *FEW, "--studies", "2", "--null-studies", "20", "--seed", "3")
    assert (found["studies"], found["seed"], found["workers"]) == (2, 3, 1)
    assert found["study_sha256"] == text_digest((folder / "study.toml").read_text("utf-8"))
    design = found["design"]
    assert design.pop("told_mc_error") > 0
    assert 0 <= design.pop("told") <= 1
    assert design == {
        "participants": 4,
        "repeats": 1,
        "levels": 1,
        "sessions": 1,
        "conditions": ["frequency", "structure", "voltage", "direction", "pressure"],
    }
    null = found["null"]
    kinds = [kind.name for kind in KINDS]
    assert [kind["name"] for kind in null["kinds"]] == kinds
    for of in (null, *null["kinds"]):
        assert {"any_supported", "mc_error"} <= of.keys()
    assert null["any_supported"] == null["kinds"][0]["any_supported"]
    assert null["kinds"][2]["any_supported"] is None, "nothing that can be claimed is false"
    assert set(null["supported"]) <= {test["name"] for test in found["tests"]}
    tests, estimates = found["tests"], found["estimates"]
    assert isinstance(tests, list)
    assert isinstance(estimates, list)
    assert [test["name"] for test in tests[:3]] == [
        "conditions differ",
        "ratings follow the prediction",
        "frequency - structure",
    ]
    assert "gains differ" in {test["name"] for test in tests}
    assert all({"power", "mc_error"} <= test.keys() for test in tests)
    wanted = {"name", "bias", "rmse", "coverage", "width", "mc_error"}
    assert all(wanted <= estimate.keys() for estimate in estimates)
    assert [estimate["name"] for estimate in estimates] == ["group's gain", "levels"]
    assert str(found["answer"]).startswith("4 participants x 1 repeat: levels to within ±")
    assert ", gains of people told in " in found["answer"]
    assert {path.name for path in folder.iterdir()} == {"study.toml", "test_study.py"}


def test_only_time_and_workers_depend_on_the_machine(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    models = ("--participants", "4", "--studies", "9", "--null-studies", "120")
    alone, together = (
        document(folder, capsys, *models, "--workers", workers) for workers in ("1", "2")
    )
    assert (alone.pop("workers"), together.pop("workers")) == (1, 2)
    assert alone.pop("elapsed_s") != together.pop("elapsed_s")
    assert json.dumps(alone) == json.dumps(together)


def test_several_designs_make_a_curve(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--participants", "4,8", "--repeats", "1,2", "--studies", "30", "--tests-only")
    found = document(folder, capsys, *options, "--workers", "1")
    designs = found["designs"]
    assert isinstance(designs, list)
    sizes = [(each["design"]["participants"], each["design"]["repeats"]) for each in designs]
    assert sizes == [(4, 1), (4, 2), (8, 1), (8, 2)]
    assert found["design"] == designs[0]["design"]
    assert "design" in str(found["answer"])
    power = [each["tests"][0]["power"] for each in designs]
    assert power[0] < power[-1]


def test_people_read_tables_and_an_answer(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("power", folder, *QUICK) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "Tests: 4 participants x 1 repeat" in out
    assert "conditions differ" in out
    assert "Simulated: 30 studies, 20 null cohorts of each kind." in out
    header = next(line for line in out.splitlines() if line.strip().startswith("test "))
    assert all(kind.name in header for kind in KINDS)
    assert "anything false" in out
    assert "Estimates" not in out, "there are none without the model"
    assert out.index("power to tell that") < out.index("Tests: 4"), "the answer stands first"
    assert "power to tell that the conditions differ" in out


def test_thresholds_are_estimates_beside_those_of_conditions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "mine"
    assert typed("new", folder, "--template", "threshold") == 0
    capsys.readouterr()
    few = ("--participants", "2,3", "--studies", "3", "--workers", "1")
    report = document(folder, capsys, *few)
    assert [design["design"]["participants"] for design in report["designs"]] == [2, 3]
    begins = [f"{people} participants x 1 repeat: threshold of smallest" for people in (2, 3)]
    assert all(begin in report["answer"] for begin in begins)
    names = ["threshold of smallest amplitude, dB", "threshold of by a staircase, dB"]
    assert [estimate["name"] for estimate in report["estimates"]] == names
    assert [test["name"] for test in report["tests"]] == [
        "thresholds: smallest amplitude - by a staircase"
    ]
    assert report["null"]["any_supported"] is None
    assert typed("power", folder, *few) == 0
    out = capsys.readouterr().out
    assert "Estimates: 2 participants x 1 repeat" in out
    assert "threshold of smallest amplitude to within ±" in out
    file = folder / "study.toml"
    file.write_text(file.read_text() + SECOND)
    both = document(folder, capsys, *few, "--tests-only")
    assert both["estimates"] == report["estimates"]
    assert both["tests"][-1] == report["tests"][0]
    assert both["null"]["any_supported"] is not None
    assert "thresholds" not in " ".join(both["null"]["supported"])


SECOND = """
[[condition]]
name = "more voltage"
question = "roughness"
expected = "smoother"
touches = [{ place = "smooth", voltage_v = 0 }, { place = "smooth", voltage_v = 160 }]
"""


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--participants", "nine"), "--participants must be whole numbers above 0 by commas"),
        (("--repeats", "1,0"), "--repeats must be whole numbers above 0 by commas"),
        (("--participants", "1"), r"participants must lie in [2, 1000], got 1"),
        (
            ("--participants", "9,1001"),
            "participants must lie in [2, 1000], got 1001; give other numbers with --participants",
        ),
        (
            ("--repeats", "30"),
            "9 participants x 30 repeats cannot be planned: repeats must be at most 20; give fewer",
        ),
        (
            ("--repeats", "4", "--levels", "5"),
            "levels must be at most repeats, so that each comes equally often; give fewer with",
        ),
        (("--levels", "9" * 5000), "--levels must be numbers of at most 9 digits, got a longer"),
        (("--scheduler", "nowhere"), "--scheduler must be an address such as tcp://HOST:8786"),
        (("--workers", "0"), "Invalid value for '--workers'"),
        (("--studies", "1"), "Invalid value for '--studies'"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    message: str,
) -> None:
    assert typed("power", folder, *options) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err
    assert err.count("\n") == 1
    assert {path.name for path in folder.iterdir()} == {"study.toml", "test_study.py"}


def test_other_people_give_other_results(
    folder: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    keen, wrong = tmp_path / "keen.toml", tmp_path / "wrong.toml"
    keen.write_text("[person]\ngain = 9.0\nbias = 4.0\nrating_noise = 0.1\nfelt_noise = 0.01\n")
    wrong.write_text("[person]\ngian = 9.0\n")
    found = [document(folder, capsys, *QUICK, *more) for more in ((), ("--people", str(keen)))]
    power = [dict(each["tests"][0])["power"] for each in found]
    assert power[0] < power[1] == 1
    assert typed("power", folder, *QUICK, "--people", wrong) == 2
    assert "gian" in capsys.readouterr().err


def test_a_study_of_one_condition_has_nothing_to_tell_apart(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder / "study.toml"
    before, condition, *_ = file.read_text().split("[[condition]]")
    file.write_text(f"{before}[[condition]]{condition}")
    assert typed("power", folder) == 2
    assert "needs at least 2 conditions, got 1" in capsys.readouterr().err


def test_nobody_at_the_scheduler_s_address_is_a_failure(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("analysis.power.engine._ANSWER_WITHIN_S", 0.5)
    assert typed("power", folder, "--scheduler", "tcp://127.0.0.1:9") == 1
    assert "no Dask scheduler answers there" in capsys.readouterr().err
