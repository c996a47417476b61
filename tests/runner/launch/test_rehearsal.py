"""Rehearsals in one process: every run the same, and ended by Ctrl-C at any moment."""

import signal
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from device.simulator.in_process import InProcessDevice, InProcessHand
from protocol.journal.events import TouchRecorded
from protocol.study.rig_settings import ForceChannel
from protocol.study.rig_settings import Rig as RigSettings
from protocol.study_file.loading import template
from runner.clock import SteppedClock
from runner.journal.opening import read_journal
from runner.launch.device_access import SessionRig, stepped_rig
from runner.signals import Stopped, signals_raise
from tests.device.rigs import DRIVE
from tests.runner.command_line import typed

RUN = ("run", "study", "--participant", "P01", "--ratings", "virtual")
BEGIN = datetime(2026, 1, 1, tzinfo=UTC)
BY_BOARD = "[force_channel]\nrate_hz = 500\n\n[touch]\n"
BY_GAUGE = BY_BOARD.replace("500\n", '500\ngauge = "sim"\n')


@pytest.fixture(autouse=True)
def somewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def events(folder: str = "study") -> list[tuple[Any, ...]]:
    """What a journal holds, apart from the time of day."""
    with read_journal(Path(folder, "study.db")) as journal:
        found = journal.events("P01/1 (rehearsal)")
        return [(event.seq, event.monotonic_s, event.record) for event in found]


def clocked(rig: SessionRig) -> tuple[InProcessHand, SteppedClock]:
    """The hand on the rig's device, and a session's clock."""
    hand = rig.control
    assert isinstance(hand, InProcessHand)
    return hand, SteppedClock(BEGIN, hand.pass_time, hand.now_s)


@pytest.mark.parametrize(("channel", "source"), [(BY_BOARD, "board"), (BY_GAUGE, "gauge")])
def test_two_rehearsals_that_record_forces_are_the_same(channel: str, source: str) -> None:
    for folder in ("one", "two"):
        Path(folder).mkdir()
        text = template("paper").replace("[touch]\n", channel, 1)
        Path(folder, "study.toml").write_text(text)
        assert typed("run", folder, *RUN[2:], "--seed", "3") == 0
    assert events("one") == events("two")
    forces = [record for *_, record in events("one") if isinstance(record, TouchRecorded)]
    assert {record.source for record in forces} == {source}


def test_ctrl_c_within_a_step_turns_the_output_off(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It comes while the device works, in the thread that is the device's, too."""
    driven: list[InProcessDevice] = []
    happen = InProcessDevice.happen

    def interrupted(device: InProcessDevice) -> None:
        happen(device)
        if not driven and device.inside.instrument.output_v > 50:
            driven.append(device)
            signal.raise_signal(signal.SIGINT)

    typed("new", "study")
    monkeypatch.setattr(InProcessDevice, "happen", interrupted)
    capsys.readouterr()
    assert typed(*RUN) == 1
    assert capsys.readouterr().err == (
        "touchbeam: stopped by SIGINT; output off, read back; run the same command again to "
        "resume; this run is a rehearsal\n"
    )
    assert driven[0].inside.instrument.output is False
    assert typed(*RUN) == 0


def test_a_stop_ends_a_long_step_early_and_time_does_not_go_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps, step_towards = [0], InProcessDevice.step_towards

    def interrupted(device: InProcessDevice, end_s: float) -> None:
        step_towards(device, end_s)
        steps[0] += 1
        if steps[0] == 100:
            signal.raise_signal(signal.SIGINT)

    with stepped_rig(RigSettings(), 1) as rig:
        hand, clock = clocked(rig)
        rig.device.arm()
        began_s = hand.now_s()
        monkeypatch.setattr(InProcessDevice, "step_towards", interrupted)
        with pytest.raises(Stopped), signals_raise():
            clock.sleep(3600.0)
        assert steps == [100]
        assert 0 < clock.monotonic_s() == pytest.approx(hand.now_s() - began_s)
        assert clock.monotonic_s() < 60


def test_the_clock_moves_while_a_step_is_made() -> None:
    """A recording must know what is due by now; the watchdog is quiet only while somebody beats."""
    with stepped_rig(RigSettings(), 1, force_channel=ForceChannel(rate_hz=500)) as rig:
        hand, clock = clocked(rig)
        rig.device.arm()
        assert clock.monotonic_s() == 0, "a silence of the driver's is no time of the session"
        rig.device.record(500, clock.monotonic_s)
        rig.device.drive(DRIVE)
        rig.device.beat()
        clock.sleep(0.2)
        assert rig.device.forces is not None
        clock.sleep(2.0)
        assert hand.state()["cause"] == "WATC"
        assert clock.monotonic_s() == 2.2


def test_a_place_and_a_slide_can_be_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A virtual person feels the end of a held touch and the mean of a slide."""
    (tmp_path / "study.toml").write_text(
        '[study]\nname = "mixed"\n[session]\nlanguages = ["en"]\n[[condition]]\nname = "moved"\n'
        'question = "roughness"\nexpected = "smoother"\ntouches = [{ place = "smooth", '
        'voltage_v = 0 }, { place = "path", voltage_v = 100 }]\n',
        encoding="utf-8",
    )
    assert typed("run", tmp_path, "--participant", "P01", "--ratings", "virtual") == 0
    assert "P01/1 is complete: 1 trial answered" in capsys.readouterr().out
