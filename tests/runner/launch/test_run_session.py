"""The start of a session: what the operator is warned of."""

from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from protocol.errors import BadInput
from protocol.journal.events import SessionOpened
from protocol.journal.state import SessionState
from protocol.study_file.loading import StudyError
from runner.journal.cohort import due_between, due_in_words, states
from runner.journal.opening import open_journal
from runner.launch.request import (
    SessionOptions,
    nearly_the_same,
    refused,
    requested,
    require_meant,
)
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
        request = replace(request, options=replace(given, extra="--extra" in options))
        require_meant(request, note, datetime.now(UTC))
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


def test_a_session_begins_when_it_is_due_or_with_a_reason(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path, "paper", ("[design]", "[design]\nsessions = 2\nhours_between = [20, 72]"))
    run_session(tmp_path, "P01")
    with open_journal(tmp_path / "study.db") as journal:
        over = states(journal)["P01/1"].completed_utc
    assert over is not None

    def begins(hours: float, override: str | None = None, number: int = 2) -> None:
        given = SessionOptions(
            folder=StudyFolder(path=tmp_path),
            participant="P01",
            number=number,
            device=BOARD,
            override=override,
        )
        request = replace(requested(given), kind="participant")
        require_meant(request, refused, over + timedelta(hours=hours))

    for hours in (1, 19.99, 72.01):
        with pytest.raises(BadInput, match=r"P01/2 is due from .* to .*; add --override REASON"):
            begins(hours)
        begins(hours, "the train was late")
    begins(20)
    begins(72)
    begins(1, number=1)
    assert typed("status", tmp_path) == 0
    due = due_in_words((over + timedelta(hours=20), over + timedelta(hours=72)))
    assert f"1 of 2 sessions, next {due}: " in capsys.readouterr().out
    run_session(tmp_path, "P01", number=2, override="the train was late")
    with open_journal(tmp_path / "study.db") as journal:
        opened = states(journal)["P01/2"].opened
    assert isinstance(opened, SessionOpened)
    assert opened.override == "the train was late"
    assert typed("status", tmp_path, "--json") == 0
    assert '"next_due_utc": []' in capsys.readouterr().out


def test_the_next_session_is_told_while_one_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    study_in(tmp_path, "paper", ("[design]", "[design]\nsessions = 2\nhours_between = [20, 72]"))

    def ran(number: int, *options: str) -> str:
        def in_this_process(asked: SessionOptions, **_: object) -> SessionState:
            run_session(tmp_path, asked.participant, number=asked.number)
            with open_journal(tmp_path / "study.db") as journal:
                return states(journal)[f"P01/{number}"]

        monkeypatch.setattr("runner.launch.run_session.run_session", in_this_process)
        given = ("run", tmp_path, "--participant", "P01", "--session", number, *options)
        assert typed(*map(str, given)) == 0
        return capsys.readouterr().out

    def leave_out(number: int) -> None:
        given = ("exclude", tmp_path, "--participant", "P01", "--session", number)
        assert typed(*map(str, (*given, "--reason", "asleep"))) == 0
        capsys.readouterr()

    with_next = "P01/{} is complete: 7 trials answered, device off (read back); the next session is"
    assert ran(1).startswith(with_next.format(1))
    leave_out(1)
    assert ran(2).startswith(with_next.format(2)), "one of two counts"
    assert ran(3, "--extra").endswith("device off (read back).\n")


def test_a_session_may_be_due_at_any_time_after_the_least_hours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path, "paper", ("[design]", "[design]\nsessions = 2\nhours_between = [20, inf]"))
    run_session(tmp_path, "P01")
    study = StudyFolder(path=tmp_path).study()
    with open_journal(tmp_path / "study.db") as journal:
        state = states(journal)["P01/1"]
    assert state.completed_utc is not None
    due = due_between(study, state)
    assert due is not None
    assert due[0] == state.completed_utc + timedelta(hours=20)
    assert due[1] > state.completed_utc + timedelta(days=36_500)
    assert due_in_words(due).endswith(" on")
    assert typed("status", tmp_path, "--json") == 0
    assert "9999" not in capsys.readouterr().out


def test_more_hours_between_sessions_than_the_calendar_has_are_refused(tmp_path: Path) -> None:
    given = "[design]\nsessions = 2\nhours_between = [20, 1e300]"
    study_in(tmp_path, "paper", ("[design]", given))
    with pytest.raises(StudyError, match="at most 87600, ten years, or inf at the end, got 20 to"):
        StudyFolder(path=tmp_path).study()


def test_a_rehearsal_out_of_turn_or_of_a_group_by_chance_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study_in(tmp_path, "paper", ("[design]", "[design]\nsessions = 2"))
    with (tmp_path / "study.toml").open("a") as file:
        file.write('[[group]]\nname = "young"\nsize = 4\n[[group]]\nname = "old"\nsize = 5\n')

    def shown(number: int) -> str:
        run = ("run", tmp_path, "--participant", "P01", "--session", number, "--ratings", "virtual")
        assert typed(*map(str, run)) == 0
        return capsys.readouterr().out

    early, again = shown(2), shown(1)
    assert "WARNING: session 1 of P01 is not completed." in early
    assert ", drawn by chance for this rehearsal: --group names another." in early
    assert "WARNING" not in again
    assert "by chance" not in again  # it has a group by now


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
