"""The session loop: what is recorded, and the device off however the session ends."""

from dataclasses import replace
from pathlib import Path

import pytest

from device.drivers.limits import Setpoint
from device.errors import DeviceError, OutputUnknown
from protocol.journal.events import DeviceOff, Event, TrialAborted
from protocol.journal.records import ReadBack
from protocol.plan.trials import session_s
from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.journal.store import Journal, JournalError, SessionLog
from runner.screens import (
    Ask,
    Instruction,
    LeadIn,
    Note,
    Notice,
    Order,
    Pacing,
    Response,
    Screen,
    Welcome,
)
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.session.waiting import StoppedByOperator, pause_if_wanted
from tests.runner.fakes import FakeDevice, FakeOperator, FakeParticipant, context
from touchbeam.cli.output import complaint

TEXT = template("paper")


def carried_out(
    journal: Journal,
    device: FakeDevice,
    participant: FakeParticipant,
    text: str = TEXT,
    orders: list[tuple[str, Order | Note]] | None = None,
) -> SessionLog:
    made = context(journal, device, participant, text, FakeOperator(device, orders or []))
    run(made)
    return made.log


def tags(journal: Journal) -> list[str]:
    return [event.tag for event in journal.events("P01/1")]


def test_a_session_ends_complete_with_the_device_off(tmp_path: Path) -> None:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        log = carried_out(journal, device, FakeParticipant())
        assert log.state.name == "completed"
        assert log.state.answered == set(range(7))
        assert tags(journal)[-2:] == ["device-off", "session-completed"]
        assert journal.events("P01/1")[-2].payload["confirmed"] is True
    assert not device.on
    assert device.calls[-1] == "off"


def test_each_touch_is_commanded_and_read_back(tmp_path: Path) -> None:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, device, FakeParticipant())
        events = journal.events("P01/1")
    started = [event.payload for event in events if event.tag == "touch-started"]
    ended = [event.payload for event in events if event.tag == "touch-ended"]
    assert len(started) == len(ended) == 12
    assert all(end["read_back"][0]["output"] for end in ended)
    assert {entry["commanded"]["frequency_hz"] for entry in started} == {
        1.01 * 24_221,
        0.98 * (1.01 * 24_221),
    }, "frequencies are relative to the measured resonance"
    assert max(point.voltage_v for point in device.driven) == 200


def test_the_participant_does_not_learn_what_the_device_does(tmp_path: Path) -> None:
    participant = FakeParticipant()
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, FakeDevice(), participant)
    harder = [screen for screen in participant.shown if isinstance(screen, Pacing)]
    assert {screen.force_n for screen in harder} == {0.5, 0.75}
    instructions = {s.text for s in participant.shown if isinstance(s, Instruction)}
    assert instructions == {
        "touch.smooth",
        "touch.smooth.harder",
        "touch.right",
        "touch.left",
        "remember",
    }


class Watching(FakeParticipant):
    """A participant who notes the device's calls and the time as the screens of a touch come."""

    seen: list[tuple[str, float, int, int]]
    made: SessionContext

    def show(self, screen: Screen) -> None:
        super().show(screen)
        if isinstance(screen, LeadIn | Pacing):
            device = self.made.device
            assert isinstance(device, FakeDevice)
            now_s = self.made.clock.monotonic_s()
            self.seen.append((type(screen).__name__, now_s, len(device.driven), device.looked))


@pytest.mark.parametrize(("lead_in_s", "lasts_s"), [(3.0, 3.0), (0.2, 0.25), (0.0, 0.25)])
def test_a_held_drive_is_steady_before_the_mark_moves(
    tmp_path: Path, lead_in_s: float, lasts_s: float
) -> None:
    device, participant = FakeDevice(), Watching()
    participant.seen = []
    text = TEXT.replace("hold_s = 2.0", f"hold_s = 2.0\nlead_in_s = {lead_in_s}")
    with open_journal(tmp_path / "study.db") as journal:
        participant.made = context(journal, device, participant, text)
        run(participant.made)
        ended = [e.payload for e in journal.events("P01/1") if e.tag == "touch-ended"]
    leads, moves = participant.seen[2:4]  # the first touch is made at 0 V
    assert (leads[0], moves[0]) == ("LeadIn", "Pacing")
    assert moves[1] - leads[1] == pytest.approx(lasts_s), "100 V at 400 V/s take 0.25 s"
    assert moves[2] - leads[2] == 1, "it is driven once"
    assert moves[3] - leads[3] > lasts_s / 0.2, "and read five times a second"
    assert len(ended[1]["trace"]) == 2 / 0.2 + 2, "nothing before the mark moves is judged"


def test_an_answer_that_disagrees_leaves_the_score_missing(tmp_path: Path) -> None:
    participant = FakeParticipant(changes=["same"] * 9)
    text = TEXT.replace('"places"\nexpected = "swapped"', '"strength"\nexpected = "stronger"')
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, FakeDevice(), participant, text)
        answers = [e.payload for e in journal.events("P01/1") if e.tag == "answered"]
    assert [answer["agrees"] for answer in answers] == [None] + [False] * 6
    assert {answer["score"] for answer in answers} == {None}
    asked = {screen.question.name for screen in participant.shown if isinstance(screen, Ask)}
    assert asked == {"roughness", "strength"}


def test_a_study_may_always_ask_for_the_score(tmp_path: Path) -> None:
    participant = FakeParticipant(changes=["rougher"] * 9)
    text = TEXT.replace('score_when = "agrees"', 'score_when = "always"').replace(
        '"places"\nexpected = "swapped"', '"roughness"\nexpected = "smoother"'
    )
    text = text.replace('"strength"\nexpected = "stronger"', '"roughness"\nexpected = "smoother"')
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, FakeDevice(), participant, text)
        answers = [e.payload for e in journal.events("P01/1") if e.tag == "answered"]
    assert [answer["score"] for answer in answers] == [None, None] + [7] * 5


@pytest.mark.parametrize("call", ["arm", "resonance", "drive", "beat"])
def test_a_session_resumes_after_a_device_failure(tmp_path: Path, call: str) -> None:
    failing = FakeDevice(fails=call)
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(DeviceError, match=f"{call} failed"):
            carried_out(journal, failing, FakeParticipant())
        assert failing.calls[-1] == "off"
        log = carried_out(journal, FakeDevice(), FakeParticipant())
        assert log.state.answered == set(range(7))
        assert "session-resumed" in tags(journal)


@pytest.mark.parametrize("moment", ["touch.right", "Pacing", "name='roughness'", "name='score'"])
def test_a_trial_interrupted_by_a_stop_is_aborted_and_repeated(tmp_path: Path, moment: str) -> None:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(KeyboardInterrupt):
            carried_out(journal, device, FakeParticipant(stops_at=moment))
        assert not device.on
        assert tags(journal)[-2:] == ["trial-aborted", "device-off"]
        log = carried_out(journal, device, FakeParticipant())
        assert log.state.aborted
        assert log.state.answered == set(range(7))
        assert tags(journal).count("answered") == 7


def test_an_output_not_read_back_as_off_is_reported_as_unknown(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(OutputUnknown, match="UNKNOWN - cut the amplifier"):
            carried_out(journal, FakeDevice(fails="off"), FakeParticipant())
        off = journal.events("P01/1")[-1]
        assert (off.tag, off.payload["confirmed"]) == ("device-off", False)


def test_the_console_ends_by_showing_that_the_output_is_unknown(tmp_path: Path) -> None:
    device = FakeDevice(fails="off")
    operator = FakeOperator(device)
    with (
        open_journal(tmp_path / "study.db") as journal,
        pytest.raises(OutputUnknown, match="UNKNOWN - cut the amplifier"),
    ):
        run(context(journal, device, FakeParticipant(), TEXT, operator))
    assert operator.seen[0].output() == "not known yet", "the device has not been asked"
    assert operator.seen[-1].output() == "state UNKNOWN - cut the amplifier"


def test_a_session_stopped_by_the_operator_can_be_resumed(tmp_path: Path) -> None:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(StoppedByOperator, match="stopped by the operator"):
            carried_out(journal, device, FakeParticipant(), orders=[("touching", "stop")])
        assert not device.on
        assert tags(journal)[-2:] == ["trial-aborted", "device-off"]
        assert carried_out(journal, device, FakeParticipant()).state.name == "completed"


def test_the_operator_sees_the_result_of_an_order(tmp_path: Path) -> None:
    device = FakeDevice()
    orders: list[tuple[str, Order | Note]] = [
        ("armed", "repeat"),
        ("trial", "pause"),
        ("trial", "pause"),
        ("trial", Note(text="skin dry")),
    ]
    operator = FakeOperator(device, orders)
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, device, FakeParticipant(), TEXT, operator))
    assert operator.notices == [
        "there is no running trial to repeat",
        "pausing",
        "not pausing",
        "noted: skin dry",
    ]


def test_the_time_left_is_counted_as_check_counts_it(tmp_path: Path) -> None:
    device = FakeDevice()
    operator = FakeOperator(device)
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, FakeParticipant(), TEXT, operator)
        run(made)
    study, planned = made.session.study, made.session.plan
    left_s = [view.left_s for view in operator.seen]
    assert left_s[0] == pytest.approx(session_s(study, planned))
    assert left_s == sorted(left_s, reverse=True)
    assert left_s[-1] == 0


def test_a_resumed_session_asks_for_its_beam_again(tmp_path: Path) -> None:
    """Another participant may have used the rig in between."""
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(StoppedByOperator):
            carried_out(journal, device, FakeParticipant(), orders=[("trial", "stop")])
        operator = FakeOperator(device)
        run(context(journal, device, FakeParticipant(), TEXT, operator))
    assert operator.mounts[0] == "1 mm"


@pytest.mark.parametrize("order", ["stop", "repeat", "emergency stop"])
def test_an_order_withdraws_the_pending_question(tmp_path: Path, order: Order) -> None:
    """The operator must not be asked to mount a beam while the next touch drives it."""
    device, asked = FakeDevice(), False

    class Slow(FakeOperator):
        def answered(self) -> str | None:
            nonlocal asked
            if not asked and self.mounts[-1:] == ["no bodies"]:
                asked = True
                self.orders.append(("trial", order))
                return None
            return "fine"

    operator = Slow(device)
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, FakeParticipant(), TEXT, operator)
        if order == "repeat":
            run(made)
            assert made.log.state.answered == set(range(7))
            assert operator.mounts[:3] == ["1 mm", "no bodies", "no bodies"], "beam in doubt"
        else:
            with pytest.raises(StoppedByOperator):
                run(made)
    assert operator.asked[-1] == "", "withdrawn"


def test_a_device_that_failed_to_confirm_off_once_stays_in_doubt(tmp_path: Path) -> None:
    """A later good answer does not make the journal contradict what the operator was told."""

    class Doubtful(FakeDevice):
        def drive(self, setpoint: Setpoint) -> ReadBack:
            super().drive(setpoint)
            raise OutputUnknown("no answer")

    device = Doubtful()
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(OutputUnknown, match="UNKNOWN - cut the amplifier") as caught:
            carried_out(journal, device, FakeParticipant())
        last = journal.events("P01/1")[-1]
        assert (last.tag, last.payload["confirmed"]) == ("device-off", False)
    assert "output off, read back" not in complaint(caught.value)[0]
    assert device.calls[-1] == "off", "asked all the same"


def test_an_emergency_stop_turns_off_before_anything_else(tmp_path: Path) -> None:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(StoppedByOperator, match="emergency stop"):
            carried_out(journal, device, FakeParticipant(), orders=[("touching", "emergency stop")])
        last = journal.events("P01/1")[-1]
        assert (last.tag, last.payload["confirmed"]) == ("device-off", True)
    assert device.calls[device.calls.index("drive") :].count("drive") == 1
    assert "emergency stop" in device.calls


def test_a_repeated_trial_is_aborted_and_answered_once(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        log = carried_out(journal, FakeDevice(), FakeParticipant(), orders=[("touching", "repeat")])
        assert log.state.aborted == [0]
        assert tags(journal).count("trial-started") == 8
        assert tags(journal).count("answered") == 7


def test_the_operator_is_asked_until_the_answer_is_possible_and_sees_it(tmp_path: Path) -> None:
    device = FakeDevice()
    told = ["xyz", "dry", "warm", "51", "21,5", "101", "", "alcohol, today"]
    operator = FakeOperator(device, answers=told)
    asks = '[session]\noperator_asks = ["skin state", "room temperature", "humidity", "cleaning"]'
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, device, FakeParticipant(), f"{TEXT}\n{asks}", operator))
        (described,) = [e.payload for e in journal.events("P01/1") if e.tag == "rig-described"]
    celsius = (
        "the answer to room_temperature must be a number with at most 2 decimals, at least 0, "
        "at most 50"
    )
    assert operator.asked == [
        "What is the state of the skin (dry, normal, moist)?",
        "the answer to skin_state must be one of dry, normal, moist, got 'xyz'. "
        "What is the state of the skin (dry, normal, moist)?",
        "What is the room temperature, in °C?",
        f"{celsius}, got 'warm'. What is the room temperature, in °C?",
        f"{celsius}, got '51'. What is the room temperature, in °C?",
        "What is the relative humidity of the air, in %?",
        "the answer to humidity must be a number with at most 2 decimals, at least 0, at most 100, "
        "got '101'. What is the relative humidity of the air, in %?",
        "How and when was the surface cleaned?",
    ]
    assert described["answers"] == {
        "skin state": "dry", "room temperature": "21.5", "humidity": "",
        "cleaning": "alcohol, today",
    }  # fmt: skip
    assert operator.notices == [
        "noted: skin state dry, room temperature 21.5, cleaning alcohol, today"
    ]


def test_a_blind_operator_learns_conditions_and_answers_at_the_end(tmp_path: Path) -> None:
    device = FakeDevice()
    operator = FakeOperator(device)
    text = f"{TEXT}\n[session]\nblind_operator = true"
    with open_journal(tmp_path / "study.db") as journal:
        run(context(journal, device, FakeParticipant(), text, operator))
    *during, last = operator.seen
    for view in during:
        labels = [line.label for line in view.plan]
        assert labels == [f"trial {number}" for number in range(1, 8)]
        assert {line.answer for line in view.plan} <= {None, "answer given"}
        assert view.output() in {"not known yet", "off", "ON, as commanded"} or view.busy
    assert any(view.output() == "ON, as commanded" for view in during)
    assert last.plan[0].label == "baseline"
    assert "score 7" in str(last.plan)


def test_a_second_press_aborts_no_repeated_trial(tmp_path: Path) -> None:
    """A second press comes before the repeated trial has begun, and means the same."""
    device = FakeDevice()
    twice: list[tuple[str, Order | Note]] = [("touching", "repeat"), ("trial", "repeat")]
    operator = FakeOperator(device, 2 * twice)

    class Slow(FakeParticipant):
        thought_over = 0

        def poll(self) -> Response | None:
            before, self.thought_over = self.thought_over, len(self.shown)
            return super().poll() if before == len(self.shown) else None

    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, Slow(), TEXT, operator)
        run(made)
    assert made.log.state.aborted == [0, 0]
    assert operator.notices == 2 * [
        "the trial is broken off and will be repeated",
        "this trial is being repeated already",
    ]


def test_a_pause_lasts_until_the_operator_ends_it(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        orders: list[tuple[str, Order | Note]] = [("touching", "pause"), ("paused", "pause")]
        log = carried_out(journal, FakeDevice(), FakeParticipant(), orders=orders)
        events = tags(journal)
        assert events[events.index("paused") - 1] == "answered", "a trial is finished first"
        assert events[events.index("paused") + 1] == "unpaused"
        assert log.state.name == "completed"


@pytest.mark.parametrize("order", ["stop", "emergency stop"])
def test_the_participant_is_told_to_let_go_once_the_output_is_off(
    tmp_path: Path, order: Order
) -> None:
    device = FakeDevice()

    class Last(FakeParticipant):
        def show(self, screen: Screen) -> None:
            super().show(screen)
            assert screen != Notice(text="stopped") or not device.on

    participant = Last()
    with open_journal(tmp_path / "study.db") as journal, pytest.raises(StoppedByOperator):
        carried_out(journal, device, participant, orders=[("touching", order)])
    assert participant.shown[-1] == Notice(text="stopped")


def test_a_break_lasts_until_its_time_is_over(tmp_path: Path) -> None:
    participant = FakeParticipant(shown=[Welcome()])
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(), participant)
        trial = replace(made.session.plan.trials[0], break_s=30.0)
        pause_if_wanted(made, trial)
        least_s = made.session.study.timing.inter_trial_s + 30.0
        assert made.clock.monotonic_s() == pytest.approx(least_s, abs=0.1)
    assert participant.shown[-1] == Instruction(text="break", after_s=30.0)


def test_a_note_is_written_down(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        orders: list[tuple[str, Order | Note]] = [("touching", Note(text="a lorry passed"))]
        carried_out(journal, FakeDevice(), FakeParticipant(), orders=orders)
        (note,) = (event for event in journal.events("P01/1") if event.tag == "note")
        assert note.payload == {"text": "a lorry passed"}


def test_practice_is_renewed_on_resuming_if_the_study_says_so(tmp_path: Path) -> None:
    text = template("extended")
    with open_journal(tmp_path / "study.db") as journal:
        stopping = FakeParticipant(stops_at="text='break'")
        with pytest.raises(KeyboardInterrupt):
            carried_out(journal, FakeDevice(), stopping, text)
        log = carried_out(journal, FakeDevice(), FakeParticipant(), text)
        assert "practice-renewed" in tags(journal)
        assert "rig-described" in tags(journal)
        assert log.state.name == "completed"
        assert not log.state.answered_twice


class Crashing(FakeParticipant):
    """A participant whose window crashes while the finger is on the beam."""

    def poll(self) -> Response | None:
        if isinstance(self.shown[-1], Pacing):
            raise RuntimeError("the window is gone")  # noqa: TRY004 - what a window may raise
        return super().poll()


def test_an_exception_in_the_participants_window_leaves_the_device_off(tmp_path: Path) -> None:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(RuntimeError, match="the window is gone"):
            carried_out(journal, device, Crashing())
        assert not device.on
        assert tags(journal)[-2:] == ["trial-aborted", "device-off"]
        assert carried_out(journal, device, FakeParticipant()).state.name == "completed"


class ClosedJournal:
    """A journal that becomes unwritable when the device is turned off at the end."""

    def __init__(self, log: SessionLog) -> None:
        self._log = log
        self.state = log.state

    def append(self, event: Event) -> None:
        if isinstance(event, TrialAborted | DeviceOff):
            raise JournalError("the database is locked")
        self._log.append(event)


def test_an_unknown_output_is_reported_before_a_journal_error(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, FakeDevice(fails="off"), FakeParticipant())
        made.log = ClosedJournal(made.log)  # type: ignore[assignment]
        with pytest.raises(OutputUnknown, match="UNKNOWN - cut the amplifier"):
            run(made)
