"""Devices and gauges that lie or fail in a sliding experiment: what is told, and what is true."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from device.drivers.board import MONITOR_ABS_TOL_V
from device.gauges.gauge import LineGauge
from device.gauges.owner import GaugeOwner
from device.link.link import Link
from device.resonance import Resonance
from device.rig import RAMP_STEP_S, Rig
from device.simulator.in_process import InProcessDevice, in_process_rig
from runner.journal.opening import open_journal
from runner.screens import Instruction, Pacing, Screen
from runner.session.loop import run
from runner.session.session import SessionContext
from tests.device.fault_table import BOARD as FAULTS_OF_A_BOARD
from tests.device.fault_table import RECORDING, Row
from tests.device.gauges.test_gauge import LIES as GAUGE_LIES
from tests.device.gauges.test_gauge import GaugePort
from tests.device.in_process_clock import InProcessClock
from tests.device.lying import SteppedClock, WatchedRig, watched
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator
from tests.runner.session.test_sliding import SHORT, FakeFinger, sliding
from tests.system.test_lies import (
    BLOCKS,
    BOARD,
    BYTES,
    DRIVE_V,
    LIMITS,
    LINES,
    NOTICED_S,
    SOON_S,
    Lie,
    Told,
    is_on,
    of_blocks,
    tell,
    told_by,
    told_of_samples,
)

SLIDE = SHORT.replace("[slide]", f"[slide]\nvoltage_v = {DRIVE_V}").replace("[0.02]", "[0.1]")
FOUND = Resonance(frequency_hz=24221.37, tip_m_per_v=2e-8)
BLOCK_S = 0.1
"""Until a block of samples that is due is missed, at most."""


class RigsClock(FakeClock):
    """A session's clock by which a lying rig lives: while the session sleeps, its owner works."""

    def __init__(self, made: WatchedRig, gauge: GaugeOwner | None = None) -> None:
        super().__init__()
        self._made, self._gauge = made, gauge

    def monotonic_s(self) -> float:
        return self._made.clock()

    def sleep(self, seconds: float) -> None:
        end_s = self._made.clock() + seconds
        while (left_s := end_s - self._made.clock()) > 0:
            idle_s = self._made.rig.idle_s()
            step_s = left_s if idle_s is None else min(left_s, idle_s)
            self._made.clock.advance(step_s if self._gauge is None else min(step_s, RAMP_STEP_S))
            if self._gauge is not None:
                self._gauge.step()
            if idle_s is not None and idle_s <= left_s:
                self._made.rig.step()


@contextmanager
def _lying(made: SessionContext, when: str, lie: Callable[[], object]) -> Iterator[list[float]]:
    """Let the device of a sliding experiment lie in the second pass; yield when it began.

    It lies while the pass is driven, while the output is off before it, or when off is asked for.
    """
    began_s: list[float] = []
    owner: Any = made.device if when == "off" else made.participant
    page = Pacing if when == "driving" else Instruction
    name = "off" if when == "off" else "show"
    call = getattr(owner, name)

    def called(*shown: Screen) -> None:
        is_due = not shown or isinstance(shown[0], page)
        if is_due and not began_s and len(made.log.state.answered) == 1:
            began_s.append(made.clock.monotonic_s())
            lie()
        call(*shown)

    with patch.object(owner, name, called), patch("device.resonance._POINTS", 7):
        yield began_s


def drawn(
    rig: Rig, clock: Any, folder: Path, when: str, lie: Callable[[], object]
) -> tuple[Told, float]:
    """Slide a block at a device that lies from the second pass on.

    Returns what is told of it, which stands in the journal, too, and when it began to lie.
    """
    operator = FakeOperator(FakeDevice())
    with open_journal(folder / "study.db") as journal:
        made = sliding(
            journal, rig, operator=operator, finger=FakeFinger(), text=SLIDE, clock=clock
        )
        with _lying(made, when, lie) as began_s:
            told = told_by(lambda: run(made))
        last = journal.events("slide/1")[-1]
    if told == "nothing":
        assert last.tag == "session-completed"
    else:
        assert (last.tag, last.payload["confirmed"]) == ("device-off", told == "off")
    return told, began_s[0]


def slid(
    watched_rig: WatchedRig,
    folder: Path,
    when: str,
    lie: Callable[[], object],
    gauge: GaugeOwner | None = None,
) -> Told:
    """Return what is told of a device that lies; an output that goes off does so in time."""
    clock = RigsClock(watched_rig, gauge)
    told, began_s = drawn(watched_rig.rig, clock, folder, when, lie)
    if told != "nothing" and not is_on(watched_rig):
        assert (watched_rig.port.off_s or 0.0) - began_s <= NOTICED_S + BLOCK_S
    return told


MOMENTS = {"driving": "driving", "recording": "driving", "between": "idle", "off": "off"}
FAILING = [row for row in (*FAULTS_OF_A_BOARD, *RECORDING) if row.when in MOMENTS]


@pytest.mark.parametrize("row", FAILING, ids=lambda row: row.name)
def test_a_fault_in_a_sliding_experiment_leaves_no_output_on_silently(
    row: Row, tmp_path: Path
) -> None:
    device = InProcessDevice(seed=1)
    rig = in_process_rig(device, LIMITS)
    clock = InProcessClock(datetime(2026, 1, 5, tzinfo=UTC), device, rig)

    def fail() -> None:
        device.fault(row.fault)
        clock.sleep(SOON_S * (row.when == "between"))  # the block is put on the beam

    told, _ = drawn(rig, clock, tmp_path, MOMENTS[row.when], fail)
    instrument = device.inside.instrument
    assert (told == "nothing") is (row.error is None)
    if row.still_on:
        assert told == "unknown"
    else:
        clock.sleep(LIMITS.watchdog_s)  # what hears nothing any more is off by then
        assert not instrument.output
        assert instrument.output_v < MONITOR_ABS_TOL_V


@pytest.mark.parametrize("lie", BOARD, ids=lambda lie: lie.name)
def test_a_lie_in_a_sliding_experiment_and_what_is_told_of_it(lie: Lie, tmp_path: Path) -> None:
    with watched(LIMITS, "board") as watched_rig:
        when = "off" if lie.told == "nothing" else lie.when  # its monitor shows it there
        told = slid(watched_rig, tmp_path, when, lambda: tell(watched_rig, lie))
        assert told == ("unknown" if lie.told == "nothing" else lie.told)
        assert told == "unknown" or is_on(watched_rig) is (bool(lie.because) and told == "off")


@pytest.mark.parametrize("name", [*BLOCKS, *BYTES])
def test_samples_that_lie_end_a_sliding_experiment(name: str, tmp_path: Path) -> None:
    def lie() -> None:
        watched_rig.port.line_lie = of_blocks(told_of_samples(name))

    with watched(LIMITS, "board") as watched_rig:
        assert slid(watched_rig, tmp_path, "driving", lie) == "off"
        assert not is_on(watched_rig)


@pytest.mark.parametrize(("of", "lie"), [row[:2] for row in GAUGE_LIES if row[0] != "*IDN?"])
def test_a_gauge_that_lies_ends_a_sliding_experiment(
    of: str, lie: Callable[[str], str], tmp_path: Path
) -> None:
    """Beside a generator; from a driven pass on, or from before it if no sample is untrue."""
    port = GaugePort(SteppedClock())
    gauge = GaugeOwner(LineGauge(Link(port, monotonic=port.clock)))

    def lies() -> None:
        port.of, port.lie = of, lie

    when = "driving" if of == "DATA?" else "idle"
    with watched(LIMITS, "keysight", port.clock, gauge, FOUND) as watched_rig:
        assert slid(watched_rig, tmp_path, when, lies, gauge) == "off"
        assert not is_on(watched_rig)


@pytest.mark.parametrize("name", LINES)
def test_a_board_that_speaks_no_language_ends_a_sliding_experiment(
    name: str, tmp_path: Path
) -> None:
    def lie() -> None:
        watched_rig.port.line_lie = LINES[name]()

    with watched(LIMITS, "board") as watched_rig:
        assert slid(watched_rig, tmp_path, "driving", lie) == "unknown"
        assert not is_on(watched_rig)
