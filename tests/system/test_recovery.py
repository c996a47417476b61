"""Dry runs recover what their virtual participants were given: M2 against the journalled truth."""

from collections.abc import Callable
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from analysis.loading.study_data import load_study_data
from analysis.report.findings import Origin
from analysis.report.report import Report, report, report_html, report_json
from device.friction.contrasts import LAW, RUNG
from device.simulator.in_process import InProcessClock, InProcessDevice, in_process_rig
from device.study_limits import device_limits
from protocol.study.participant_texts import study_wording
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import journal_if_used
from runner.journal.session_log import SessionLog
from runner.launch.run_session import Request, SessionOptions, opened_session
from runner.people.operator_console import OperatorConsole, PlainDisplay
from runner.people.virtual_participant import VirtualParticipant, drawn_person, swapping
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.study.folder import StudyFolder

STUDY = template("extended")
"""It has opposite trials."""


def rehearsed(
    folder: Path,
    text: str,
    people: int,
    seed: int,
    law: str = LAW,
    rung: str = RUNG,
    *,
    slips: Callable[[], bool] = lambda: False,
) -> Report:
    """The report on sessions of virtual participants, in this process and on simulated time."""
    study = parsed_study(text)
    kept = StudyFolder(path=folder)
    with (
        patch("device.resonance._POINTS", 7),
        journal_if_used(kept.journal) as journal,
    ):
        for number in range(1, people + 1):
            options = SessionOptions(
                folder=kept,
                participant=f"P{number:03d}",
                ratings="virtual",
                rehearsal=True,
                seed=seed,
                law=law,
                rung=rung,
            )
            _run(study, text, options, journal, slips)
        chains = [journal.events(name) for name in journal.sessions()]
    found = load_study_data(chains, rehearsals=True)
    return report("rehearsals", found, study, Origin(command="report", study_sha256="0"))


def _run(
    study: Study, text: str, options: SessionOptions, journal: Any, slips: Callable[[], bool]
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
    device = InProcessDevice(seed, law=options.law or LAW, rung=options.rung or RUNG)
    rig = in_process_rig(device, device_limits(study.rig))
    clock = InProcessClock(datetime(2026, 1, 1, tzinfo=UTC), device, rig)
    character, stream = drawn_person(seed, options.participant, options.number)
    with ExitStack() as stack:
        stack.callback(rig.close)
        session = opened_session(request, journal, clock)
        context = SessionContext(
            session=session,
            device=rig,
            participant=VirtualParticipant(
                control=device,
                clock=clock,
                character=character,
                random_stream=stream,
                slips=slips,
            ),
            operator=OperatorConsole(
                lambda _: "",
                PlainDisplay(lambda _: None),
                swapping(device, study.beams),
                alone=True,
            ),
            clock=clock,
            log=SessionLog(journal, request.chain(journal), clock),
            opened_now=True,
        )
        run(context)


def covered(found: Report) -> list[bool]:
    return [entry["gain_covered"] for entry in report_json(found)["recovery"]["subjects"]]


def test_a_dry_run_with_opposite_trials_recovers_what_the_journal_holds(tmp_path: Path) -> None:
    found = rehearsed(tmp_path, STUDY, 2, seed=1)
    shown = report_json(found)["recovery"]
    assert shown["reported"] == shown["simulated"][0] == {"law": LAW, "rung": RUNG}
    for entry in shown["subjects"]:
        character, _ = drawn_person(1, entry["subject"], 1)
        assert vars(character).items() <= entry["true"].items()
        assert (entry["true"]["skin"], entry["true"]["force_factor"]) == (1.0, 1.0)
    assert all(covered(found))
    opposite = found.loaded.trials[found.loaded.trials["opposite"]]
    assert len(opposite) == 2 * 5 - 2, "one of each condition that has a contrary"
    assert opposite["score"].mean() > 6
    assert "follow the same model" in report_html(found)


def test_the_report_names_another_law_of_the_simulated_beam(tmp_path: Path) -> None:
    found = rehearsed(tmp_path, template("paper"), 2, 1, "coulomb", "far-field")
    shown = report_json(found)["recovery"]
    assert shown["simulated"] == [{"law": "coulomb", "rung": "far-field"}]
    page = report_html(found)
    assert "The simulated beam followed the law coulomb on the rung far-field" in page
    assert "differ systematically" in page


@pytest.mark.soak
def test_intervals_cover_the_gains_of_two_hundred_people(tmp_path: Path) -> None:
    found = covered(rehearsed(tmp_path, STUDY, 200, seed=1))
    share = float(np.mean(found))
    print(f"\nM2 covers the gains of {share:.3f} of {len(found)} virtual participants")
    assert share >= 0.93 - 2 * np.sqrt(0.93 * 0.07 / len(found))
