"""The versions of touchbeam that wrote a session, told to the operator and by `verify`."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.journal.verification import verdicts
from runner.launch.request import SessionOptions
from runner.launch.run_session import run_session
from runner.study.folder import StudyFolder
from tests.runner.fakes import FakeClock, FakeDevice, FakeParticipant, context
from touchbeam import __version__


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A study with a session that version 0.0.9 opened."""
    (tmp_path / "study.toml").write_text(template("paper"))
    with monkeypatch.context() as patched, open_journal(tmp_path / "study.db") as journal:
        patched.setattr("runner.session.session.version", lambda _: "0.0.9")
        patched.setattr(FakeClock, "utc", lambda _: datetime.now(UTC))
        context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal")
    return tmp_path


def said_on_resuming(folder: Path) -> list[str]:
    said: list[str] = []
    options = SessionOptions(
        folder=StudyFolder(path=folder),
        participant="P01",
        ratings="virtual",
    )
    run_session(options, said.append)
    return [line for line in said if "recorded by touchbeam" in line]


def test_another_version_is_told_to_the_operator_and_named_by_verify(folder: Path) -> None:
    assert said_on_resuming(folder) == [
        f"P01/1 was last recorded by touchbeam 0.0.9 and continues with {__version__}."
    ]
    with open_journal(folder / "study.db") as journal:
        (verdict,) = verdicts(journal)
    assert verdict.versions == ("0.0.9", __version__)
    assert verdict.ok
    versions = f"0.0.9, {__version__}"
    assert verdict.line().endswith(f"; written by several versions of touchbeam: {versions}")


def test_the_same_version_is_not_mentioned(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runner.session.session.version", lambda _: "0.0.9")
    assert said_on_resuming(folder) == []
    with open_journal(folder / "study.db") as journal:
        (verdict,) = verdicts(journal)
    assert verdict.versions == ("0.0.9",)
    assert "versions" not in verdict.line()
