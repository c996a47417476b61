"""Questions of a study's own, from the study file to the report and the exported data."""

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from protocol.journal.events import Answered, QuestionAnswered
from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import open_journal
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.command_line import typed

VALIDATOR = str(Path(sys.executable).with_name("bids-validator-deno"))
QUESTIONS = parsed_study(template("paper") + OWN_QUESTIONS).question
APART = {"hand", "age", "sensations", "remarks"}


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with one question of each kind that two virtual participants have completed."""
    folder = tmp_path_factory.mktemp("questions") / "study"
    assert typed("new", folder) == 0
    with (folder / "study.toml").open("a", encoding="utf-8") as file:
        file.write(OWN_QUESTIONS)
    for participant in ("R1", "R2"):
        assert typed("run", folder, "--participant", participant, "--ratings", "virtual") == 0
    return folder


def recorded(study: Path, participant: str) -> dict[str, list[Any]]:
    """The answers of a participant, by question."""
    found: dict[str, list[Any]] = {}
    with open_journal(study / "study.db") as journal:
        (name,) = (each for each in journal.sessions() if each.startswith(f"{participant}/"))
        for event in journal.events(name):
            if event.tag in {Answered.TAG, QuestionAnswered.TAG}:
                record = event.record
                given = record.questions if isinstance(record, Answered) else [record]
                for each in given:
                    found.setdefault(each.name, []).append(each.answer)  # type: ignore[union-attr]
    return found


def test_check_shows_the_questions(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("check", study) == 0
    shown = capsys.readouterr().out
    assert "Questions   before: hand, age\n" in shown
    assert "            after trials: pleasantness, confidence\n" in shown
    assert typed("check", study, "--json") == 0
    listed = json.loads(capsys.readouterr().out)["questions"]
    assert listed == [{"name": each.name, "when": each.when} for each in QUESTIONS]


def test_virtual_participants_answer_all_of_them(study: Path) -> None:
    assert typed("verify", study) == 0
    first, second = recorded(study, "R1"), recorded(study, "R2")
    assert first.keys() == second.keys() == {question.name for question in QUESTIONS}
    assert first != second
    assert {name: len(given) for name, given in first.items()} == {
        "pleasantness": 5,
        "confidence": 2,
        **dict.fromkeys(APART, 1),
    }


def test_an_answer_is_a_cell_of_the_exported_table(study: Path, tmp_path: Path) -> None:
    assert typed("export", study, tmp_path / "csv", "--format", "csv", "--rehearsals") == 0
    with (tmp_path / "csv" / "trials.csv").open(encoding="utf-8", newline="") as table:
        rows = [row for row in csv.DictReader(table) if row["participant"] == "R1"]
    told = recorded(study, "R1")
    pleasant = [row["pleasantness"] for row in rows if row["trial_kind"] == "trial"]
    assert pleasant == [str(answer) for answer in told["pleasantness"]]
    assert {row["condition"] for row in rows if row["confidence"]} == {"voltage", "pressure"}
    assert {row["age"] for row in rows} == {str(told["age"][0])}
    block = {row["block"] for row in rows if row["sensations"]}
    assert block == {"1"}
    assert all(float(row["age_reaction_time_s"]) > 0 for row in rows)
    with (tmp_path / "csv" / "participants.csv").open(encoding="utf-8", newline="") as table:
        people = {row["participant"]: row for row in csv.DictReader(table)}
    assert {who: row["age"] for who, row in people.items()} == {
        who: str(recorded(study, who)["age"][0]) for who in ("R1", "R2")
    }
    of_people = json.loads((tmp_path / "csv" / "participants.json").read_text(encoding="utf-8"))
    assert of_people.keys() == people["R1"].keys()
    assert of_people["age"]["unit"] == "years"
    described = json.loads((tmp_path / "csv" / "trials.json").read_text(encoding="utf-8"))
    assert described["age"]["unit"] == "years"
    assert described["hand"]["levels"]["both"] == "both"
    assert described["sensations"]["any_separated_by"] == ";"


def test_the_official_validator_finds_no_error(study: Path, tmp_path: Path) -> None:
    assert typed("export", study, tmp_path / "bids", "--format", "bids", "--rehearsals") == 0
    said = subprocess.run(
        [VALIDATOR, str(tmp_path / "bids"), "--format", "json"],
        capture_output=True,
        text=True,
        check=False,
    )
    issues = json.loads(said.stdout)["issues"]["issues"]
    assert [issue for issue in issues if issue["severity"] == "error"] == []
    with (tmp_path / "bids" / "participants.tsv").open(encoding="utf-8") as table:
        people = list(csv.DictReader(table, delimiter="\t"))
    told = [recorded(study, row["pseudonym"]) for row in people]
    assert [row["age"] for row in people] == [str(each["age"][0]) for each in told]
    sidecar = json.loads((tmp_path / "bids" / "participants.json").read_text(encoding="utf-8"))
    assert sidecar["age"]["Units"] == "years"
    assert "How old are you?" in sidecar["age"]["Description"]
    assert typed("export", study, tmp_path / "ds", "--format", "psychds", "--rehearsals") == 0
    described = json.loads((tmp_path / "ds" / "dataset_description.json").read_text("utf-8"))
    names = {variable["name"] for variable in described["variableMeasured"]}
    assert {question.name for question in QUESTIONS} <= names


def test_the_report_sums_them_up(study: Path, tmp_path: Path) -> None:
    assert typed("report", study, "--rehearsals", "--out", tmp_path / "report") == 0
    found = json.loads((tmp_path / "report" / "report.json").read_text(encoding="utf-8"))
    summed = {entry["name"]: entry for entry in found["questions"]}
    told = [recorded(study, name) for name in ("R1", "R2")]
    ages = [each["age"][0] for each in told]
    (everybody,) = summed["age"]["groups"]
    assert everybody["mean"] == pytest.approx(sum(ages) / 2)
    assert (everybody["lowest"], everybody["answers"]) == (min(ages), 2)
    assert [group["name"] for group in summed["confidence"]["groups"]] == ["voltage", "pressure"]
    assert sum(summed["hand"]["groups"][0]["counts"].values()) == 2
    remarks = [each["remarks"][0] for each in told if each["remarks"][0]]
    assert [said[-1] for said in summed["remarks"].get("said", [])] == remarks
    page = (tmp_path / "report" / "report.html").read_text(encoding="utf-8")
    assert "pleasantness: How pleasant was the last touch? From 1 to 7." in page


def test_a_withdrawal_erases_them(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("withdraw", study, "--participant", "R2", "--rehearsal", "--yes") == 0
    with open_journal(study / "study.db") as journal:
        (name,) = (each for each in journal.sessions() if each.startswith("R2/"))
        assert all(not event.payload for event in journal.events(name))
    assert typed("verify", study) == 0
