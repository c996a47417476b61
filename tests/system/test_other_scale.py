"""Scores from 0 to 100 are one change of the study file: all that shows or reads them follows."""

import csv
import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from protocol.study_file.loading import template
from tests.runner.command_line import typed

BANDS = """\
minimum = 0
maximum = 100
bands = [
  { from = 0, to = 20, en = "not at all", zh = "毫无" },
  { from = 21, to = 60, en = "somewhat", zh = "有点" },
  { from = 61, to = 100, en = "a great deal", zh = "非常" },
]
"""
RUN = ("run", "study", "--ratings", "virtual", "--participant")


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    paper = template("paper").replace('score_when = "agrees"', 'score_when = "always"')
    start = paper.index("bands = [")
    end = paper.index("]\n", start) + 2
    (tmp_path / "study").mkdir()
    text = paper[:start] + BANDS + paper[end:]
    (tmp_path / "study" / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path / "study"


def scores(study: Path) -> list[int]:
    with closing(sqlite3.connect(study / "study.db")) as journal:
        rows = journal.execute("SELECT payload FROM event WHERE tag = 'answered'").fetchall()
    answers = [json.loads(body) for (body,) in rows]
    return [answer["score"] for answer in answers if answer["kind"] == "trial"]


def test_a_study_with_scores_to_100_is_checked_rehearsed_reported_and_exported(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("check", "study") == 0
    for participant in ("R1", "R2", "R3"):
        assert typed(*RUN, participant) == 0
    found = scores(study)
    assert len(found) == 15
    assert any(score > 10 for score in found)
    assert all(0 <= score <= 100 for score in found)
    assert typed("verify", "study") == 0
    assert typed("report", "study", "--rehearsals") == 0
    page = (study / "report" / "report.html").read_text(encoding="utf-8")
    assert "to 100" in page
    assert "to 10 " not in page
    assert "to 10." not in page
    assert typed("export", "study", "data", "--format", "csv", "--rehearsals") == 0
    described = json.loads(Path("data/trials.json").read_text(encoding="utf-8"))
    assert "0 to 100 (0-20: not at all; 21-60: somewhat" in described["score"]["description"]
    with Path("data/trials.csv").open(encoding="utf-8", newline="") as table:
        exported = [row["score"] for row in csv.DictReader(table) if row["trial_kind"] == "trial"]
    assert sorted(map(float, exported)) == sorted(map(float, found))
    for form in ("bids", "psychds"):
        assert typed("export", "study", form, "--format", form, "--rehearsals") == 0
