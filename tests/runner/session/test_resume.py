"""Which study files and which of a study's sessions a command goes on with."""

from pathlib import Path

import pytest

from protocol.errors import BadInput
from protocol.study_file.loading import template
from runner.clock import WallClock
from runner.journal.amendments import amend
from runner.journal.cohort import states
from runner.journal.opening import open_journal
from runner.journal.store import JournalError
from runner.journal.verification import verdicts
from runner.session.loop import require_resumable, run
from tests.runner.command_line import typed
from tests.runner.fakes import FakeClock, FakeDevice, FakeParticipant, context
from tests.runner.journal.tampering import tampering

CLOCK = WallClock()


def amended(text: str) -> str:
    return text.replace("hold_s = 2.0", "hold_s = 3.0")


def test_a_changed_study_needs_an_amendment(tmp_path: Path) -> None:
    text = template("paper")
    with open_journal(tmp_path / "study.db") as journal:
        session = context(journal, FakeDevice(), FakeParticipant(), text).session
        changed = context(journal, FakeDevice(), FakeParticipant(), amended(text)).session
        state = states(journal)["P01/1"]
        require_resumable(journal, session, state, FakeClock().utc())
        with pytest.raises(BadInput, match=r"has changed since the last session; .* amend"):
            require_resumable(journal, changed, state, FakeClock().utc())
        amend(journal, CLOCK, amended(text), "longer touches")
        require_resumable(journal, changed, state, FakeClock().utc())
        with pytest.raises(BadInput, match="nothing to amend"):
            amend(journal, CLOCK, amended(text), "again")
        with pytest.raises(BadInput, match="has changed since"):
            require_resumable(journal, session, state, FakeClock().utc())
        assert all(verdict.ok for verdict in verdicts(journal))
        lines = [verdict.line() for verdict in verdicts(journal)]
        assert "ok    the study itself  amended  1 event, chain unbroken" in lines


def test_a_session_is_not_resumed_with_different_trials(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant())
        fixed = template("paper").replace('order = "williams"', 'order = "fixed"')
        amend(journal, CLOCK, fixed, "simpler")
        other = context(journal, FakeDevice(), FakeParticipant(), fixed).session
        now, before = FakeClock().utc(), states(journal)["P01/1"]
        told = r"P01/1 cannot go on, .* other trials now; its answers \(0\) stay; begin anew with "
        with pytest.raises(BadInput, match=f"{told}--session 2 --extra"):
            require_resumable(journal, other, before, now)


def test_a_stale_session_is_not_resumed(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant())
        later = FakeClock(passed_s=25 * 3600)
        with pytest.raises(BadInput, match="interrupted 25 h ago and must be resumed within 24 h"):
            require_resumable(journal, made.session, states(journal)["P01/1"], later.utc())


def test_a_session_from_the_future_is_not_resumed(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant())
        before = FakeClock(passed_s=-25 * 3600)
        with pytest.raises(BadInput, match="lies in the future; check this computer's clock"):
            require_resumable(journal, made.session, states(journal)["P01/1"], before.utc())


@pytest.mark.parametrize("column", ["utc = '2026-01-02T00:00:00+00:00'", "hash = 'x'"])
def test_a_session_with_a_broken_chain_is_not_resumed(tmp_path: Path, column: str) -> None:
    path = tmp_path / "study.db"
    with open_journal(path) as journal:
        made = context(journal, FakeDevice(), FakeParticipant())
        with tampering(path) as other:
            other.execute(f"UPDATE event SET {column} WHERE seq = 0")
        with pytest.raises(JournalError, match="P01/1: cannot resume, because its chain of events"):
            require_resumable(journal, made.session, states(journal)["P01/1"], FakeClock().utc())


def test_a_rehearsed_name_is_free_for_the_session_itself(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal"))
        session = context(journal, FakeDevice(), FakeParticipant())
        assert session.opened_now
        run(session)
        assert [(each.participant, each.kind, each.state) for each in verdicts(journal)] == [
            ("P01", "rehearsal", "completed"),
            ("P01", "participant", "completed"),
        ]
        assert all(verdict.ok for verdict in verdicts(journal))
        assert verdicts(journal)[0].line().startswith("ok    P01/1 (rehearsal)  completed")
        rehearsed = context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal").session
        state = states(journal)["P01/1 (rehearsal)"]
        with pytest.raises(
            BadInput, match=r"^the rehearsal P01/1 is already completed; to rehearse again"
        ):
            require_resumable(journal, rehearsed, state, FakeClock().utc())


def test_an_amendment_names_the_sessions_that_it_leaves_unfinished(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, file = template("threshold"), tmp_path / "study.toml"
    file.write_text(text.replace("trials = 40", "trials = 30"), encoding="utf-8")
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant(), text)
    now = "cannot go on, because the study has other trials now; its answers (0) stay"

    def told(*arguments: str | Path) -> str:
        assert typed(*arguments) == 0
        return capsys.readouterr().out.replace("\n", " ")

    assert now not in told("status", tmp_path), "the file may be restored"
    said = told("amend", tmp_path, "--reason", "shorter")
    assert "but for those named below" in said
    for line in (said, told("status", tmp_path)):
        assert f"{now}; begin anew: touchbeam run" in line
        assert "--participant P01 --session 2 --extra" in line
        assert "go on before" not in line
