"""Waiting: how long, in which steps, and who is served meanwhile."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from protocol.journal.events import DeviceArmed, WindowChanged
from runner.journal.opening import open_journal
from runner.screens import Instruction, Notice, Response, Screen, Welcome, WindowState
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.session.setup import prepare
from runner.session.waiting import (
    StoppedByOperator,
    operator_answer,
    pause_if_wanted,
    response,
    tick,
    update_view,
    wait,
)
from runner.window.client import WindowGone
from tests.runner.fakes import FakeClock, FakeDevice, FakeOperator, FakeParticipant, context


class Clock(FakeClock):
    """Remembers each sleep."""

    def __init__(self) -> None:
        super().__init__()
        self.slept: list[float] = []

    def sleep(self, seconds: float) -> None:
        self.slept.append(round(seconds, 9))
        super().sleep(seconds)


class Participant(FakeParticipant):
    """Answers from `answers_from_s` on; writes down when it is asked, and what it is shown."""

    def __init__(self, clock: FakeClock) -> None:
        super().__init__(shown=[Welcome()])
        self.clock = clock
        self.answers_from_s = 0.0
        self.polled_s: list[float] = []
        self.seen: list[tuple[float, str]] = []

    def show(self, screen: Screen) -> None:
        assert isinstance(screen, Instruction | Notice)
        self.seen.append((round(self.clock.passed_s, 9), screen.text))
        super().show(screen)

    def poll(self) -> Response | None:
        self.polled_s.append(round(self.clock.passed_s, 9))
        return super().poll() if self.clock.passed_s >= self.answers_from_s else None


class Scene:
    """A session that waits, its device, people and clock."""

    def __init__(self, made: SessionContext, device: FakeDevice, clock: Clock) -> None:
        self.made = made
        self.device = device
        self.clock = clock
        self.participant = Participant(clock)
        made.clock, made.participant = clock, self.participant
        assert isinstance(made.operator, FakeOperator)
        self.operator = made.operator

    def beats(self) -> int:
        return self.device.calls.count("beat")


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    device = FakeDevice()
    with open_journal(tmp_path / "study.db") as journal:
        yield Scene(context(journal, device, FakeParticipant()), device, Clock())


def test_a_wait_ends_on_time_and_serves_everybody_at_each_step(scene: Scene) -> None:
    called_s: list[float] = []
    wait(scene.made, 0.12, lambda: called_s.append(round(scene.clock.passed_s, 9)))
    assert scene.clock.slept == [0.05, 0.05, 0.02]
    assert called_s == [0.0, 0.05, 0.1]
    assert scene.participant.polled_s == [0.0, 0.05, 0.1, 0.12]
    assert scene.beats() == 3


def test_a_wait_may_go_in_smaller_steps(scene: Scene) -> None:
    wait(scene.made, 0.05, every_s=0.02)
    assert scene.clock.slept == [0.02, 0.02, 0.01]


def test_no_wait_polls_once(scene: Scene) -> None:
    wait(scene.made, 0.0)
    assert (scene.clock.slept, scene.participant.polled_s) == ([], [0.0])


def test_an_answer_is_waited_for_in_ticks(scene: Scene) -> None:
    scene.participant.answers_from_s = 0.1
    assert response(scene.made).answer == "ready"
    assert scene.clock.slept == [0.05, 0.05]
    assert scene.beats() == 2


def test_the_participant_is_served_while_the_operator_thinks(scene: Scene) -> None:
    def answered() -> str | None:
        return "fine" if scene.clock.passed_s >= 0.1 else None

    scene.operator.answered = answered  # type: ignore[method-assign]
    assert operator_answer(scene.made) == "fine"
    assert scene.participant.polled_s == [0.0, 0.05, 0.1]
    assert scene.operator.asked == []


def test_a_question_is_withdrawn_where_the_wait_for_it_fails(scene: Scene) -> None:
    scene.operator.answered = lambda: None  # type: ignore[method-assign]
    scene.operator.order = lambda: "stop"  # type: ignore[method-assign]
    with pytest.raises(StoppedByOperator, match="stop"):
        operator_answer(scene.made)
    assert scene.operator.asked == [""]


def test_a_stop_key_in_the_window_turns_the_output_off_at_once(scene: Scene) -> None:
    scene.participant.stops = lambda: True  # type: ignore[method-assign]
    with pytest.raises(StoppedByOperator, match="in the participant's window"):
        tick(scene.made, 1.0)
    assert (scene.device.calls[-1], scene.clock.slept) == ("emergency stop", [])
    assert scene.operator.notices == ["emergency stop in the participant's window: off was sent"]


def test_where_keys_go_is_shown_and_recorded_when_it_changes(scene: Scene) -> None:
    here, away, hidden = (
        WindowState(has_keys=has_keys, is_shown=is_shown)
        for has_keys, is_shown in ((True, True), (False, True), (False, False))
    )
    scene.participant.states = [here, here, away, away, hidden, here]
    for _ in range(8):
        tick(scene.made, 0.05)
    recorded = [state for _, state in scene.made.log.journal.records_of(WindowChanged)]
    expected = [here, away, hidden, here]
    assert [vars(state) for state in recorded] == [vars(state) for state in expected]
    assert scene.operator.notices == list(map(str, expected))


def test_a_signal_ends_a_wait_before_anything_else(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped() -> None:
        raise KeyboardInterrupt("SIGTERM")

    monkeypatch.setattr("runner.session.waiting.raise_if_stopped", stopped)
    with pytest.raises(KeyboardInterrupt, match="SIGTERM"):
        tick(scene.made, 1.0)
    assert (scene.beats(), scene.clock.slept) == (0, [])


@pytest.mark.parametrize(("pause_s", "saved_s"), [(2.0, 0.5), (0.2, 0.2), (0.5, 0.5)])
def test_a_page_says_for_a_moment_that_the_answer_is_saved(
    scene: Scene, pause_s: float, saved_s: float
) -> None:
    study = scene.made.session.study
    timing = study.timing.model_copy(update={"inter_trial_s": pause_s})
    study = study.model_copy(update={"timing": timing})
    scene.made.session = replace(scene.made.session, study=study)
    trial = replace(scene.made.session.plan.trials[0], break_s=0.0)
    pause_if_wanted(scene.made, trial)
    assert scene.participant.seen == [(saved_s, "wait.touch")]
    assert scene.clock.passed_s == pytest.approx(pause_s)


@pytest.mark.parametrize(("answers_s", "ends_s"), [(0.0, 30.0), (40.0, 40.0)])
def test_a_break_ends_with_its_time_and_an_answer(
    scene: Scene, answers_s: float, ends_s: float
) -> None:
    pause_s = scene.made.session.study.timing.inter_trial_s
    scene.participant.answers_from_s = pause_s + answers_s
    trial = replace(scene.made.session.plan.trials[0], break_s=30.0)
    pause_if_wanted(scene.made, trial)
    assert scene.participant.seen[-1] == (pause_s, "break")
    assert scene.clock.passed_s == pytest.approx(pause_s + ends_s, abs=0.11)
    polled = [at_s for at_s in scene.participant.polled_s if at_s > pause_s]
    assert (len(polled) > 100) is (answers_s > 0), "an answer that was given is kept"


@pytest.mark.parametrize("has_watchdog", [True, False])
def test_a_window_that_fails_ends_whatever_is_driven_before_the_first_touch(
    scene: Scene, has_watchdog: bool
) -> None:
    """The test of the watchdog, and the measurement of the resonance."""
    scene.device.has_watchdog = has_watchdog

    def poll() -> Response | None:
        if scene.device.on:
            raise WindowGone("is gone")
        return None

    scene.participant.poll = poll  # type: ignore[method-assign]
    with pytest.raises(WindowGone):
        prepare(scene.made)
    assert scene.device.calls[-1] in {"watchdog_trips", "resonance"}
    assert ("resonance" in scene.device.calls) is not has_watchdog


def test_a_short_break_is_a_break(scene: Scene) -> None:
    trial = replace(scene.made.session.plan.trials[0], break_s=0.5)
    pause_if_wanted(scene.made, trial)
    assert scene.participant.seen[-1][1] == "break"


def test_the_participant_is_served_while_the_session_pauses(scene: Scene) -> None:
    made = scene.made
    made.log.append(DeviceArmed(idn="fake", boot=1, device_time_s=0.0))
    made.pause_wanted = True
    trial = replace(made.session.plan.trials[0], break_s=0.0)

    class Ends(FakeClock):
        def sleep(self, seconds: float) -> None:
            super().sleep(seconds)
            made.pause_wanted = self.passed_s < made.session.study.timing.inter_trial_s + 0.2

    made.clock = scene.participant.clock = Ends()
    pause_if_wanted(made, trial)
    paused_s, text = scene.participant.seen[-1]
    assert text == "pause"
    assert len([at_s for at_s in scene.participant.polled_s if at_s > paused_s]) == 4
    assert [view.state for view in scene.operator.seen] == ["paused"]
    assert made.log.state.name == "armed"


@pytest.mark.parametrize(
    ("changes", "label"),
    [
        ({}, "voltage"),
        ({"kind": "catch"}, "voltage, catch"),
        ({"kind": "pass"}, "voltage"),
        ({"level": 0.5}, "voltage, level 0.5"),
        ({"opposite": True}, "voltage, opposite order"),
        ({"condition": None, "kind": "baseline"}, "baseline"),
    ],
)
def test_the_operator_reads_what_a_trial_is(
    scene: Scene, changes: dict[str, Any], label: str
) -> None:
    session = scene.made.session
    (planned,) = (trial for trial in session.plan.trials if trial.condition == "voltage")
    trial = replace(planned, **changes)
    scene.made.session = replace(session, plan=replace(session.plan, trials=(trial,)))
    update_view(scene.made)
    assert [line.label for line in scene.operator.seen[-1].plan] == [label]


def test_the_operator_sees_what_a_touch_should_be(scene: Scene) -> None:
    scene.made.participant = FakeParticipant()
    run(scene.made)
    aims = [view.aim for view in scene.operator.seen if view.aim]
    during = [view for view in scene.operator.seen if view.aim]
    assert {view.state for view in during} == {"touching"}
    assert {sum(line.running for line in view.plan) for view in during} == {1}
    # Half of the force is the default; one condition presses harder.
    assert {(aim.force_n, aim.force_range_n) for aim in aims} == {
        (0.5, (0.25, 0.75)), (0.75, (0.375, 1.125))
    }  # fmt: skip
    assert not any(view.records for view in scene.operator.seen)
    # 1.01 of the nominal resonance is measured; one condition drives 2 % below it.
    assert {round(aim.frequency_hz) for aim in aims} == {24_463, 23_974}
