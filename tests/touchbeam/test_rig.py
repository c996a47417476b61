"""A rig that a program of one's own drives: its limits, its end, and what the journal keeps."""

import gc
import os
import re
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest

import touchbeam
from analysis.loading.sessions import load_sessions
from device.errors import OutputUnknown
from device.rig import Rig
from device.simulator.client import BeamControl
from protocol.journal.events import (
    DeviceOff,
    DriveEnded,
    DriveStarted,
    SessionOpened,
    TouchRecorded,
)
from protocol.journal.records import ReadBack
from protocol.study_file.loading import template
from runner.journal.cohort import Arrival, states
from runner.journal.names import real_sessions
from runner.journal.opening import read_journal
from runner.journal.store import SessionLog
from runner.journal.verification import readable_chains, verdicts
from tests.runner.command_line import typed

HZ = 24_221.37


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    limits = "max_voltage_v = 120\nmax_drive_s = 10"
    text = template("paper").replace("max_voltage_v = 200", limits)
    text = text.replace("ramp_to_v = 200", "ramp_to_v = 120")
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    return tmp_path


@pytest.fixture
def rig(folder: Path) -> Iterator[touchbeam.OpenRig]:
    with touchbeam.open_rig(folder) as rig:
        yield rig


def hand_on(rig: touchbeam.OpenRig) -> BeamControl:
    assert rig.hand is not None
    return rig.hand


def program(
    folder: Path, ends: Callable[[touchbeam.OpenRig], None], *, still_on: bool = True
) -> None:
    """Drive a rig until `ends` ends the program."""
    with touchbeam.open_rig(folder, journal=folder) as rig:
        rig.drive(100, HZ)
        rig.wait(0.3)
        try:
            ends(rig)
        finally:
            assert hand_on(rig).state()["output"] is still_on
            ended.append(hand_on(rig))


ended: list[BeamControl] = []
"""The hands on the rigs of `program`, the last one at the end."""


def events_in(folder: Path, chain: str = "script/1") -> list[Any]:
    with read_journal(folder / "study.db") as journal:
        assert all(verdict.ok for verdict in verdicts(journal))
        return [event.record for event in journal.events(chain)]


def test_it_is_driven_read_back_and_turned_off(rig: touchbeam.OpenRig) -> None:
    hand = hand_on(rig)
    assert rig.drive(voltage_v=100, frequency_hz=HZ).output
    rig.wait(0.5)
    assert rig.read_back().monitor_v == pytest.approx(100, abs=1)
    assert hand.state()["voltage_v"] == pytest.approx(100)
    rig.drive(50, HZ)
    rig.wait(0.5)
    assert rig.read_back().monitor_v == pytest.approx(50, abs=1)
    rig.off()
    assert hand.state()["output"] is False
    rig.off()


def test_its_resonance_is_measured_with_the_output_off_afterwards(rig: touchbeam.OpenRig) -> None:
    truth = rig.hand._ask("truth")["resonance_hz"]  # type: ignore[union-attr]
    rig.drive(1, HZ)
    assert rig.resonance() == pytest.approx(truth, rel=1e-3)
    assert hand_on(rig).state()["output"] is False


@pytest.mark.parametrize(
    ("voltage_v", "frequency_hz", "said"),
    [
        (120.1, HZ, "voltage_v must lie in [0, 120], got 120.1"),
        (-1, HZ, "voltage_v must lie in [0, 120], got -1"),
        (float("nan"), HZ, "voltage_v must lie in [0, 120], got nan"),
        (10, 40_001, "frequency_hz must lie in [1, 40000], got 40001"),
        (10, 0, "frequency_hz must lie in [1, 40000], got 0"),
    ],
)
def test_beyond_the_limits_nothing_is_sent(
    rig: touchbeam.OpenRig, voltage_v: float, frequency_hz: float, said: str
) -> None:
    for driven in (False, True):
        if driven:
            rig.drive(60, HZ)
            rig.wait(0.5)
        before = hand_on(rig).state()
        with pytest.raises(ValueError, match=f"^{re.escape(said)}$"):
            rig.drive(voltage_v, frequency_hz)
        assert hand_on(rig).state() == before, "it is as it was, off or driven"


def test_slew_and_current_have_their_limits_too(folder: Path) -> None:
    file = folder / "study.toml"
    text = file.read_text(encoding="utf-8").replace(
        "max_slew_v_per_us = 40", "max_slew_v_per_us = 19"
    )
    limits = "max_slew_v_per_us = 19\ncapacitance_nf = 1\nmax_current_ma = 18.5"
    file.write_text(text.replace("max_slew_v_per_us = 19", limits), encoding="utf-8")
    with touchbeam.open_rig(folder) as rig:
        with pytest.raises(ValueError, match=r"^slew_v_per_us must not exceed 19, got 22\.6"):
            rig.drive(120, 30_000)
        with pytest.raises(ValueError, match=r"^current_a must not exceed 0\.0185, got 0\.0188"):
            rig.drive(120, 25_000)
        assert hand_on(rig).state()["output"] is False


def test_a_drive_has_its_longest_time(rig: touchbeam.OpenRig) -> None:
    rig.wait(100)
    rig.drive(50, HZ)
    rig.wait(4)
    with pytest.raises(ValueError, match=r"rig\.max_drive_s = 10 s, got 11 s; the output is off"):
        rig.wait(7)
    assert hand_on(rig).state()["output"] is False
    rig.drive(50, HZ)
    rig.wait(4)


@pytest.mark.parametrize("value", ["100", True, None, [100], 10**400, 1j])
def test_only_a_number_is_driven_or_waited(rig: touchbeam.OpenRig, value: Any) -> None:
    before = hand_on(rig).state()
    for name, asked in (
        ("voltage_v", lambda: rig.drive(value, HZ)),
        ("frequency_hz", lambda: rig.drive(50, value)),
        ("seconds", lambda: rig.wait(value)),
    ):
        with pytest.raises(ValueError, match=rf"^{name} must be a number, got [^\n]{{1,50}}$"):
            asked()
    assert hand_on(rig).state() == before


@pytest.mark.parametrize("seconds", [-1, float("nan"), float("inf")])
def test_a_wait_is_a_time(rig: touchbeam.OpenRig, seconds: float) -> None:
    with pytest.raises(ValueError, match="seconds must be at least 0, got"):
        rig.wait(seconds)


def test_a_program_that_never_waits_has_no_longer_drives(rig: touchbeam.OpenRig) -> None:
    def drives_on() -> None:
        for volts in cycle((20, 120)):
            rig.drive(volts, HZ)
            rig._rig.clock.sleep(0.2)

    with pytest.raises(ValueError, match=r"rig\.max_drive_s = 10 s"):
        drives_on()
    assert hand_on(rig).state()["output"] is False


@pytest.mark.parametrize("error", [ValueError("mine"), KeyboardInterrupt(), SystemExit(3)])
def test_an_exception_turns_it_off_and_goes_on(folder: Path, error: BaseException) -> None:
    with pytest.raises(type(error)) as raised:
        program(folder, lambda _: _raise(error))
    assert raised.value.__notes__ == ["output off, read back"]
    assert ended[-1].state()["output"] is False
    off = events_in(folder)[-2]
    assert (off.confirmed, off.why) == (True, str(error) or type(error).__name__)


def _raise(error: BaseException) -> None:
    raise error


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT])
def test_signals_that_kill_end_the_program_with_the_output_off(
    folder: Path, number: signal.Signals
) -> None:
    # Under nohup, by which tests may be started, SIGHUP is ignored.
    before = signal.signal(number, signal.SIG_DFL)
    try:
        with pytest.raises(SystemExit) as raised:
            program(folder, lambda _: os.kill(os.getpid(), number))
        assert signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)
    assert raised.value.code == 128 + number
    assert ended[-1].state()["output"] is False
    assert events_in(folder)[-2].why == f"the rig was stopped by {number.name}"


def interrupted(rig: touchbeam.OpenRig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have Ctrl-C come when the device is told to turn its output off."""
    off = rig._rig.device.off

    def meanwhile() -> None:
        os.kill(os.getpid(), signal.SIGINT)
        off()

    monkeypatch.setattr(rig._rig.device, "off", meanwhile)


def test_ctrl_c_while_it_closes_waits_until_it_is_closed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(KeyboardInterrupt):
        program(folder, lambda rig: interrupted(rig, monkeypatch))
    assert ended[-1].state()["output"] is False
    assert events_in(folder)[-2].confirmed is True
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_handler_of_the_programs_own_that_breaks_the_closing_off_leaves_the_rig_to_be_closed(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = signal.signal(signal.SIGINT, lambda *_: _raise(KeyboardInterrupt()))
    try:
        rig = touchbeam.open_rig(folder)
        rig.drive(100, HZ)
        with monkeypatch.context() as patch:
            interrupted(rig, patch)
            with pytest.raises(KeyboardInterrupt):
                rig.close()
        rig.close()
        assert hand_on(rig).state()["output"] is False
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_stopped_rig_drives_no_more(folder: Path) -> None:
    with touchbeam.open_rig(folder) as rig:
        rig.drive(100, HZ)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(RuntimeError, match=r"^the rig was stopped by SIGINT, and closed; t"):
            rig.wait(0.1)
        assert hand_on(rig).state()["output"] is False
        with pytest.raises(RuntimeError, match=r"^the rig was stopped by SIGINT"):
            rig.drive(100, HZ)
    with touchbeam.open_rig(folder) as rig:
        assert rig.drive(100, HZ).output


@pytest.mark.parametrize("first", [0, 1])
def test_signals_are_given_back_once_the_last_rig_is_closed(first: int) -> None:
    rigs = [touchbeam.open_rig(), touchbeam.open_rig()]
    rigs.pop(first).close()
    assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    with pytest.raises(SystemExit):
        os.kill(os.getpid(), signal.SIGTERM)
    rigs.pop().close()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_a_signal_is_given_back_also_where_another_thread_closed_the_last_rig() -> None:
    rig = touchbeam.open_rig()
    in_a_thread(rig.close)
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def in_a_thread(work: Callable[[], object]) -> None:
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()


def test_a_thread_may_close_what_another_one_opened(folder: Path) -> None:
    rigs: list[touchbeam.OpenRig] = []
    in_a_thread(lambda: rigs.append(touchbeam.open_rig(folder, journal=folder)))
    rigs[0].drive(100, HZ)
    rigs[0].close()
    assert hand_on(rigs[0]).state()["output"] is False
    assert events_in(folder)[-1].TAG == "session-completed"


def test_a_call_that_comes_after_the_close_fails_and_does_not_wait(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for real_time in (False, True):
        rig = touchbeam.open_rig(folder, real_time=real_time)
        device = rig._rig.device

        def closed_meanwhile(device: Rig = device, rig: touchbeam.OpenRig = rig) -> ReadBack:
            in_a_thread(rig.close)
            return Rig.read_back(device)

        monkeypatch.setattr(device, "read_back", closed_meanwhile)
        with pytest.raises(RuntimeError, match=r"^the rig is closed; touchbeam\.open_rig"):
            rig.read_back()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_cannot_use_the_rig(rig: touchbeam.OpenRig) -> None:
    rig.drive(100, HZ)
    child = os.fork()
    if child == 0:
        code = 1
        try:
            with pytest.raises(RuntimeError, match="another process, of which this is a fork"):
                rig.wait(0.1)
            rig.close()
            assert hand_on(rig).state()["output"] is True, "of its own copy: nothing was sent"
            assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
            code = 0
        finally:
            os._exit(code)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    assert rig.read_back().output


def test_a_handler_of_the_programs_own_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    def own(*_: object) -> None:
        return

    before = signal.signal(signal.SIGTERM, own)
    try:
        with touchbeam.open_rig():
            assert signal.getsignal(signal.SIGTERM) is own
    finally:
        signal.signal(signal.SIGTERM, before)


def test_a_rig_that_is_forgotten_is_turned_off(folder: Path) -> None:
    rig = touchbeam.open_rig(folder, journal=folder)
    hand = hand_on(rig)
    rig.drive(100, HZ)
    del rig
    gc.collect()
    assert hand.state()["output"] is False
    assert events_in(folder)[-2].why == "the program forgot the rig"


def test_a_rig_is_collected_in_any_thread() -> None:
    held = [touchbeam.open_rig()]
    hand = hand_on(held[0])
    held[0].drive(100, HZ)
    known = threading.enumerate()
    thread = threading.Thread(target=held.clear)
    thread.start()
    thread.join()
    for closing in set(threading.enumerate()) - set(known):
        closing.join()
    assert hand.state()["output"] is False


def test_a_closed_rig_says_so(rig: touchbeam.OpenRig) -> None:
    rig.drive(100, HZ)
    rig.close()
    rig.close()
    assert hand_on(rig).state()["output"] is False
    for call in (rig.off, rig.read_back, rig.wait, lambda: rig.drive(1, HZ), rig.__enter__):
        with pytest.raises(RuntimeError, match=r"the rig is closed; touchbeam\.open_rig"):
            call()


def test_two_simulated_rigs_are_two(rig: touchbeam.OpenRig) -> None:
    rig.drive(100, HZ)
    with touchbeam.open_rig() as other:
        assert hand_on(other).state()["output"] is False
        other.drive(20, HZ)
    rig.wait(0.5)
    assert hand_on(rig).state()["voltage_v"] == pytest.approx(100)


@pytest.mark.parametrize("fault", ["over-temperature", "watchdog-trip"])
def test_a_device_that_fails_is_turned_off_and_stays_off(
    rig: touchbeam.OpenRig, fault: str
) -> None:
    rig.drive(100, HZ)
    rig.wait(0.3)
    hand_on(rig).fault(fault)
    with pytest.raises(RuntimeError, match="output off, read back"):
        rig.wait(2)
    assert hand_on(rig).state()["output"] is False
    with pytest.raises(RuntimeError, match="output off, read back"):
        rig.drive(100, HZ)


@pytest.mark.parametrize("end", ["off", "close", "with"])
def test_it_says_that_the_device_had_turned_itself_off(folder: Path, end: str) -> None:
    def ends(rig: touchbeam.OpenRig) -> None:
        hand_on(rig).fault("watchdog-trip")
        if end != "with":
            getattr(rig, end)()

    with pytest.raises(RuntimeError, match=r"its watchdog tripped: .*; output off, read back$"):
        program(folder, ends, still_on=False)
    assert any(isinstance(record, DriveEnded) for record in events_in(folder))
    assert events_in(folder)[-2].confirmed is True


def test_what_the_device_did_is_told_once_and_beside_an_error_of_the_program(folder: Path) -> None:
    with touchbeam.open_rig(folder) as rig:
        rig.drive(100, HZ)
        hand_on(rig).fault("watchdog-trip")
        with pytest.raises(RuntimeError, match="its watchdog tripped"):
            rig.wait(0.5)
        rig.off()

    def ends(rig: touchbeam.OpenRig) -> None:
        hand_on(rig).fault("watchdog-trip")
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError) as mine:
        program(folder, ends, still_on=False)
    (note,) = mine.value.__notes__
    assert re.search("its watchdog tripped: .*; output off, read back", note)


def test_an_output_that_is_not_confirmed_is_unknown(folder: Path) -> None:
    def stuck(rig: touchbeam.OpenRig) -> None:
        hand_on(rig).fault("off-ignored")
        raise ValueError("mine")

    with pytest.raises(OutputUnknown, match="output state UNKNOWN - cut the amplifier") as raised:
        program(folder, stuck)
    assert isinstance(raised.value.__context__, ValueError)
    with read_journal(folder / "study.db") as journal:
        off = journal.events("script/1")[-1].record
        assert states(journal)["script/1"].name == "idle", "no session counts as complete"
    assert isinstance(off, DeviceOff)
    assert off.confirmed is False


def test_the_journal_keeps_what_was_driven(folder: Path) -> None:
    text = (folder / "study.toml").read_text(encoding="utf-8")
    (folder / "study.toml").write_text(f"{text}\n[force_channel]\nrate_hz = 500\n")
    for _ in range(2):
        with touchbeam.open_rig(journal=folder) as rig:
            hand_on(rig).touch(0.5, 0.04, "right")
            rig.drive(100, HZ)
            rig.wait(0.5)
            rig.drive(40, HZ)
            rig.wait(0.5)
            assert rig.forces is not None
            assert rig.forces.normal_n == pytest.approx(0.5, abs=0.1)
            said = rig.read_back()
            rig.off()
            assert rig.forces is None
    for chain in ("script/1", "script/2"):
        opened, *records = events_in(folder, chain)
        assert (opened.kind, opened.slot, opened.trials) == ("script", None, ())
        started = [each.commanded for each in records if isinstance(each, DriveStarted)]
        assert [each.voltage_v for each in started] == [100, 40]
        (recorded,) = [each for each in records if isinstance(each, TouchRecorded)]
        assert recorded.moved_s[1] - recorded.moved_s[0] == pytest.approx(1.0, abs=0.05)
        (ended,) = [each for each in records if isinstance(each, DriveEnded)]
        assert len(ended.read_back) == 3
    assert ended.read_back[-1] == said


def test_nothing_is_driven_that_cannot_be_journalled(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with touchbeam.open_rig(journal=folder) as rig, monkeypatch.context() as patch:
        patch.setattr(SessionLog, "_store", lambda *_: _raise(OSError("the disk is full")))
        with pytest.raises(OSError, match="the disk is full"):
            rig.drive(100, HZ)
        assert hand_on(rig).state()["output"] is False
    assert all(record.TAG != "drive-started" for record in events_in(folder))


def test_nothing_counts_a_script(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with touchbeam.open_rig(journal=folder) as rig:
        rig.drive(10, HZ)
    with read_journal(folder / "study.db") as journal:
        assert real_sessions(journal) == []
        assert Arrival(states(journal), "P01", "participant").slot() == 0
        assert load_sessions(readable_chains(journal, [])).sessions.empty
    for command in ("run", "verify", "status", "report", "export", "withdraw", "register"):
        more = {
            "run": ["--participant", "P01", "--ratings", "virtual"],
            "report": ["--rehearsals"],
            "export": [str(folder / "out"), "--format", "csv", "--rehearsals"],
            "withdraw": ["--participant", "script", "--yes"],
        }
        code = typed(command, str(folder), *more.get(command, []))
        assert code == (2 if command == "withdraw" else 0), command
    said = capsys.readouterr()
    assert "ok    script/1  completed  7 events, chain unbroken" in said.out
    assert "script/1  script  completed\n" in said.out
    assert "a script has no participant who could withdraw" in said.err
    assert "script" not in (folder / "out" / "trials.csv").read_text(encoding="utf-8")
    # Registered now: a script belongs to no plan.
    with touchbeam.open_rig(journal=folder) as rig:
        rig.drive(10, HZ)
    opened = events_in(folder, "script/2")[0]
    assert isinstance(opened, SessionOpened)


def names_a_port(folder: Path) -> Path:
    file = folder / "study.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('device = "sim" ', 'device = "/nowhere/ttyUSB7" '))
    return folder


def test_the_rig_is_that_of_the_study(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names_a_port(folder)
    for given in ({"study": folder}, {"journal": folder}):
        with pytest.raises(RuntimeError, match=r"/nowhere/ttyUSB7") as raised:
            touchbeam.open_rig(**given)  # type: ignore[arg-type] # mypy takes the keys for any
        told = traceback.format_exception(raised.value)
        assert sum(line.startswith("Traceback") for line in told) == 1
        said = "opening the rig at /nowhere/ttyUSB7 (board); nobody may touch the beam yet"
        assert capsys.readouterr().err == f"touchbeam: {said}\n"
    assert not (folder / "study.db").exists()


def test_a_simulated_rig_in_place_of_the_studys_says_so(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with touchbeam.open_rig(folder):
        assert capsys.readouterr().err == ""
    with touchbeam.open_rig(names_a_port(folder), "sim") as rig:
        assert capsys.readouterr().err == (
            "touchbeam: this rig is simulated; the one of the study, at /nowhere/ttyUSB7, is not "
            "opened\n"
        )
        assert rig.hand is not None


def test_a_device_without_a_watchdog_is_named(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder / "study.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("[rig]", '[rig]\ndialect = "keysight"\namplifier_gain = 24'))
    with touchbeam.open_rig(folder):
        assert re.fullmatch(
            r"touchbeam: this generator has no watchdog.*\n", capsys.readouterr().err
        )


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"study": "nowhere"}, "nowhere"),
        ({"device": "http://example"}, "http://example"),
        ({"journal": "nowhere"}, "nowhere"),
        ({"study": 5}, "^study must be a folder, got 5$"),
        ({"study": "a\0b"}, "^study must be a folder, got 'a"),
        ({"journal": b"."}, "^journal must be a folder, got b'.'$"),
        ({"device": 5}, "^device must be a text such as 'sim"),
        ({"seed": "x"}, "^seed must be a whole number, got 'x'$"),
        ({"seed": True}, "^seed must be a whole number, got True$"),
    ],
)
def test_what_is_not_there_is_a_value_error(
    given: dict[str, Any], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=said):
        touchbeam.open_rig(**given)
    assert list(tmp_path.iterdir()) == []
