"""Signals: one exception, raised once, and never inside a block that defers it."""

import itertools
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import FrameType

import pytest

from protocol.journal.events import DeviceArmed
from runner.journal.database import IN_MEMORY
from runner.journal.opening import open_journal
from runner.session.loop import run_then_turn_off
from runner.session.session import SessionContext
from runner.signals import (
    Stopped,
    errors_are_last,
    never_suspended,
    raise_if_stopped,
    signals_raise,
    stops_allowed,
    stops_deferred,
    take_suspension,
)
from tests.runner.fakes import FakeDevice, FakeParticipant, context

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT]


def send(number: signal.Signals) -> None:
    os.kill(os.getpid(), number)


def stopped_by(body: Callable[[], None]) -> str:
    """Return the message of the stop that ends `body`."""
    with pytest.raises(Stopped) as caught, signals_raise():
        body()
    return str(caught.value)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_stops(number: signal.Signals) -> None:
    assert stopped_by(lambda: send(number)) == f"stopped by {number.name}"


def test_a_second_signal_changes_nothing() -> None:
    done = []

    def body() -> None:
        try:
            send(signal.SIGTERM)
        finally:
            send(signal.SIGINT)
            done.append("device off")

    assert "SIGTERM" in stopped_by(body)
    assert done == ["device off"]


def test_a_signal_during_an_import_stops_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = "import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(0.05)\n"
    (tmp_path / "interrupted_module.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)

    def body() -> None:
        import_module("interrupted_module")
        time.sleep(5)

    assert stopped_by(body) == "stopped by SIGINT"
    assert sys.modules.pop("interrupted_module").time is time, "it is imported as a whole"


def test_a_signal_in_a_finalizer_is_not_lost(capsys: pytest.CaptureFixture[str]) -> None:
    class Finalized:
        def __del__(self) -> None:
            send(signal.SIGINT)

    def body() -> None:
        Finalized()
        time.sleep(5)

    assert stopped_by(body) == "stopped by SIGINT"
    assert capsys.readouterr().err == ""


def test_a_signal_is_deferred_to_the_end_of_the_block() -> None:
    done = []

    def body() -> None:
        with stops_deferred():
            with stops_deferred():
                send(signal.SIGINT)
                done.append("stored")
            done.append("known")
        done.append("too late")

    assert "SIGINT" in stopped_by(body)
    assert done == ["stored", "known"]


def test_a_signal_is_allowed_in_a_part_of_the_block() -> None:
    done = []

    def body() -> None:
        with stops_deferred():
            send(signal.SIGINT)
            done.append("before")
            try:
                with stops_allowed():
                    done.append("too late")
            finally:
                done.append("device off")

    assert "SIGINT" in stopped_by(body)
    assert done == ["before", "device off"]


def test_a_lost_stop_is_raised_again() -> None:
    done = []

    def body() -> None:
        with suppress(Stopped):
            send(signal.SIGTERM)
        with stops_deferred():
            raise_if_stopped()
            done.append("shielded")
        raise_if_stopped()
        done.append("too late")

    assert "SIGTERM" in stopped_by(body)
    assert done == ["shielded"]


def test_an_error_caused_by_a_stop_is_raised_as_the_stop() -> None:
    def imports() -> None:
        try:
            send(signal.SIGTERM)
        except Stopped as error:
            raise ImportError("failed to import") from error

    assert "SIGTERM" in stopped_by(imports)


def test_an_error_without_a_stop_is_unchanged() -> None:
    with pytest.raises(ImportError, match="no module of that name"), signals_raise():
        raise ImportError("no module of that name")


def test_a_stop_is_forgotten_after_its_block() -> None:
    stopped_by(lambda: send(signal.SIGTERM))
    raise_if_stopped()


def test_an_error_of_the_body_is_not_hidden_by_a_signal() -> None:
    def body() -> None:
        with stops_deferred():
            send(signal.SIGINT)
            raise OSError("the disk is full")

    with pytest.raises(OSError, match="the disk is full"), signals_raise():
        body()


def test_a_signal_while_things_are_closed_does_not_hide_the_error_that_closes_them() -> None:
    def body() -> None:
        try:
            with errors_are_last():
                raise OSError("output state UNKNOWN")
        finally:
            send(signal.SIGTERM)
            with stops_deferred():  # the journal is closed
                pass

    with pytest.raises(OSError, match="output state UNKNOWN"), signals_raise():
        body()


def test_earlier_handlers_are_restored() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with signals_raise():
        assert signal.getsignal(signal.SIGTERM) != before
    assert signal.getsignal(signal.SIGTERM) == before


def test_ctrl_z_suspends_nothing_and_is_told_once() -> None:
    before = signal.getsignal(signal.SIGTSTP)
    with signals_raise(), never_suspended():
        send(signal.SIGTSTP)
        send(signal.SIGTSTP)
        assert [take_suspension(), take_suspension()] == [True, False]
        for number in (signal.SIGTTIN, signal.SIGTTOU):
            send(number)
            assert signal.getsignal(number) is signal.SIG_IGN
        assert not take_suspension()
    assert signal.getsignal(signal.SIGTSTP) == before
    assert signal.getsignal(signal.SIGTTIN) == signal.SIG_DFL


def test_ctrl_z_ends_what_nobody_can_go_on_with() -> None:
    def body() -> None:
        with never_suspended(ends=True):
            with stops_deferred():
                send(signal.SIGTSTP)
            send(signal.SIGINT)

    assert stopped_by(body) == "stopped by SIGTSTP"


class Tracer:
    """Sends a signal before the n-th instruction of the loop and of the signal handling."""

    def __init__(self, instruction: int) -> None:
        self.left = instruction

    def __call__(self, frame: FrameType, event: str, _: object) -> "Tracer | None":
        # Of a million calls, for which a `Path` takes too long.
        if not frame.f_code.co_filename.endswith(("/loop.py", "/signals.py", "/contextlib.py")):
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            self.left -= 1
            if self.left == 0:
                signal.raise_signal(signal.SIGINT)
        return self


def stopped_at(instruction: int, made: SessionContext) -> bool:
    """Run a session, stop it at `instruction`, and return whether there is that instruction."""

    def part(context: SessionContext) -> None:
        context.device.arm()
        context.log.append(DeviceArmed.from_json({"idn": "test"}))

    tracer, before = Tracer(instruction), sys.gettrace()
    with suppress(Stopped), signals_raise():
        sys.settrace(tracer)
        try:
            run_then_turn_off(part, made)
        finally:
            sys.settrace(before)
    return tracer.left <= 0


@pytest.fixture
def memory() -> Iterator[Path]:
    """A folder in memory where there is such a place: a thousand journals wait long for a disk."""
    with tempfile.TemporaryDirectory(dir=IN_MEMORY if IN_MEMORY.is_dir() else None) as folder:
        yield Path(folder)


def test_a_signal_before_any_instruction_leaves_the_device_off(memory: Path) -> None:
    for instruction in itertools.count(1):
        device = FakeDevice()
        path = memory / f"{instruction}.db"
        with open_journal(path) as journal:
            made = context(journal, device, FakeParticipant())
            more = stopped_at(instruction, made)
            tags = [event.tag for event in journal.events("P01/1")]
        assert device.calls in ([], ["off"], ["arm", "off"]), instruction
        complete = ["device-armed", "device-off", "session-completed"]
        assert tags[1:] in ([], complete[:2], complete), instruction
        path.unlink()
        if not more:
            break
    assert instruction > 100
