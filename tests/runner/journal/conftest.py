"""What the tests of journals begin with."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from runner.journal.opening import open_journal
from runner.journal.store import Journal


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[Journal]:
    """Return an empty journal."""
    with open_journal(tmp_path / "study.db") as journal:
        yield journal
