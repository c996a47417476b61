"""Studies of any surface, from the check to the export: a beam, a table, stated friction, none."""

import csv
import json
import math
import re
import subprocess
import sys
from pathlib import Path

import pytest

from protocol.errors import BadInput
from tests.protocol.surfaces import SURFACES, study_files
from tests.runner.command_line import typed
from tests.runner.registered_study import run_session

VALIDATOR = str(Path(sys.executable).with_name("bids-validator-deno"))
PEOPLE = "effect = { weak = 1.0, strong = 3.0 }\n"


def study_of(name: str, folder: Path) -> Path:
    folder.mkdir()
    for file, content in study_files(name).items():
        (folder / file).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


@pytest.fixture(scope="module", params=SURFACES)
def study(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with two rehearsals."""
    folder = study_of(request.param, tmp_path_factory.mktemp("any") / request.param)
    people = folder / "people.toml"
    people.write_text(PEOPLE)
    told = ("--people", people) if request.param in {"stated", "given"} else ()
    for name in ("P01", "P02"):
        assert typed("run", folder, "--participant", name, "--ratings", "virtual", *told) == 0
    return folder


def test_it_is_checked_with_no_other_warning(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("check", study, "--json") == 0
    record = json.loads(capsys.readouterr().out)
    # The paper's conditions change three things on which this table does not depend.
    lacking = ("frequency", "force_n", "beam") if study.name == "measured" else ()
    told = [f"has no column {name}, so that nothing is predicted to change" for name in lacking]
    # It has none of the texts of its own, which the template of a plate has.
    told += ["texts that participants read speak of a beam: give "] * (study.name == "measured")
    assert len(record["warnings"]) == len(told)
    for words, warning in zip(told, record["warnings"], strict=True):
        assert words in warning
    kind = "given" if study.name == "stated" else study.name
    assert record["surface"]["kind"] == kind
    assert record["surface"]["length_m"] == (0.1 if kind == "given" else 0.12)
    trials = record["participants"][0]["trials"]
    predicted = [it["predicted_contrast"] for it in trials if it["expected"]]
    assert all((value is None) == (study.name == "given") for value in predicted)
    if study.name == "stated":
        assert max(predicted) == pytest.approx(math.log(2))


def test_it_is_reported(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("report", study, "--rehearsals") == 0
    capsys.readouterr()
    report = json.loads((study / "report" / "report.json").read_text())
    assert len(report["table4"]["rows"]) == 2
    page = (study / "report" / "report.html").read_text(encoding="utf-8")
    text = re.sub(r"<(style|script|svg).*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL)
    speaks_of_a_model = re.search(r"friction model|predict(?!ive checks)|Mean predicted", text)
    assert bool(speaks_of_a_model) == (study.name != "given"), speaks_of_a_model
    laws = [law["law"] for law in report.get("laws", [])]
    assert len(laws) == {"beam": 4, "measured": 1, "stated": 1, "given": 0}[study.name]
    source = {"beam": "on its rung beam", "measured": "table friction.csv", "stated": "states of"}
    assert source.get(study.name, "Scores by subject") in text
    assert ("under each friction law" in text) == (study.name == "beam")
    assert ("predicted contrast</th>" in page) == (study.name in {"measured", "stated"})


def test_its_power_is_simulated(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    few = ("--tests-only", "--studies", "4", "--workers", "1", "--json")
    given = study.name in {"stated", "given"}
    told = ("--people", study / "people.toml") if given else ()
    assert typed("power", study, *few, *told) == 0
    assert json.loads(capsys.readouterr().out)["designs"]
    if study.name == "stated":  # people feel what touches state
        assert typed("power", study, *few) == 0
    if study.name == "given":
        assert typed("power", study, *few) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "say in a people file (--people) by how many points" in said


def test_its_exports_are_valid(study: Path, tmp_path: Path) -> None:
    for form in ("bids", "psychds", "csv"):
        assert typed("export", study, tmp_path / form, "--format", form, "--rehearsals") == 0
    text = (tmp_path / "csv" / "contrasts.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert len({row["law"] for row in rows}) == (3 if study.name == "beam" else 1)
    assert {row["rung"] for row in rows} == {"beam" if study.name == "beam" else ""}
    done = subprocess.run(
        [VALIDATOR, tmp_path / "bids", "--json"], capture_output=True, text=True, check=False
    )
    issues = json.loads(done.stdout)["issues"]["issues"]
    assert [issue for issue in issues if issue["severity"] == "error"] == []


@pytest.mark.parametrize("name", SURFACES)
def test_it_is_registered_and_its_files_are_locked(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = study_of(name, tmp_path / name)
    assert typed("register", folder) == 0
    run_session(folder, "P01")
    assert typed("verify", folder) == 0
    assert typed("report", folder) == 0
    capsys.readouterr()
    report = json.loads((folder / "report" / "report.json").read_text())
    own = {"beam": "beam 0.12 m x 0.01 m x 0.003 m", "measured": "measured, 0.12 m long"}
    assert own.get(name, "given, 0.1 m long") in report["provenance"]["model parameters"]
    predicted = [
        trial["predicted"]["consistent"] for trial in report["trials"] if trial["kind"] == "trial"
    ]
    assert {value is None for value in predicted} == {name == "given"}
    for file in {*study_files(name)} - {"study.toml"}:
        (folder / file).write_bytes((folder / file).read_bytes() + b"\n")
        with pytest.raises(BadInput, match="amend"):
            run_session(folder, "P02")
        assert typed("amend", folder, "--reason", "measured anew") == 0
        run_session(folder, "P02")
