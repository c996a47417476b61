"""The studies that a journal accepts: those of its sessions and amendments, in order."""

from pathlib import Path

from protocol.journal.events import SessionOpened, StudyRegistered
from protocol.study_file.loading import template, text_digest
from runner.clock import WallClock
from runner.journal.amendments import accepted_digests, amend, withdraw
from runner.journal.names import STUDY_CHAIN
from runner.journal.opening import open_journal
from runner.journal.store import SessionLog
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
