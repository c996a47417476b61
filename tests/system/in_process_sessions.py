"""Sessions of virtual participants in this process, on simulated time, with a real journal."""

from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from unittest.mock import patch

from analysis.loading.study_data import StudyData, load_study_data
from device.friction.changes import LAW, RUNG
from device.people.person import Population, person_of, session_name
from device.simulator.in_process import InProcessDevice, in_process_rig
from device.study_limits import device_limits
from protocol.study.participant_texts import study_wording
from protocol.study.rules import Exclusions
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study
from runner.journal.opening import journal_if_used
from runner.journal.store import Journal, SessionLog
from runner.launch.request import Request, SessionOptions
from runner.launch.run_session import opened_session
from runner.people.operator_console import OperatorConsole, PlainDisplay
from runner.people.virtual_participant import VirtualParticipant, VirtualParticipantLeft
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.study.folder import StudyFolder
from tests.device.in_process_clock import InProcessClock


def loaded_rehearsals(
    folder: Path,
    text: str,
    people: int,
    seed: int,
    law: str = LAW,
    rung: str = RUNG,
    *,
    population: Population | None = None,
    rules: Exclusions | None = None,
    slips: Callable[[], bool] = lambda: False,
) -> StudyData:
    """The sessions of virtual participants P01, P02 and so on, as loaded from their journal."""
    study = parsed_study(text)
    kept = StudyFolder(path=folder)
    with (
        patch("device.resonance._POINTS", 7),
        journal_if_used(kept.journal) as journal,
    ):
        for number in range(1, people + 1):
            options = SessionOptions(
                folder=kept,
                participant=f"P{number:02d}",
                ratings="virtual",
                rehearsal=True,
                seed=seed,
                law=law,
                rung=rung,
                people=population,
            )
            _run(study, text, options, journal, slips)
        chains = [journal.events(name) for name in journal.sessions()]
    return load_study_data(chains, rehearsals=True, rules=rules)


def _run(
    study: Study, text: str, options: SessionOptions, journal: Journal, slips: Callable[[], bool]
) -> None:
    request = Request(
        options=options,
        study=study,
        text=text,
        wording=study_wording(study, "en"),
        url="sim",
        pace="stepped",
        kind="rehearsal",
    )
    seed = request.seed
    device = InProcessDevice(seed, law=options.law, rung=options.rung)
    rig = in_process_rig(device, device_limits(study.rig))
    clock = InProcessClock(datetime(2026, 1, 1, tzinfo=UTC), device, rig)
    with ExitStack() as stack:
        stack.callback(rig.close)
        session = opened_session(request, journal, clock)
        assert session.virtual is not None
        person = person_of(session.virtual)
        device.sensor("skin", person.skin)
        device.sensor("mu0", person.mu0)
        context = SessionContext(
            session=session,
            device=rig,
            participant=VirtualParticipant(
                control=device,
                clock=clock,
                person=person,
                name=session_name(seed, options.participant, options.number),
                slips=slips,
            ),
            operator=OperatorConsole(
                lambda _: "",
                PlainDisplay(lambda _: None),
                lambda beam: device.swap_beam(study.beams[beam]),
                alone=True,
            ),
            clock=clock,
            log=SessionLog(journal, request.chain(journal), clock),
            opened_now=True,
        )
        try:
            run(context)
        except VirtualParticipantLeft:
            return
