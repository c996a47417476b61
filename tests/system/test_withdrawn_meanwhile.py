"""Nobody who withdraws while their data are being written is in what was written."""

from pathlib import Path
from typing import Any

import pytest

from protocol.errors import WorkFailed
from runner.journal import verification
from runner.journal.opening import read_journal
from runner.journal.store import Journal
from runner.study import files
from tests.runner.command_line import typed
from touchbeam.study import load

PUBLISHED = Path(__file__).parents[1] / "data" / "published_scores.csv"
SAID = "somebody withdrew meanwhile, so nothing is written; make it again"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    assert typed("import", PUBLISHED, tmp_path / "study") == 0
    return tmp_path / "study"


def withdraw(study: Path) -> None:
    assert typed("withdraw", study, "--participant", "3", "--yes") == 0


@pytest.mark.parametrize(
    "command",
    [
        ["export", "--format", "csv"],
        ["export", "--format", "bids"],
        ["export", "--format", "psychds"],
        ["report", "--sections", "table4", "--out"],
    ],
    ids=lambda command: " ".join(command[:3]),
)
def test_no_writer_leaves_a_person_who_withdrew_meanwhile(
    study: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: list[str],
) -> None:
    name, *options = command
    out, create = tmp_path / "out", files.create

    def withdrawing(path: Path, data: bytes, mode: int) -> None:
        create(path, data, mode)
        if path.is_relative_to(tmp_path) and not path.is_relative_to(study):
            monkeypatch.setattr(files, "create", create)
            withdraw(study)

    monkeypatch.setattr(files, "create", withdrawing)
    where = [str(out)] if options[-1] != "--out" else []
    arguments = [*where, *options, *([] if where else [str(out)])]
    assert typed(name, study, *arguments) == 1
    assert SAID in capsys.readouterr().err
    assert not out.exists()
    assert typed(name, study, *arguments) == 0


def test_what_was_loaded_before_somebody_withdrew_is_reported_no_more(
    study: Path, tmp_path: Path
) -> None:
    loaded = load(study)
    withdraw(study)
    with pytest.raises(WorkFailed, match=SAID):
        loaded.report(tmp_path / "out", sections="table4")
    assert not (tmp_path / "out").exists()
    load(study).report(tmp_path / "out", sections="table4")


def test_no_backup_holds_a_person_who_withdrew_while_it_was_verified(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    verdicts = verification.verdicts

    def slowly(journal: Journal) -> Any:
        withdraw(study)
        return verdicts(journal)

    monkeypatch.setattr(verification, "verdicts", slowly)
    assert typed("backup", study, tmp_path / "copy.db") == 1
    assert SAID in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["study"]
    monkeypatch.undo()
    assert typed("backup", study, tmp_path / "copy.db") == 0
    with read_journal(tmp_path / "copy.db") as journal:
        assert journal.withdrawals() == 1


def test_a_rehearsal_that_was_withdrawn_is_counted_where_rehearsals_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "study"
    assert typed("new", study) == 0
    for name in ("P01", "P02"):
        assert typed("run", study, "--participant", name, "--ratings", "virtual") == 0
    assert typed("withdraw", study, "--participant", "P01", "--rehearsal", "--yes") == 0
    capsys.readouterr()
    for kind in ("csv", "bids"):
        out = tmp_path / kind
        assert typed("export", study, out, "--format", kind, "--rehearsals") == 0
        assert "left out: 0 rehearsals, 1 withdrawn session\n" in capsys.readouterr().out
    assert typed("export", study, tmp_path / "none", "--format", "csv") == 2
