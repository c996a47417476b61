"""`touchbeam withdraw` as a user types it: what it erases, and what it says is left."""

import gzip
import json
import shutil
import zipfile
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
STILL = "Still contains {}: {}. Make it again, correct it or delete it."
ELSEWHERE = "Copies, backups, and reports and exports kept elsewhere may still contain the data."


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


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
        *(STILL.format("3", result) for result in old),
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
        "unsearched_files": [],
        "old_caches": [],
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
        STILL.format("3", "monday.db"),
        ELSEWHERE,
    ]
    Path("study/monday.db").unlink()
    assert typed("backup", "study", "study/monday.db") == 0
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "3", "--json") == 0
    assert json.loads(capsys.readouterr().out)["holding"] == []


TABLE = "subject,voltage,structure,pressure\nP01,8,7,5\nP010,9,8,4\nP02,7,6,3\nP03,6,8,4\n"
SINGLE = {
    "page.html": "report/report.html",
    "numbers.json": "report/report.json",
    "table.tex": "report/table4.tex",
    "table.csv": "report/table4.csv",
    "people.svg": "report/figures/people.svg",
    "people.png": "report/figures/people.png",
    "people-column.pdf": "report/figures/people-column.pdf",
    "rows.csv": "csv/trials.csv",
    "touchbeam.tsv": "bids/participants.tsv",
    "monday.db": "monday.db",
}
"""Files of the results, each of which is put where nothing else of them is, by its new name."""
WHOLE = ("report", "csv", "bids", "psychds")


def make_kinds(place: Path, who: str) -> None:
    """Make what touchbeam and people make of the study, in a folder of it, of each kind a file."""
    assert typed("report", "study", "--figures", "--out", "made/report") == 0
    for form in WHOLE[1:]:
        assert typed("export", "study", f"made/{form}", "--format", form) == 0
    assert typed("backup", "study", "made/monday.db") == 0
    (place / "single").mkdir(parents=True)
    for name, result in SINGLE.items():
        shutil.copy(Path("made", result), place / "single" / name)
    for picture in ("people.png", "people-column.pdf"):  # its SVG tells what it holds
        (place / "single" / picture).write_bytes(b"\x89PNG" if "png" in picture else b"%PDF")
    for form in ("zip", "gztar", "xztar"):
        for result in ("csv", "psychds"):
            shutil.make_archive(str(place / f"{result}-{form}"), form, "made", result)
    (place / "backup.gz").write_bytes(gzip.compress(Path("made/monday.db").read_bytes()))
    with zipfile.ZipFile(place / "people.xlsx", "w") as sheet:
        sheet.writestr("xl/sharedStrings.xml", f"<sst><si><t>{who}</t></si></sst>")
    (place / "people.csv").write_text(f"code;age\n{who};30\n")
    (place / "diary").write_text(f"{who} was late.", encoding="utf-16")
    (place / "registration.md").write_text(f"{who} is a pilot.")
    (place / f"{who} consent.pdf").write_bytes(b"%PDF")
    for result in WHOLE:
        shutil.move(Path("made", result), place / result)
    Path("made/monday.db").unlink()


@pytest.mark.usefixtures("figures_as_svg")
def test_a_person_is_found_in_each_kind_of_file_and_in_none_about_others(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("table.csv").write_text(TABLE)
    assert typed("import", "table.csv", "study") == 0
    make_kinds(Path("study/before"), "P01")
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "P01", "--yes") == 0
    told = capsys.readouterr().out
    # What holds others, and is made after the withdrawal.
    make_kinds(Path("study/after"), "P010")
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "P01", "--json") == 0
    results = json.loads(capsys.readouterr().out)
    files = {str(path) for path in Path("study/before").iterdir() if path.name != "single"}
    files |= {str(path) for path in Path("study/before/single").iterdir()}
    assert len(files) == len(WHOLE) + len(SINGLE) + 6 + 6
    assert {f"study/{name}" for name in results["holding"]} == files
    assert results["unsearched_files"] == ["after/P010 consent.pdf"]
    assert [line for line in told.splitlines() if line.startswith("Still")] == [
        STILL.format("P01", result) for result in results["holding"]
    ]


def test_the_cache_of_an_earlier_version_is_named_if_there_is_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("import", str(PUBLISHED), "study") == 0
    (tmp_path / "cache" / "touchbeam").mkdir(parents=True)
    capsys.readouterr()
    assert typed("withdraw", "study", "--participant", "3", "--yes") == 0
    assert capsys.readouterr().out.splitlines() == [
        "Erased: 3/1.",
        "Earlier versions of touchbeam kept results, scores of people among them, which nothing "
        f"reads any more; delete them: rm -r {tmp_path / 'cache' / 'touchbeam'}",
        ELSEWHERE,
    ]
