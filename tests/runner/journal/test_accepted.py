"""The studies that a journal accepts: those of its sessions and amendments, in order."""

from dataclasses import replace
from pathlib import Path

import pytest

from protocol.errors import BadInput
from protocol.journal.events import SessionOpened, StudyRegistered
from protocol.study_file.loading import template, text_digest
from runner.clock import WallClock
from runner.journal.amendments import (
    accepted_digests,
    amend,
    changed_since_rehearsal,
    exclude,
    is_locked,
    withdraw,
)
from runner.journal.names import STUDY_CHAIN
from runner.journal.opening import open_journal, read_journal
from runner.journal.store import SessionLog
from runner.journal.verification import verdicts
from runner.session.loop import require_resumable
from tests.runner.command_line import typed
from tests.runner.fakes import FakeDevice, FakeParticipant, context

CLOCK = WallClock()


def amended(text: str) -> str:
    return text.replace("hold_s = 2.0", "hold_s = 3.0")


def test_the_accepted_studies_are_those_of_readable_events_in_order(tmp_path: Path) -> None:
    text = template("paper")
    with open_journal(tmp_path / "study.db") as journal:
        assert accepted_digests(journal) == []
        context(journal, FakeDevice(), FakeParticipant(), text)
        amend(journal, CLOCK, amended(text), "longer touches")
        first, second = text_digest(text), text_digest(amended(text))
        assert accepted_digests(journal) == [first, second]
        amend(journal, CLOCK, text, "as it was")
        assert accepted_digests(journal) == [first, second, first]
        withdraw(journal, CLOCK, "P01")
        assert accepted_digests(journal) == [second, first]


def test_rehearsals_accept_nothing_and_need_no_acceptance(tmp_path: Path) -> None:
    text = template("paper")
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant(), text, kind="rehearsal")
        # As an earlier version needed.
        amend(journal, CLOCK, amended(text), "between rehearsals")
        assert not is_locked(journal)
        assert accepted_digests(journal) == []
        for told in (text, amended(text)):
            asked = context(journal, FakeDevice(), FakeParticipant(), told, kind="rehearsal")
            require_resumable(journal, asked.session, None, CLOCK.utc())
            assert changed_since_rehearsal(journal, told) is (told != text)
        first = context(journal, FakeDevice(), FakeParticipant(), text).session
        assert accepted_digests(journal) == [text_digest(amended(text)), text_digest(text)]
        changed = replace(first, study_text=amended(text))
        with pytest.raises(BadInput, match="has changed since the last session"):
            require_resumable(journal, changed, None, CLOCK.utc())
        require_resumable(journal, replace(changed, kind="rehearsal"), None, CLOCK.utc())
        assert all(verdict.ok for verdict in verdicts(journal))
        withdraw(journal, CLOCK, "P01")
        assert is_locked(journal), "by a session that was erased"


def test_another_scale_is_not_accepted_once_scores_were_given(tmp_path: Path) -> None:
    wider = template("paper").replace("[rating]", "[rating]\nmaximum = 20", 1)
    wider = wider.replace("from = 8, to = 10", "from = 8, to = 20")
    message = r"from 0 to 20, but those of P01/1 were given from 0 to 10; restore \[rating\]"
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant(), template("paper"))
        with pytest.raises(BadInput, match=message):
            amend(journal, CLOCK, wider, "finer")
        exclude(journal, CLOCK, "P01/1", "of another scale")
        assert amend(journal, CLOCK, wider, "finer") is None


def test_a_registration_locks_a_study_that_was_only_rehearsed(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal")
        registered = StudyRegistered(registration="7" * 64, study_sha256="8" * 64, text="")
        SessionLog(journal, STUDY_CHAIN, CLOCK).append(registered)
        assert accepted_digests(journal) == ["8" * 64]


def test_nothing_is_amended_between_rehearsals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = ("run", tmp_path, "--participant", "P01", "--ratings", "virtual")
    (tmp_path / "study.toml").write_text(template("paper"), encoding="utf-8")
    assert typed(*run) == 0
    (tmp_path / "study.toml").write_text(amended(template("paper")), encoding="utf-8")
    capsys.readouterr()
    assert typed("amend", tmp_path, "--reason", "longer touches") == 0
    told = "Nothing to accept: rehearsals do not lock study.toml, the first session does.\n"
    assert capsys.readouterr().out == told
    with read_journal(tmp_path / "study.db") as journal:
        assert journal.sessions() == ["P01/1 (rehearsal)"]


def test_a_session_of_an_early_build_does_not_say_which_study_it_accepted(tmp_path: Path) -> None:
    told = {"participant": "P01", "kind": "participant", "conditions": [], "trials": []}
    with open_journal(tmp_path / "study.db") as journal:
        SessionLog(journal, "P01/1", CLOCK).append(SessionOpened.from_json(told))
        assert accepted_digests(journal) == []


def test_an_amendment_tells_which_registration_it_breaks(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        assert amend(journal, CLOCK, template("paper"), "nothing was registered") is None
        registered = StudyRegistered(registration="7" * 64, study_sha256="8" * 64, text="")
        SessionLog(journal, STUDY_CHAIN, CLOCK).append(registered)
        assert amend(journal, CLOCK, template("paper"), "another study") == registered
