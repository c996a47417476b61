"""What the tests of journals begin with."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.journal.store import Journal
from runner.session.loop import run
from tests.runner.fakes import FakeDevice, FakeParticipant, context


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    """Return an empty journal."""
    with open_journal(tmp_path / "study.db") as journal:
        yield journal


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A study with one finished session."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "study"
    folder.mkdir()
    (folder / "study.toml").write_text(template("paper"))
    with open_journal(folder / "study.db") as journal:
        run(context(journal, FakeDevice(), FakeParticipant()))
    return folder
