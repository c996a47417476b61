"""A dry run on a device that nobody touches: answers follow what the device reports."""

from pathlib import Path

import pytest

from device.drivers.driver import Reading
from device.friction.calibration import NOMINAL
from device.people.person import Person
from protocol.journal.events import Answered
from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import open_journal
from runner.people.virtual_participant import UntouchedBeam, VirtualParticipant
from runner.session.loop import run
from tests.runner.fakes import FakeDevice, FakeParticipant, context

STUDY = parsed_study(template("paper"))
RESONANCE_HZ = 24_000.0


def felt(voltage_v: float, *, beam: str = "1 mm", resonance_hz: float = RESONANCE_HZ) -> float:
    said = Reading(at_s=0, output=True, amplitude_v=voltage_v, frequency_hz=RESONANCE_HZ)
    finger = UntouchedBeam(STUDY, NOMINAL, lambda: said, lambda: resonance_hz)
    finger.mount(beam)
    return finger.touch(0.5, STUDY.touch.smooth_place_m, "right")


def test_the_friction_is_that_of_the_drive_that_the_device_reports() -> None:
    assert felt(200.0) < felt(100.0) < felt(0.0)
    assert felt(100.0, beam="no bodies") != felt(100.0)
    assert felt(100.0, resonance_hz=1.1 * RESONANCE_HZ) > felt(100.0)
    silent = UntouchedBeam(STUDY, NOMINAL, lambda: None, lambda: 0.0)
    assert silent.touch(0.5, STUDY.touch.smooth_place_m, "right") == felt(0.0)


@pytest.mark.parametrize("deaf", [False, True])
def test_a_whole_dry_run_is_answered_by_what_was_driven(tmp_path: Path, deaf: bool) -> None:
    device = FakeDevice(deaf=deaf)

    def reading() -> Reading | None:
        if not device.on:
            return None
        said = device.read_back()
        return Reading(
            at_s=0, output=True, amplitude_v=said.voltage_v, frequency_hz=said.frequency_hz
        )

    with open_journal(tmp_path / "study.db") as journal:
        session = context(journal, device, FakeParticipant(), kind="rehearsal")
        session.participant = VirtualParticipant(
            control=UntouchedBeam(STUDY, NOMINAL, reading, lambda: session.resonance_hz),
            clock=session.clock,
            person=Person(bias=5, gain=10, felt_noise=0.0, criterion=0.02, criterion_less=0.02),
            name="1/P01/1",
        )
        run(session)
        records = [event.record for event in journal.events("P01/1 (rehearsal)")]
    changes = [record.change for record in records if isinstance(record, Answered)]
    assert len(changes) == 7
    assert (set(changes) <= {None, "same", "not swapped"}) == deaf, "0 V changes nothing"
