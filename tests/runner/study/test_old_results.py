"""Files beside the journal that still hold a participant who has withdrawn."""

import html
import json
import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from protocol.journal.events import ScoresImported
from runner.clock import WallClock
from runner.journal.amendments import withdraw
from runner.journal.database import log_of
from runner.journal.opening import open_journal
from runner.journal.store import SessionLog
from runner.study import old_results as search
from runner.study.old_results import old_results

HOLDING = {
    "trials.csv": "participant,session\nP01,1\nP-1,1\n",
    "quoted.csv": 'session,participant\n1,"P-1"\n',
    "formula.csv": "participant\n'P-1\n",
    "other.csv": "code,score\nP-1,7\n",
    "broken.csv": "participant\n" + "x" * 200_000 + "\nP-1\n",
    "participants.tsv": "participant_id\tpseudonym\nsub-P1\tP-1\n",
    "report.json": '{"rows": [{"subject": "P-1"}]}',
    "report.html": '<tr><th scope="row">P-1</th><td>7</td></tr>',
    "scores.svg": "<!-- P-1 -->",
    "README.md": "The chain of P-1/1 is broken.",
    "table4.tex": "P-1 & 7 \\\\",
}
OTHERS = {
    "trials.csv": "participant,session,notes\nP-10,1,as P-1\nXP-1,1,\n",
    "participants.tsv": "participant_id\tpseudonym\nsub-P1\tP-1x\n",
    "report.json": '{"rows": [{"subject": "P-1-2"}]}',
    "report.html": "<td>P-11</td>",
    "study.toml": 'name = "P-1"',
    "figure.png": "P-1",
}


@pytest.mark.parametrize(("name", "text"), HOLDING.items())
def test_a_file_that_holds_the_participant_is_found(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert old_results(tmp_path, "P-1").holding == (name,)


@pytest.mark.parametrize(("name", "text"), OTHERS.items())
def test_files_about_others_are_not_named(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert old_results(tmp_path, "P-1").holding == ()


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("trials.csv", "participant,session\n12,7\n"),
        ("report.json", '{"subject": "12", "score": 7, "text": "7 of 9"}'),
        ("report.html", '<td colspan="7">7</td><th scope="row">12</th>'),
        ("table4.tex", "12 & 7 & 7"),
    ],
)
def test_a_number_is_a_participant_only_where_names_are(
    tmp_path: Path, name: str, text: str
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert old_results(tmp_path, "7").holding == ()
    assert old_results(tmp_path, "12").holding == (name,)


@pytest.mark.parametrize("name", ["受试者 1", 'a "b" 1', "x_1", "R&D 1"])
def test_any_name_of_an_imported_table_is_found(tmp_path: Path, name: str) -> None:
    forms = (json.dumps(name), html.escape(name), name, name.replace("_", r"\_"))
    for number, form in enumerate(forms):
        (tmp_path / f"{number}.html").write_text(f"<td>{form}</td>", encoding="utf-8")
    assert len(old_results(tmp_path, name).holding) == len(forms)


def test_a_report_or_export_is_named_once_by_its_folder(tmp_path: Path) -> None:
    for path in (
        "report/report.json",
        "report/report.html",
        "export/bids/dataset_description.json",
        "export/bids/sub-P1/beh/sub-P1_beh.tsv",
        "export/csv/trials.csv",
        "notes/mine.txt",
    ):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text("participant\nP-1\n", encoding="utf-8")
    found = old_results(tmp_path, "P-1")
    assert found.holding == ("export/bids", "export/csv", "notes/mine.txt", "report")
    assert found.unsearched == 0


def test_links_and_pipes_are_not_followed(tmp_path: Path) -> None:
    outside, study = tmp_path / "outside", tmp_path / "study"
    outside.mkdir()
    study.mkdir()
    (outside / "trials.csv").write_text("participant\nP-1\n")
    (study / "linked").symlink_to(outside)
    (study / "linked.csv").symlink_to(outside / "trials.csv")
    os.mkfifo(study / "pipe.csv")
    assert old_results(study, "P-1") == search.OldResults(holding=(), unsearched=0)


def test_the_search_is_bounded_and_says_what_it_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(5):
        (tmp_path / f"{number}.csv").write_text("participant\nP-1\n")
    monkeypatch.setattr(search, "MOST_FILES", 3)
    assert old_results(tmp_path, "P-1") == search.OldResults(
        holding=("0.csv", "1.csv", "2.csv"), unsearched=2
    )
    monkeypatch.setattr(search, "MOST_BYTES", 20)
    assert old_results(tmp_path, "P-1").unsearched == 4


@pytest.fixture
def withdrawn(tmp_path: Path) -> Path:
    """A study whose `old.db` and kept log are from before the withdrawal of P-1."""
    with open_journal(tmp_path / "study.db") as journal:
        for participant in ("P-1", "P-12"):
            given = {"participant": participant, "conditions": ["a"], "scores": {"a": 8}}
            log = SessionLog(journal, f"{participant}/1", WallClock())
            log.append(ScoresImported.from_json(given))
        (tmp_path / "study.db-wal-kept-17").write_bytes(log_of(tmp_path / "study.db").read_bytes())
        (tmp_path / "old.db").touch()
        journal.copy_to(tmp_path / "old.db")
        withdraw(journal, WallClock(), "P-1")
        (tmp_path / "new.db").touch()
        journal.copy_to(tmp_path / "new.db")
    return tmp_path


def test_copies_of_the_journal_and_kept_logs_are_found_under_any_name(withdrawn: Path) -> None:
    (withdrawn / "backups").mkdir()
    (withdrawn / "old.db").rename(withdrawn / "backups" / "monday.csv")
    before = (withdrawn / "backups" / "monday.csv").read_bytes()
    assert old_results(withdrawn, "P-1") == search.OldResults(
        holding=("study.db-wal-kept-17", "backups/monday.csv"), unsearched=0
    )
    assert old_results(withdrawn, "P-2").holding == ()
    assert (withdrawn / "backups" / "monday.csv").read_bytes() == before
    assert len([*withdrawn.iterdir()]) == 4, "no log or index is left beside a copy"


def test_the_log_of_the_study_itself_and_pictures_are_not_searched(withdrawn: Path) -> None:
    (withdrawn / "study.db-wal-kept-17").rename(withdrawn / "study.db-wal")
    (withdrawn / "old.db").unlink()
    (withdrawn / "picture.png").write_bytes(b"\x89PNG P-1/1")
    assert old_results(withdrawn, "P-1") == search.OldResults(holding=(), unsearched=0)


def test_a_database_that_is_no_journal_is_counted_as_not_searched(withdrawn: Path) -> None:
    with closing(sqlite3.connect(withdrawn / "new.db")) as other:
        other.execute("CREATE VIEW mine AS SELECT 1")
    (withdrawn / "torn.db").write_bytes((withdrawn / "old.db").read_bytes()[:5000])
    found = old_results(withdrawn, "P-1")
    assert found == search.OldResults(holding=("old.db", "study.db-wal-kept-17"), unsearched=2)
