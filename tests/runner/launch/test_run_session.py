"""The start of a session: what the operator is warned of."""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from runner.journal.opening import open_journal
from runner.launch.request import SessionOptions, nearly_the_same, requested, require_meant
from runner.study.folder import StudyFolder
from tests.runner.command_line import typed
from tests.runner.fakes import FakeDevice, FakeParticipant, context
from tests.runner.registered_study import run_session, study_in

BOARD = "/dev/ttyUSB0"


def test_a_session_comes_after_the_earlier_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An excluded one is over, and who has begun a session goes on with it."""
    study_in(tmp_path, "paper", ("[design]", "[design]\nsessions = 3"))

    def asked(number: int, *options: str) -> str:
        folder = StudyFolder(path=tmp_path)
        given = SessionOptions(folder=folder, participant="P01", number=number, device=BOARD)
        request = replace(requested(given), kind="participant")
        require_meant(replace(request, options=replace(given, extra="--extra" in options)), note)
        return told.pop() if told else ""

    told: list[str] = []

    def note(fact: str, option: str) -> None:
        told.append(f"{fact}; {option}")

    no_1 = "P01/2: session 1 of P01 is not completed; finish or exclude it first; if that is meant,"
    assert asked(1) == ""
    assert asked(2) == f"{no_1} add --extra"
    assert asked(2, "--extra") == ""
    run_session(tmp_path, "P01")
    assert asked(2) == ""
    assert asked(3).startswith("P01/3: session 2 of P01 is not completed")
    with suppress(KeyboardInterrupt):
        run_session(tmp_path, "P01", number=2, person=FakeParticipant(stops_at="Welcome"))
    assert asked(2) == ""
    assert asked(3).startswith("P01/3: session 2 of P01 is not completed")
    exclude = ("exclude", tmp_path, "--participant", "P01", "--session", "2", "--reason", "asleep")
    assert typed(*exclude) == 0
    assert asked(3) == ""


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
