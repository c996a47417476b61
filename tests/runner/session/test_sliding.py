"""The sliding experiment in the session loop: its passes, and the output off on every way out."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from device.errors import DeviceError
from protocol.errors import BadInput
from protocol.journal.events import SLIDE, Answered, SessionOpened, TouchStarted
from protocol.plan.plan import slide_plan, slide_study
from protocol.study.touch import SlidePass
from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import open_journal
from runner.journal.store import Journal, SessionLog
from runner.journal.verification import verdicts
from runner.people.sliding_block import SlidePlot, SlidingBlock
from runner.screens import Note, Order
from runner.session.loop import run
from runner.session.session import Session, SessionContext
from runner.session.waiting import StoppedByOperator
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator
from tests.system.test_killed import DyingJournal, Killed

SECTION = """
[slide]
frequencies = [0.99, 1.0]
references = 2
directions = ["right", "left"]
speeds_m_s = [0.02]
"""
TEXT = template("paper").replace("[touch]", f"{SECTION}\n[touch]", 1)
PASSES = 2 * (3 + 2)
SHORT = TEXT.replace("references = 2", "references = 1").replace('"right", "left"', '"right"')
FEW = 3 + 1


@dataclass
class FakeFinger:
    """Notes where it is put and how it moves."""

    made: list[tuple[float, float, str, float]] = field(default_factory=list)
    lifted: int = 0

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        self.made.append((force_n, position_m, direction, round(speed_m_s, 6)))
        return 0.4

    def lift(self) -> None:
        self.lifted += 1


def sliding(
    journal: Journal,
    device: Any,
    *,
    operator: FakeOperator | None = None,
    finger: FakeFinger | None = None,
    text: str = TEXT,
    clock: FakeClock | None = None,
) -> SessionContext:
    """Return the context of slide/1, new or resumed, with its block in the participant's place."""
    clock = clock or FakeClock()
    log = SessionLog(journal, "slide/1", clock)
    if log.state.opened:
        clock.passed_s = 3600.0
    study = slide_study(parsed_study(text))
    session = Session(
        participant=SLIDE,
        number=1,
        kind="slide",
        study=study,
        study_text=text,
        plan=slide_plan(study),
    )
    new = log.state.name == "new"
    if new:
        log.append(session.recorded_as(SessionOpened))
    operator = operator or FakeOperator(device)
    block = SlidingBlock(
        operator=operator,
        forces=lambda: device.forces,
        clock=clock,
        plan=session.plan,
        load_n=study.touch.force_n,
        plot=SlidePlot(),
        finger=finger,
    )
    return SessionContext(
        session=session,
        device=device,
        participant=block,
        operator=operator,
        clock=clock,
        log=log,
        opened_now=new,
    )


def records(journal: Journal, kind: type[Any]) -> list[Any]:
    return [event.record for event in journal.events("slide/1") if event.tag == kind.TAG]


def test_every_pass_is_made_once_with_the_output_off_between(tmp_path: Path) -> None:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        run(made := sliding(journal, device))
        assert made.log.state.name == "completed"
        assert made.log.state.answers == dict.fromkeys(range(PASSES), "drawn")
        (opened,) = records(journal, SessionOpened)
        assert (opened.participant, opened.kind, opened.slot) == (SLIDE, "slide", None)
        assert {trial.kind for trial in opened.trials} == {"pass"}
        driven = [record.commanded for record in records(journal, TouchStarted)]
        answered = records(journal, Answered)
    assert device.calls[-1] == "off"
    assert not device.on
    changes = [call for call in device.calls if call in {"drive", "off"}]
    assert changes[-2 * PASSES - 1 :] == ["drive", "off"] * PASSES + ["off"]
    planned = [trial.touches[0] for trial in made.session.plan.trials]
    assert [drive.voltage_v for drive in driven] == [touch.voltage_v for touch in planned]
    assert [entry.condition for entry in answered] == [
        trial.condition for trial in made.session.plan.trials
    ]
    assert not any(entry.traces for entry in answered), "nobody was asked anything"


def test_a_fixed_drive_is_the_same_at_every_resonance(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        run(made := sliding(journal, FakeDevice()))
        driven = [record.commanded.frequency_hz for record in records(journal, TouchStarted)]
    for trial, hz in zip(made.session.plan.trials, driven, strict=True):
        (touch,) = trial.touches
        assert isinstance(touch, SlidePass)
        assert hz == pytest.approx(touch.frequency_hz or touch.frequency * 1.01 * 24_221)
    assert driven.count(23_200) == 2


def test_the_operator_puts_the_block_at_the_end_where_it_begins(tmp_path: Path) -> None:
    device = FakeDevice()
    operator = FakeOperator(device)
    with open_journal(tmp_path / "study.db") as journal:
        run(made := sliding(journal, device, operator=operator))
    asked = [text for text in operator.asked if text.startswith("Put the block")]
    ends = {"right": "left end of its way, its right edge at 10 mm", "left": "right end"}
    assert len(asked) == PASSES
    for trial, text in zip(made.session.plan.trials, asked, strict=True):
        assert text.startswith("Put the block (0.56 N) on the beam at the ")
        assert ends[trial.touches[0].direction] in text
    told = [text for text in operator.notices if "mu" in text]
    assert len(told) == PASSES
    assert told[0] == "pass 1, reference, 0 V, to the right: mu 0.400, from 0.400 to 0.400" or (
        told[0] == "pass 1, reference, 0 V, to the left: mu 0.400, from 0.400 to 0.400"
    )


def test_a_simulated_finger_draws_the_block_and_nobody_is_asked(tmp_path: Path) -> None:
    device, finger = FakeDevice(), FakeFinger()
    operator = FakeOperator(device)
    with open_journal(tmp_path / "study.db") as journal:
        run(made := sliding(journal, device, operator=operator, finger=finger))
    assert not [text for text in operator.asked if text.startswith("Put the block")]
    assert finger.lifted >= PASSES
    ends = {"right": 0.010, "left": 0.081}
    wanted = [
        (0.56, ends[direction], direction, speed)
        for direction in (trial.touches[0].direction for trial in made.session.plan.trials)
        for speed in (0.0, 0.02)
    ]
    assert finger.made == wanted, "it rests during the lead-in, then it moves"


def test_a_resonance_at_which_a_pass_breaks_a_limit_ends_the_experiment(tmp_path: Path) -> None:
    text = TEXT.replace("max_frequency_hz = 40000", "max_frequency_hz = 24250")
    device = FakeDevice()  # finds the resonance at 1.01 times the nominal one
    with (
        open_journal(tmp_path / "study.db") as journal,
        pytest.raises(BadInput, match=r"is 24463 Hz: slide, 1 x resonance.*: the drive must not"),
    ):
        run(sliding(journal, device, text=text))
    assert "drive" not in device.calls
    assert device.calls[-1] == "off"


@pytest.mark.parametrize("fails", ["drive", "beat", "record", "recorded"])
def test_the_output_is_off_whatever_fails_and_the_experiment_goes_on(
    tmp_path: Path, fails: str
) -> None:
    device = FakeDevice(fails=fails)
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(DeviceError, match=f"{fails} failed"):
            run(sliding(journal, device))
        assert not device.on
        assert device.calls[-1] == "off"
        run(made := sliding(journal, FakeDevice()))
        assert len(made.log.state.answered) == PASSES
        assert all(verdict.ok for verdict in verdicts(journal))


ORDERS: list[Order] = ["stop", "emergency stop"]


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("state", ["armed", "trial", "touching"])
def test_the_operator_stops_a_pass_anywhere(tmp_path: Path, state: str, order: Order) -> None:
    device = FakeDevice()
    orders: list[tuple[str, Order | Note]] = [(state, order)]
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(StoppedByOperator, match="stop"):
            run(sliding(journal, device, operator=FakeOperator(device, orders)))
        assert not device.on
        assert device.calls[-1] == "off"
        run(made := sliding(journal, FakeDevice()))
        assert len(made.log.state.answered) == PASSES


def test_a_pass_is_repeated_at_the_operators_request(tmp_path: Path) -> None:
    device = FakeDevice()
    orders: list[tuple[str, Order | Note]] = [("touching", "repeat")]
    with open_journal(tmp_path / "study.db") as journal:
        run(made := sliding(journal, device, operator=FakeOperator(device, orders)))
    assert made.log.state.aborted == [0]
    assert made.log.state.answered == set(range(PASSES))


@pytest.mark.parametrize("after", [False, True], ids=["before", "after"])
def test_an_experiment_killed_at_any_write_has_whole_passes_only(
    tmp_path: Path, after: bool
) -> None:
    with open_journal(tmp_path / "whole.db") as journal:
        run(sliding(journal, FakeDevice(), text=SHORT))
        writes = len(journal.events("slide/1"))
    for at in range(writes):
        path = tmp_path / f"{at}.db"
        with open_journal(path) as journal:
            dying: Any = DyingJournal(journal, at, after=after)
            with pytest.raises(Killed):
                run(sliding(dying, FakeDevice(), text=SHORT))
        with open_journal(path) as journal:
            made = sliding(journal, device := FakeDevice(), text=SHORT)
            before = set(made.log.state.answered)
            if made.log.state.name != "completed":
                run(made)
            (verdict,) = verdicts(journal)
            assert verdict.ok, verdict
            assert (verdict.trials_answered, verdict.missing) == (FEW, 0)
            started = sum(event.tag == "trial-started" for event in journal.events("slide/1"))
            assert started == FEW + verdict.trials_aborted
            driven = device.calls.count("drive")
            assert driven == FEW - len(before), "what was drawn is not drawn again"
