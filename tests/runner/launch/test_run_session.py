"""The start of a session: what the operator is warned of."""

from pathlib import Path

import pytest

from runner.journal.opening import open_journal
from runner.launch.confirmation import nearly_the_same
from tests.runner.fakes import FakeDevice, FakeParticipant, context


@pytest.mark.parametrize(
    ("participant", "known"),
    [("p01", "P01"), ("P1", "P01"), ("P-01", "P01"), ("P01", None), ("P10", None), ("P011", None)],
)
def test_a_pseudonym_that_is_nearly_another_is_noticed(
    tmp_path: Path, participant: str, known: str | None
) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant())
        assert nearly_the_same(journal, participant, rehearsal=False) == known
        assert nearly_the_same(journal, participant, rehearsal=True) is None
