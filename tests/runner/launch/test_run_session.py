"""The start of a session: what the operator is warned of."""

from pathlib import Path

import pytest

from runner.journal.opening import open_journal
from runner.launch.run_session import nearly_the_same
from tests.runner.fakes import FakeDevice, FakeParticipant, context


@pytest.mark.parametrize(
    ("participant", "known"), [("p01", "P01"), ("P01", None), ("P1", None), ("P011", None)]
)
def test_a_pseudonym_that_differs_only_in_capitals_is_noticed(
    tmp_path: Path, participant: str, known: str | None
) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant())
        assert nearly_the_same(journal, participant) == known
