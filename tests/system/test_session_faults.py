"""Every device fault in the middle of a session, over the real byte path.

The tests assert the device's true state, the journal's record of the trial and the output, the
message to the operator, and the exit code.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pytest

from device.errors import DeviceError, OutputUnknown
from device.rig import Rig
from device.simulator.client import ControlClient, Endpoints, simulator_process
from device.study_limits import device_limits
from protocol.study_file.loading import template
from runner.clock import SteppedClock
from runner.journal.opening import open_journal
from runner.journal.store import Journal
from runner.journal.verification import verdicts
from runner.people.operator_console import OperatorConsole, PlainDisplay
from runner.screens import Instruction, OwnFinger, Pacing, Participant, Response, Screen
from runner.session.loop import run
from runner.session.session import SessionContext
from tests.device.fault_table import BOARD, Row
from tests.device.rigs import TOUCHBEAM, opened, until
from tests.runner.fakes import FakeDevice, FakeParticipant, context
from touchbeam.cli.output import WORK_FAILED, complaint

pytestmark = pytest.mark.waits

STUDY = (
    template("paper")
    .replace("hold_s = 2.0", "hold_s = 1.0")
    .replace("max_voltage_v = 200", "max_voltage_v = 180")  # differs from the board's own limit
    .replace("ramp_to_v = 200", "ramp_to_v = 180")
)
READING_S = 0.4
"""Real time that the participant reads after a fault, so that the rig can poll the device."""
FAILING_TOUCH = 3
"""Counted from 1: the fault comes in the middle of a session."""


@dataclass
class Provoking(Participant):
    """A participant who makes the device fail during a touch or just before it."""

    control: ControlClient
    row: Row
    inner: FakeParticipant
    touches: int = 0
    failed_s: float = float("inf")

    def show(self, screen: Screen) -> None:
        self.inner.show(screen)
        before = isinstance(screen, Instruction) and self.row.when == "between"
        during = isinstance(screen, Pacing) and self.row.when in {"driving", "off"}
        self.touches += isinstance(screen, Pacing)
        due = self.touches >= FAILING_TOUCH - before
        if due and (before or during) and self.failed_s == float("inf"):
            self.control.fault(self.row.fault)
            self.failed_s = time.monotonic()

    def progress(self, number: int, total: int) -> None:
        self.inner.progress(number, total)

    def saved(self) -> None:
        self.inner.saved()

    def felt(self, finger: OwnFinger) -> None:
        self.inner.felt(finger)

    def poll(self) -> Response | None:
        reading = self.row.when == "between" and 0 < time.monotonic() - self.failed_s < READING_S
        return None if reading else self.inner.poll()


@pytest.fixture(scope="module")
def simulator() -> Iterator[Endpoints]:
    with simulator_process(TOUCHBEAM, seed=1, keep=True) as endpoints:
        yield endpoints


@pytest.fixture
def control(simulator: Endpoints) -> Iterator[ControlClient]:
    with ControlClient(simulator.control) as control:
        control.reset()
        yield control
        control.reset()


def on_the_rig(
    made: SessionContext,
    device: Rig,
    control: ControlClient,
    row: Row,
    say: Callable[[str], None] = lambda _: None,
) -> SessionContext:
    """Return `made` with a real byte path in place of its device."""
    clock = SteppedClock(datetime(2026, 1, 1, tzinfo=UTC), control.advance)
    return SessionContext(
        session=made.session,
        device=device,
        participant=Provoking(control, row, FakeParticipant()),
        operator=OperatorConsole(lambda _: "", PlainDisplay(say), alone=True),
        clock=clock,
        log=made.log,
        opened_now=made.opened_now,
    )


@pytest.mark.parametrize("row", BOARD, ids=lambda row: row.name)
def test_a_fault_in_a_session(
    tmp_path: Path, simulator: Endpoints, control: ControlClient, row: Row
) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant(), STUDY)
        with opened(simulator.url, "board", device_limits(made.session.study.rig)) as device:
            if row.when == "handshake":
                control.fault(row.fault)
            there = on_the_rig(made, device, control, row)
            if row.error is None:
                run(there)
                assert made.log.state.name == "completed"
            else:
                with pytest.raises(DeviceError) as caught:
                    run(there)
                _assert_reported(caught.value)
                _assert_journalled(journal, caught.value)
        if not row.still_on:
            assert until(lambda: control.state()["voltage_v"] == 0, within_s=2.0)
        control.reset()
        resumes(journal)


def test_the_output_of_an_unexpected_device_is_never_reported_as_off(
    tmp_path: Path, simulator: Endpoints, control: ControlClient
) -> None:
    """It does not understand OUTP OFF, and must not be sent any other command."""
    row = Row(number=21, fault="wrong-idn", when="handshake")
    printed: list[str] = []
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant(), STUDY)
        for fault in (row.fault, "off-ignored", "panel-on"):
            control.fault(fault)
        with (
            opened(simulator.url, "board", device_limits(made.session.study.rig)) as device,
            pytest.raises(OutputUnknown, match="expected a board") as caught,
        ):
            run(on_the_rig(made, device, control, row, printed.append))
        assert control.state()["output"] is True
    line, code = complaint(caught.value)
    assert code == WORK_FAILED
    assert line.count("output state UNKNOWN - cut the amplifier") == 1
    assert "got 'ACME,Toaster 3000,0,1.0'; nothing else was sent" in line
    shown = [text.partition("; output ")[2] for text in printed if "; output " in text]
    assert shown == ["not known yet", "state UNKNOWN - cut the amplifier"]
    assert "output off" not in line


def test_a_watchdog_that_is_not_there_is_found_before_the_first_trial(
    tmp_path: Path, simulator: Endpoints, control: ControlClient
) -> None:
    row = Row(number=18, fault="watchdog-dead", when="handshake")
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant(), STUDY)
        control.fault(row.fault)
        with (
            opened(simulator.url, "board", device_limits(made.session.study.rig)) as device,
            pytest.raises(DeviceError, match="watchdog did not trip") as caught,
        ):
            run(on_the_rig(made, device, control, row))
        assert control.state()["output"] is False
        _assert_reported(caught.value)
        _assert_journalled(journal, caught.value)
        tags = [event.tag for event in journal.events("P01/1")]
        assert tags == ["session-opened", "device-armed", "watchdog-tested", "device-off"]


def _assert_reported(error: DeviceError) -> None:
    line, code = complaint(error)
    assert code == WORK_FAILED
    assert "\n" not in line
    if isinstance(error, OutputUnknown):
        assert "output state UNKNOWN - cut the amplifier" in line


def _assert_journalled(journal: Journal, error: DeviceError) -> None:
    """Assert that the trial is recorded, and that the output counts as off only if confirmed."""
    events = journal.events("P01/1")
    assert events[-1].tag in {"device-off", "session-opened"}
    if events[-1].tag == "device-off":
        assert events[-1].payload["confirmed"] is not isinstance(error, OutputUnknown)
    begun = sum(event.tag == "trial-started" for event in events)
    ended = sum(event.tag in {"answered", "trial-aborted"} for event in events)
    assert begun == ended
    assert verdicts(journal)[0].ok


def resumes(journal: Journal) -> None:
    """Assert that the session resumes with a working device."""
    made = context(journal, FakeDevice(), FakeParticipant(), STUDY)
    if made.log.state.name != "completed":
        run(made)
    (verdict,) = verdicts(journal)
    assert verdict.ok
    assert (verdict.trials_answered, verdict.duplicates) == (7, 0)
