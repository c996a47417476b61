"""A registered study with sessions that count, run in this process without a real device."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from protocol.journal.events import SessionOpened, StoredEvent
from protocol.journal.records import PlannedTrial
from protocol.plan.plan import plan
from protocol.plan.trials import planned_trial
from protocol.registration.registration import locked
from protocol.study.participant_texts import study_wording
from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import journal_if_used, read_journal
from runner.journal.store import SessionLog
from runner.launch.request import Request, SessionOptions
from runner.launch.run_session import opened_session
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.study.folder import StudyFolder
from runner.study.registered import registration_of
from tests.runner.command_line import typed
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator, FakeParticipant

LATER_S = 3e8
"""After every registration: fake clocks begin in January 2026."""


def study_in(folder: Path, name: str = "paper", *changes: tuple[str, str]) -> Path:
    text = template(name)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    folder.mkdir(exist_ok=True)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder


def registered_in(folder: Path, name: str = "paper", *changes: tuple[str, str]) -> Path:
    assert typed("register", study_in(folder, name, *changes)) == 0
    return folder


def run_session(
    place: Path,
    participant: str,
    *,
    number: int = 1,
    kind: Any = "participant",
    device: FakeDevice | None = None,
    person: FakeParticipant | None = None,
    override: str | None = None,
    group: str | None = None,
    noted: Mapping[str, str] | None = None,
    operator: FakeOperator | None = None,
) -> None:
    """Run or resume a session as `touchbeam run` does; without `device` and `person` to its end."""
    folder = StudyFolder(path=place)
    options = SessionOptions(
        folder=folder,
        participant=participant,
        number=number,
        rehearsal=kind == "rehearsal",
        override=override,
        group=group,
        noted=noted or {},
    )
    study, clock = folder.study(), FakeClock(LATER_S)
    request = Request(
        options=options,
        study=study,
        text=folder.text(),
        wording=study_wording(study, "en"),
        url="sim",
        pace="stepped",
        kind=kind,
        registration=registration_of(place),
    )
    device = device or FakeDevice()
    with journal_if_used(folder.journal) as journal:
        new = request.chain(journal) not in journal.sessions()
        session = opened_session(request, journal, clock)
        context = SessionContext(
            session=session,
            device=device,
            participant=person or FakeParticipant(),
            operator=operator or FakeOperator(device),
            clock=clock,
            log=SessionLog(journal, request.chain(journal), clock),
            opened_now=new,
        )
        run(context)


def drawn_again(opened: SessionOpened) -> tuple[PlannedTrial, ...]:
    """Return the trials that the registration's digest gives a session, from what it recorded."""
    assert opened.study_text is not None
    assert opened.slot is not None
    study = locked(parsed_study(opened.study_text), opened.registration).of_group(opened.group)
    return tuple(map(planned_trial, plan(study, opened.slot, opened.session).trials))


def events_of(place: Path, chain: str) -> list[StoredEvent]:
    with read_journal(place / "study.db") as journal:
        return journal.events(chain)
