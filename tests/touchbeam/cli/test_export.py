"""`touchbeam export` as a user types it: files, messages, exit codes, and nothing left behind."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from runner.journal.names import session_name
from runner.journal.opening import open_journal
from tests.analysis.export.data_slips import bids_slips, csv_rows, psychds_slips
from tests.analysis.hostile_study import sessions, study_text
from tests.runner.command_line import TOUCHBEAM, typed
from tests.runner.journal.tampering import tampering

VALIDATOR = str(Path(sys.executable).with_name("bids-validator-deno"))
PUBLISHED = Path(__file__).parents[2] / "data" / "published_scores.csv"


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo's study, with two virtual participants."""
    folder = tmp_path_factory.mktemp("demo") / "demo"
    command = [TOUCHBEAM, "demo", "--out", str(folder), "--participants", "2"]
    subprocess.run(command, check=True, capture_output=True)
    return folder


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study whose journal contains the hostile sessions."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "study.toml").write_text(study_text(), encoding="utf-8")
    with open_journal(folder / "study.db") as journal:
        for session in sessions(study_text()):
            for event in session.events:
                journal.append(session_name(session.participant, session.number), event)
        journal.checkpoint()
    return folder


@pytest.fixture
def study(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the recorded study; the working folder is beside it."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(recorded, tmp_path / "study"))


def contents(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes().decode()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix not in {".pdf", ".png"}
    }


def everything() -> set[Path]:
    """All paths but the files that SQLite keeps beside a database while it is read."""
    return {path for path in Path().rglob("*") if not path.name.startswith("study.db-")}


def test_the_demo_passes_the_official_validator(demo: Path, tmp_path: Path) -> None:
    assert typed("export", demo, tmp_path / "bids", "--format", "bids", "--rehearsals") == 0
    shown = subprocess.run(
        [VALIDATOR, str(tmp_path / "bids"), "--format", "json"],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(shown.stdout)
    assert sorted(found["summary"]["subjects"]) == ["P01", "P02"]
    assert {issue["severity"] for issue in found["issues"]["issues"]} == {"warning"}
    assert list(bids_slips(contents(tmp_path / "bids"))) == []


def test_the_demo_as_one_table_has_its_scores(demo: Path, tmp_path: Path) -> None:
    assert typed("export", demo, tmp_path / "csv", "--format", "csv", "--rehearsals") == 0
    rows = csv_rows(contents(tmp_path / "csv")["trials.csv"])
    table = (demo / "report" / "table4.csv").read_text().splitlines()
    names = table[0].split(",")[1:-1]
    for line in table[1:-1]:
        who, *scores = line.split(",")[:-1]
        mine = {row["condition"]: row["score"] for row in rows if row["participant"] == who}
        assert [mine[name] for name in names] == scores
    assert {row["session_kind"] for row in rows} == {"rehearsal"}
    assert all(float(row["resonance_hz"]) > 20_000 for row in rows)


def test_the_demo_is_psychds(demo: Path, tmp_path: Path) -> None:
    assert typed("export", demo, tmp_path / "psychds", "--format", "psychds", "--rehearsals") == 0
    assert list(psychds_slips(contents(tmp_path / "psychds"))) == []


def test_rehearsals_alone_are_exported_only_on_request(
    demo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("export", demo, tmp_path / "csv", "--format", "csv") == 2
    shown = capsys.readouterr()
    assert shown.err == "touchbeam: nothing but rehearsals here; add --rehearsals to include them\n"
    assert list(tmp_path.iterdir()) == []


def test_the_journal_gives_the_same_bytes_each_time(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("one", "two"):
        assert typed("export", study, name, "--format", "bids") == 0
    assert contents(Path("one")) == contents(Path("two"))
    assert capsys.readouterr().out.splitlines()[0] == (
        "Written: one, 37 trials of 5 participants (8 trials excluded, marked); left out: "
        "1 rehearsal, 1 withdrawn session"
    )


def test_withdrawn_participants_are_left_out(study: Path) -> None:
    assert typed("withdraw", study, "--participant", "P01", "--yes") == 0
    assert typed("export", study, "csv", "--format", "csv") == 0
    rows = csv_rows(contents(Path("csv"))["trials.csv"])
    assert {row["participant"] for row in rows} == {"P-01", "p_01", "D01", "E01"}
    people = csv_rows(contents(Path("csv"))["participants.csv"])
    assert [row["participant"] for row in people] == ["P-01", "p_01", "D01", "E01"]


@pytest.mark.parametrize("form", ["csv", "bids", "psychds"])
def test_one_participant_gets_their_own_data_and_nothing_of_others(study: Path, form: str) -> None:
    assert typed("export", study, "all", "--format", "csv") == 0
    assert typed("export", study, "mine", "--format", form, "--participant", "P01") == 0
    texts = contents(Path("mine"))
    everybody = csv_rows(contents(Path("all"))["trials.csv"])
    mine = [row for row in everybody if row["participant"] == "P01"]
    others = {row["participant"] for row in everybody} - {"P01"}
    assert mine
    assert others
    tables = [
        text
        for name, text in texts.items()
        if name.endswith(("trials.csv", "_data.csv", "_beh.tsv"))
    ]
    assert sum(len(text.splitlines()) - 1 for text in tables) == len(mine)
    for other in others:
        assert not any(re.search(rf"(?<![\w-]){other}(?![\w-])", text) for text in texts.values())
    if form == "csv":
        assert csv_rows(texts["trials.csv"]) == mine


@pytest.mark.parametrize(
    ("name", "hint"),
    [("P77", "touchbeam status lists the participants"), ("p01", "did you mean P01?")],
)
def test_a_participant_without_a_session_is_not_exported(
    study: Path, capsys: pytest.CaptureFixture[str], name: str, hint: str
) -> None:
    assert typed("export", study, "mine", "--format", "csv", "--participant", name) == 2
    expected = f"touchbeam: {name} has no session in this study; {hint}\n"
    assert capsys.readouterr().err == expected
    assert not Path("mine").exists()


def test_a_published_table_is_exported_unchanged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert typed("import", PUBLISHED, "published") == 0
    assert typed("export", "published", "published/export", "--format", "csv") == 0
    rows = csv_rows(contents(Path("published/export"))["trials.csv"])
    for subject in csv_rows(PUBLISHED.read_text()):
        who, *given = subject.values()
        mine = {row["condition"]: row["score"] for row in rows if row["participant"] == who}
        assert [float(mine[name]) for name in list(subject)[1:]] == [float(x) for x in given]


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("Table 4.csv", "Table 4"),
        ('a "b" \\c\x1b.csv', 'a "b" \\c\ufffd'),
        ("x" * 200 + ".csv", "x" * 64),
        ("触觉.csv", "触觉"),
        (".csv", ".csv"),
    ],
)
def test_an_imported_study_is_named_after_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path(file).write_text(PUBLISHED.read_text())
    assert typed("import", file, "published") == 0
    assert typed("export", "published", "out", "--format", "bids") == 0
    described = json.loads(Path("out/dataset_description.json").read_text(encoding="utf-8"))
    assert described["Name"] == name
    assert list(bids_slips(contents(Path("out")))) == []


def test_a_changed_journal_is_reported_and_exported_with_a_warning(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with tampering(study / "study.db") as other:
        other.execute(
            "UPDATE event SET payload = json_set(payload, '$.score', 9) "
            "WHERE tag = 'answered' AND session IN ('P-01/1', 'P01/2')"
        )
    warning = (
        "touchbeam: warning: the journal was modified outside touchbeam, in P-01/1, "
        "P01/2; see touchbeam verify study\n"
    )
    for name in ("csv", "bids", "psychds"):
        assert typed("export", study.name, name, "--format", name) == 0
        assert capsys.readouterr().err == warning
        page = contents(Path(name))["README.md"]
        assert 0 <= page.index("**Changed journal.**") < 100
        assert "broken in P-01/1, P01/2;" in page
    assert typed("report", study.name, "--json", "--sections", "table4") == 0
    shown = capsys.readouterr()
    assert shown.err == warning
    found = json.loads(shown.out)
    assert found["broken_chains"] == ["P-01/1", "P01/2"]
    assert "broken in P-01/1, P01/2;" in found["provenance"]["journal"]
    page = (study / "report" / "report.html").read_text()
    assert page.index("<strong>Changed journal.</strong>") < page.index("<h2")


def test_an_intact_journal_gives_no_warning(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("export", study, "csv", "--format", "csv") == 0
    assert capsys.readouterr().err == ""
    tables = ("trials", "touches", "contrasts", "participants")
    assert set(contents(Path("csv"))) == {f"{it}.{end}" for it in tables for end in ("csv", "json")}
    assert typed("report", study, "--json", "--sections", "table4") == 0
    shown = capsys.readouterr()
    assert (shown.err, json.loads(shown.out)["broken_chains"]) == ("", [])
    assert "Changed journal" not in (study / "report" / "report.html").read_text()


def test_many_changed_sessions_give_one_short_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{who},3,4\n" for who in range(12))
    Path("scores.csv").write_text(f"subject,voltage,pressure\n{rows}")
    assert typed("import", "scores.csv", "study") == 0
    with tampering(Path("study/study.db")) as other:
        other.execute("UPDATE event SET utc = '2026-01-01T00:00:00+00:00'")
    assert typed("export", "study", "csv", "--format", "csv") == 0
    assert "9/1 and 2 more; see touchbeam verify study" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nowhere", "out", "--format", "csv"), "nowhere: no sessions here"),
        (
            ("study", "full", "--format", "csv"),
            "full: must be a new or empty folder, but it contains files",
        ),
        (("study", "file", "--format", "csv"), "file: must be a new or empty folder, got a file"),
        (("study", "file/out", "--format", "csv"), "file/out: Not a directory"),
        (
            ("study", "out", "--format", "xlsx"),
            "'xlsx' is not one of 'csv', 'bids', 'psychds'",
        ),
        (
            ("study", "out", "--format", "rocrate"),
            "'rocrate' is not one of 'csv', 'bids', 'psychds'",
        ),
        (("study", "out"), "Missing option '--format'"),
        (("study", "--format", "csv"), "Missing argument 'DIR'"),
    ],
)
def test_bad_input_is_one_clear_line_and_changes_nothing(
    study: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], message: str
) -> None:
    Path("full").mkdir()
    Path("full/mine.txt").write_text("mine")
    Path("file").write_text("mine")
    before = everything()
    assert typed("export", *arguments) == 2
    shown = capsys.readouterr()
    assert (shown.out, shown.err.count("\n")) == ("", 1)
    assert re.search(message, shown.err), shown.err
    assert everything() == before


def test_a_study_file_that_cannot_be_used_stops_the_export(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (study / "study.toml").read_text().replace("licence", "license")
    (study / "study.toml").write_text(text)
    assert typed("export", study, "out", "--format", "bids") == 2
    assert "unknown key, got 'license'; did you mean 'licence'?" in capsys.readouterr().err
    assert not Path("out").exists()
