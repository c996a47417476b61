"""`touchbeam withdraw` as a user types it: what it erases, and what it says is left."""

import json
from pathlib import Path

import pytest

from protocol.journal.events import ScoresImported
from protocol.study_file.loading import template
from runner.clock import WallClock
from runner.journal.opening import open_journal
from runner.journal.store import SessionLog
from tests.runner.command_line import typed
from tests.runner.journal.unsalted import make_unsalted

PUBLISHED = Path(__file__).parents[2] / "data" / "published_scores.csv"
ELSEWHERE = "Copies, backups, and reports and exports kept elsewhere may still contain the data."


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def make_results(where: str) -> None:
    assert typed("report", "study", "--out", f"study/{where}/report") == 0
    for form in ("csv", "bids", "psychds"):
        assert typed("export", "study", f"study/{where}/{form}", "--format", form) == 0


def test_reports_and_exports_made_before_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("import", str(PUBLISHED), "study") == 0
    make_results("before")
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "3", "--yes") == 0
    made = ("bids", "csv", "psychds", "report")
    old = tuple(f"before/{name}" for name in made)
    assert capsys.readouterr().out.splitlines() == [
        "Erased: 3/1.",
        *(f"Still contains 3: {result}. Make it again or delete it." for result in old),
        ELSEWHERE,
    ]
    make_results("after")
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "3", "--json") == 0
    assert json.loads(capsys.readouterr().out) == {
        "sessions": ["3/1"],
        "salted": True,
        "holding": list(old),
        "unsearched": 0,
    }


def test_a_withdrawal_from_a_journal_without_salts_says_what_can_be_guessed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("study").mkdir()
    Path("study/study.toml").write_text(template("paper"), encoding="utf-8")
    make_unsalted(Path("study/study.db"))
    with open_journal(Path("study/study.db")) as journal:
        given = {"participant": "P01", "conditions": ["voltage"], "scores": {"voltage": 8}}
        SessionLog(journal, "P01/1", WallClock()).append(ScoresImported.from_json(given))
    assert typed("withdraw", "study", "--participant", "P01", "--yes") == 0
    assert capsys.readouterr().out.splitlines() == [
        "Erased: P01/1.",
        "Digests without salt remain in this journal, which an earlier version made: a short "
        "secret, such as a consent reference, can be found by trying all of them.",
        ELSEWHERE,
    ]
    assert typed("withdraw", "study", "--participant", "P01", "--json") == 0
    assert not json.loads(capsys.readouterr().out)["salted"]
    assert typed("verify", "study") == 0


def test_a_withdrawal_is_confirmed_and_happens_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("import", str(PUBLISHED), "study") == 0
    capsys.readouterr()
    before = Path("study/study.db").read_bytes()
    for asked in ((), ("--json",)):
        assert typed("withdraw", "study", "--participant", "3", *asked) == 2
        shown = capsys.readouterr()
        assert shown.out == ""
        assert shown.err == (
            "touchbeam: this erases for good: 3/1, imported scores; "
            "add --yes to erase without a question\n"
        )
    assert Path("study/study.db").read_bytes() == before
    assert typed("withdraw", "study", "--participant", "3", "--yes") == 0
    assert "Erased: 3/1." in capsys.readouterr().out
    assert typed("withdraw", "study", "--participant", "3") == 0
    assert "Nothing was left to erase: already withdrawn: 3/1." in capsys.readouterr().out


def test_a_backup_from_before_is_named_until_it_is_made_again(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert typed("import", str(PUBLISHED), "study") == 0
    assert typed("backup", "study", "study/monday.db") == 0
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "3", "--yes") == 0
    assert capsys.readouterr().out.splitlines() == [
        "Erased: 3/1.",
        "Still contains 3: monday.db. Make it again or delete it.",
        ELSEWHERE,
    ]
    Path("study/monday.db").unlink()
    assert typed("backup", "study", "study/monday.db") == 0
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "3", "--json") == 0
    assert json.loads(capsys.readouterr().out)["holding"] == []
