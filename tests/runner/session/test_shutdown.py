"""How a session ends, in any way: off first, then the journal, then one truthful word to all."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from device.drivers.limits import Setpoint
from device.errors import DeviceError, LimitExceeded, OutputLastOff, OutputUnknown
from protocol.journal.events import DeviceOff, Event, TouchStarted
from protocol.journal.records import Identity, ReadBack
from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.journal.store import Journal, JournalError, SessionLog
from runner.journal.verification import verdicts
from runner.screens import Instruction, Notice, OperatorView, Screen, Wanted
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.session.waiting import StoppedByOperator
from runner.signals import never_suspended
from tests.runner.fakes import FakeDevice, FakeOperator, FakeParticipant, context

TEXT = template("paper")
OFF = "output off, read back"
RESUMABLE = "run the same command again to resume"


def payloads(journal: Journal, tag: str) -> list[dict[str, Any]]:
    return [dict(event.payload) for event in journal.events("P01/1") if event.tag == tag]


def notes_of(
    made: SessionContext, kind: type[BaseException], message: str, work: Any = run
) -> list[str]:
    """What the error that ends a session says besides its message."""
    with pytest.raises(kind, match=message) as caught:
        work(made)
    return getattr(caught.value, "__notes__", [])


def test_all_are_told_that_a_session_is_complete(tmp_path: Path) -> None:
    device, participant = FakeDevice(), FakeParticipant()
    operator = FakeOperator(device)
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, device, participant, TEXT, operator))
        assert payloads(journal, "device-off") == [{"confirmed": True, "why": "end of session"}]
    assert participant.shown[-1] == Notice(text="thanks")
    assert operator.seen[-1].state == "completed"


def _done(view: OperatorView) -> int:
    return sum(line.answer is not None for line in view.plan)


def test_the_operator_sees_each_trial_begin(tmp_path: Path) -> None:
    device = FakeDevice()
    operator = FakeOperator(device)
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, device, FakeParticipant(), TEXT, operator))
    views = [view for view in operator.seen if view.state == "trial"]
    first = [view for before, view in zip([None, *views], views, strict=False)
             if before is None or _done(before) != _done(view)]  # fmt: skip
    assert [view.warning for view in first] == [""] * 7
    assert all(view.device is None for view in first), "shown before its first touch"


def test_the_log_is_kept_small_at_the_end_of_each_block(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answered: list[int] = []
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant(), template("extended"))
        monkeypatch.setattr(
            Journal, "checkpoint", lambda _: answered.append(len(made.log.state.answered))
        )
        run(made)
    blocks = [trial.block for trial in made.session.plan.trials]
    assert answered == [at for at in range(1, len(blocks)) if blocks[at] != blocks[at - 1]]
    assert len(answered) > 1


class Repeating(FakeDevice):
    """Remembers what the journal had last whenever the output was turned off."""

    def __init__(self, state: Callable[[], str]) -> None:
        super().__init__()
        self._state = state
        self.off_in: list[tuple[bool, str]] = []

    def off(self) -> None:
        self.off_in.append((self.on, self._state()))
        super().off()


def test_a_repeated_touch_is_off_before_its_trial_is_aborted(tmp_path: Path) -> None:
    device = Repeating(lambda: made.log.state.name)
    operator = FakeOperator(device, [("touching", "repeat")])
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, FakeParticipant(), TEXT, operator)
        run(made)
        assert payloads(journal, "trial-aborted") == [
            {"index": 0, "why": "repeated at the operator's request"}
        ]
    assert device.off_in.count((True, "touching")) == 12 + 1, "each touch, and the repeated one"
    assert {state for on, state in device.off_in if on} == {"touching"}


def test_ctrl_z_breaks_a_touch_off_and_does_nothing_between_trials(tmp_path: Path) -> None:
    device = Repeating(lambda: made.log.state.name)
    pressed: list[str] = []

    class Operator(FakeOperator):
        def order(self) -> Wanted | None:
            name = made.log.state.name
            if name in {"armed", "touching"} and name not in pressed:
                pressed.append(name)
                os.kill(os.getpid(), signal.SIGTSTP)
            return None

    operator = Operator(device)
    with open_journal(tmp_path / "study.db") as journal, never_suspended():
        made = context(journal, device, FakeParticipant(), TEXT, operator)
        run(made)
        assert payloads(journal, "trial-aborted") == [
            {"index": 0, "why": "broken off by Ctrl-Z (SIGTSTP)"}
        ]
        assert [verdict.ok for verdict in verdicts(journal)] == [True]
    assert device.off_in.count((True, "touching")) == 12 + 1, "each touch, and the one broken off"
    assert pressed == ["armed", "touching"]
    refusal = (
        "Ctrl-Z does not suspend a session; the order s stops it, and the same command resumes it"
    )
    told = [refusal, refusal, "the trial is broken off and will be repeated"]
    assert [text for text in operator.notices if "warning" not in text][-3:] == told


def test_what_a_dead_process_left_open_is_closed_before_a_session_is_resumed(
    tmp_path: Path,
) -> None:
    class Dead(BaseException):
        """Nothing of the process happens any more."""

    class Dying(SessionLog):
        def append(self, event: Event) -> None:
            if dead:
                raise Dead
            super().append(event)
            if isinstance(event, TouchStarted):
                dead.append(True)
                raise Dead

    dead: list[bool] = []
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant())
        made.log = Dying(journal, "P01/1", made.clock)
        with pytest.raises(Dead):
            run(made)
        assert journal.events("P01/1")[-1].tag == "touch-started"
        run(context(journal, FakeDevice(), FakeParticipant()))
        events = journal.events("P01/1")
        tags = [event.tag for event in events]
        at = tags.index("session-resumed")
        why = "the session was interrupted"
        assert tags[at - 2 : at] == ["trial-aborted", "device-off"]
        assert events[at - 2].payload == {"index": 0, "why": why}
        assert events[at - 1].payload == {"confirmed": False, "why": why}


def test_practice_is_renewed_as_far_as_it_went_and_nothing_else(tmp_path: Path) -> None:
    text = template("extended")
    with open_journal(tmp_path / "study.db") as journal:
        early = context(journal, FakeDevice(fails="arm"), FakeParticipant(), text)
        kinds = [trial.kind for trial in early.session.plan.trials]
        notes_of(early, DeviceError, "arm failed")
        notes_of(
            context(journal, FakeDevice(fails="arm"), FakeParticipant(), text),
            DeviceError,
            "arm failed",
        )
        assert payloads(journal, "practice-renewed") == [], "none was answered"
        stopping = FakeParticipant(stops_at="text='break'")
        notes_of(context(journal, FakeDevice(), stopping, text), KeyboardInterrupt, "Ctrl-C")
        run(context(journal, FakeDevice(), FakeParticipant(), text))
        practice = [index for index, kind in enumerate(kinds) if kind == "practice"]
        assert payloads(journal, "practice-renewed") == [{"indices": practice}]


def test_a_session_that_is_stopped_while_it_pauses_is_off(tmp_path: Path) -> None:
    device = FakeDevice()
    operator = FakeOperator(device, [("touching", "pause"), ("paused", "stop")])
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, FakeParticipant(), TEXT, operator)
        assert notes_of(made, StoppedByOperator, "stopped") == [OFF, RESUMABLE]
        tags = [event.tag for event in journal.events("P01/1")]
        assert tags[-2:] == ["paused", "device-off"]


@pytest.mark.parametrize(("said", "why"), [("stop", "stop"), ("", "KeyboardInterrupt")])
def test_an_end_says_why_even_where_the_error_does_not(tmp_path: Path, said: str, why: str) -> None:
    class Leaving(FakeParticipant):
        def show(self, screen: Screen) -> None:
            super().show(screen)
            if isinstance(screen, Instruction):
                raise KeyboardInterrupt(said)

    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), Leaving())
        assert notes_of(made, KeyboardInterrupt, f"^{said}\n") == [OFF, RESUMABLE]
        assert payloads(journal, "device-off") == [{"confirmed": True, "why": why}]


def test_what_would_fail_again_is_not_said_to_be_resumable(tmp_path: Path) -> None:
    class Refusing(FakeDevice):
        def drive(self, setpoint: Setpoint) -> ReadBack:
            raise LimitExceeded("too much")

    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, Refusing(), FakeParticipant())
        assert notes_of(made, LimitExceeded, "too much") == [OFF]


def test_a_fault_before_the_device_is_armed_leaves_nothing_to_record(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(fails="arm"), FakeParticipant())
        assert notes_of(made, DeviceError, "arm failed") == [OFF, RESUMABLE]
        assert payloads(journal, "device-off") == []


class Unwritable(SessionLog):
    """A journal that takes nothing any more once a touch has begun."""

    broken = False

    def append(self, event: Event) -> None:
        if self.broken:
            raise JournalError("the disk is full")
        super().append(event)
        self.broken = isinstance(event, TouchStarted)


@pytest.mark.parametrize("answers", [True, False])
def test_an_end_that_cannot_be_recorded_still_says_what_the_output_does(
    tmp_path: Path, answers: bool
) -> None:
    class Device(FakeDevice):
        def off(self) -> None:
            super().off()
            if not answers and made.log.state.name == "touching":
                raise OutputUnknown("no answer")

    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, Device(), FakeParticipant())
        made.log = Unwritable(journal, "P01/1", made.clock)
        if answers:
            assert notes_of(made, JournalError, "the disk is full") == [OFF, RESUMABLE]
        else:
            with pytest.raises(OutputUnknown, match="no answer") as caught:
                run(made)
            assert isinstance(caught.value.__cause__, JournalError)
            assert OFF not in getattr(caught.value, "__notes__", [])


def test_a_session_whose_off_cannot_be_recorded_is_not_complete(tmp_path: Path) -> None:
    class Lacking(SessionLog):
        def append(self, event: Event) -> None:
            if isinstance(event, DeviceOff):
                raise JournalError("the disk is full")
            super().append(event)

    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), FakeParticipant())
        made.log = Lacking(journal, "P01/1", made.clock)
        assert notes_of(made, JournalError, "the disk is full") == [OFF, RESUMABLE]
        assert journal.events("P01/1")[-1].tag == "answered"


def test_an_output_that_was_never_on_is_no_alarm_if_the_device_falls_silent(tmp_path: Path) -> None:
    class Device(FakeDevice):
        def arm(self) -> Identity:
            raise OutputLastOff("no answer")

        def off(self) -> None:
            raise OutputLastOff("no answer, again")

    device = Device()
    operator = FakeOperator(device)
    was_off = r"^no answer, again; the output was off when it was last read back, and was not"
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, FakeParticipant(), TEXT, operator)
        assert notes_of(made, OutputLastOff, was_off) == [RESUMABLE]
    assert not any(view.unknown for view in operator.seen)


def test_an_unknown_output_is_told_first_and_never_called_off(tmp_path: Path) -> None:
    device = FakeDevice(fails="off")
    operator = FakeOperator(device)
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, FakeParticipant(), TEXT, operator)
        assert notes_of(made, OutputUnknown, "no answer") == []
        (off,) = payloads(journal, "device-off")
        assert off["confirmed"] is False
        assert payloads(journal, "session-completed") == []
    assert operator.seen[-1].unknown is True
    assert [view.unknown for view in operator.seen[:-1]] == [False] * (len(operator.seen) - 1)
