"""What is proved before a session is opened: no plan that was drawn wrongly drives anything."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from protocol.plan.plan import plan as drawn
from protocol.plan.plan import slide_plan as slides_drawn
from protocol.plan.trials import Plan, Trial
from protocol.study.study import Study
from protocol.study_file.loading import template
from runner.journal.opening import open_journal, read_journal
from runner.launch.device_access import SessionRig
from tests.runner.command_line import everything, typed
from tests.runner.fakes import FakeDevice, FakeParticipant, context

Wrong = Callable[[Plan], Plan]


def numbered(plan: Plan, trials: list[Trial]) -> Plan:
    """A plan of these trials that is in order in itself."""
    names = tuple(trial.condition or "" for trial in trials if trial.kind == "trial")
    counted = tuple(replace(trial, index=index) for index, trial in enumerate(trials))
    return replace(plan, trials=counted, sequence=names)


def with_one(kind: str, nth: int = 0, **changed: Any) -> Wrong:
    """Change the `nth` trial of this kind, or its first touch where the key is one of a touch."""

    def wrong(plan: Plan) -> Plan:
        trials = list(plan.trials)
        at = [number for number, trial in enumerate(trials) if trial.kind == kind][nth]
        fields = {key: value for key, value in changed.items() if key in vars(trials[at])}
        first = (
            trials[at]
            .touches[0]
            .model_copy(update={key: value for key, value in changed.items() if key not in fields})
        )
        touches = (first, *trials[at].touches[1:])
        trials[at] = replace(trials[at], **({"touches": touches} | fields))
        return numbered(plan, trials)

    return wrong


def without(kind: str) -> Wrong:
    def wrong(plan: Plan) -> Plan:
        last = max(trial.index for trial in plan.trials if trial.kind == kind)
        return numbered(plan, [trial for trial in plan.trials if trial.index != last])

    return wrong


def doubled(plan: Plan) -> Plan:
    last = next(trial for trial in plan.trials[::-1] if trial.kind == "trial")
    return numbered(plan, [*plan.trials, last])


def unbroken(plan: Plan) -> Plan:
    return replace(plan, trials=tuple(replace(trial, break_s=0.0) for trial in plan.trials))


def backwards(plan: Plan) -> Plan:
    return numbered(plan, list(plan.trials[::-1]))


def of_session_1(plan: Plan) -> Plan:
    return replace(plan, session=1)


def exchanged(plan: Plan) -> Plan:
    """Two neighbours of one block exchanged: alone, the order is as good as any other."""
    trials = list(plan.trials)
    places = [at for at, trial in enumerate(trials) if trial.kind == "trial"][:2]
    one, other = places
    trials[one], trials[other] = trials[other], trials[one]
    return numbered(plan, trials)


WRONG: dict[str, tuple[Wrong, str]] = {
    "a voltage beyond a limit": (
        with_one("trial", voltage_v=201.0),
        "amplitude, V, must not exceed 200, got 201",
    ),
    "a frequency beyond a limit": (with_one("trial", frequency=1.7), "frequency, Hz, must not"),
    "another voltage within the limits": (
        with_one("trial", voltage_v=33.0),
        "the touches must be the condition's",
    ),
    "the wrong condition": (
        with_one("trial", condition="x"),
        "every condition must come 4 times, got {'x'",
    ),
    "the wrong answer": (with_one("trial", expected="same"), "the expected answer must be"),
    "a missing trial": (without("trial"), "every condition must come 4 times"),
    "a doubled trial": (doubled, "every condition must come 4 times"),
    "no catch trial": (without("catch"), "there must be"),
    "a driven catch trial": (with_one("catch", voltage_v=60.0), "must stay at 0 V"),
    "no practice": (without("practice"), "practice must be trials"),
    "no opening": (without("signal"), "must begin with the study's opening"),
    "no break": (unbroken, "breaks must come every 2 blocks"),
    "the order backwards": (backwards, "must begin with the study's opening"),
    "an unbalanced order": (exchanged, "every condition must follow every other equally often"),
    "another session": (of_session_1, "must be of session 2, got 1"),
    "another slot": (lambda plan: replace(plan, slot=3), "slots must be numbered from 0"),
}


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> FakeDevice:
    """The device that every session of the test opens."""
    fake = FakeDevice()

    @contextmanager
    def rig(*_: object, **__: object) -> Iterator[SessionRig]:
        yield SessionRig(device=fake, control=None)  # type: ignore[arg-type]

    for name in ("session_rig", "stepped_rig"):
        monkeypatch.setattr(f"runner.launch.device_access.{name}", rig)
    return fake


def run(folder: Path, *options: str) -> int:
    return typed("run", folder, "--participant", "P01", "--ratings", "virtual", *options)


def in_one_line(told: str, message: str) -> None:
    assert told.count("\n") == 1, told
    assert "touchbeam drew a wrong plan: " in told
    assert message in told
    assert "nothing was driven or recorded" in told


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_plan_is_refused_before_anything_is_driven(
    name: str,
    tmp_path: Path,
    device: FakeDevice,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    wrong, message = WRONG[name]

    def plan(study: Study, slot: int, session: int = 1) -> Plan:
        made = drawn(study, slot, session)
        return wrong(made) if slot == 0 else made

    monkeypatch.setattr("runner.launch.run_session.plan", plan)
    text = template("extended").replace("[design]", "[design]\nsessions = 2", 1)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    before = everything(tmp_path)
    assert run(tmp_path, *(["--session", "2", "--extra"] if name == "another session" else [])) == 1
    in_one_line(capsys.readouterr().err, message)
    assert device.calls == []
    assert everything(tmp_path) == before


WRONG_PASSES: dict[str, tuple[Wrong, str]] = {
    "a voltage beyond a limit": (with_one("pass", voltage_v=201.0), "must not exceed 200, got 201"),
    "another voltage": (with_one("pass", voltage_v=60.0), "must be made as [slide] says"),
    "another frequency": (with_one("pass", 1, frequency=0.9), "must be made as [slide] says"),
    "a sweep": (with_one("pass", sweep_to=1.01), "must be made as [slide] says"),
    "a question": (with_one("pass", scored=True), "about which nobody is asked"),
    "another time": (with_one("pass", duration_s=2.0), "a round of references must have every"),
    "another direction": (with_one("pass", direction="left"), "a round of references must have"),
    "another repeat": (with_one("pass", 10, block=2), "repeats must be numbered from 1"),
    "a missing pass": (lambda plan: numbered(plan, list(plan.trials[:-1])), "rounds of references"),
    "a missing driven pass": (
        lambda plan: numbered(plan, [*plan.trials[:1], *plan.trials[2:]]),
        "every driven pass must come once in repeat 1, got 7 passes",
    ),
    "a doubled pass": (
        lambda plan: numbered(plan, [*plan.trials[:2], *plan.trials[1:]]),
        "every driven pass must come once in repeat 1, got 9 passes",
    ),
    "references together": (
        lambda plan: numbered(plan, sorted(plan.trials, key=lambda t: t.touches[0].voltage_v)),
        "references must be spread evenly",
    ),
    "a reference too early": (
        lambda plan: numbered(plan, [plan.trials[at] for at in (0, 1, 2, 5, 3, 4, *range(6, 11))]),
        "references must be spread evenly",
    ),
    "one name twice": (
        lambda plan: replace(plan, trials=tuple(replace(t, condition="x") for t in plan.trials)),
        "a name must tell a pass from every other one",
    ),
    "another number": (lambda plan: replace(plan, trials=plan.trials[::-1]), "numbered from 0"),
    "another session": (lambda plan: replace(plan, session=2), "must be of session 1, got 2"),
}


@pytest.mark.parametrize("name", WRONG_PASSES)
def test_a_wrong_sliding_experiment_is_refused_as_well(
    name: str,
    tmp_path: Path,
    device: FakeDevice,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    wrong, message = WRONG_PASSES[name]
    monkeypatch.setattr(
        "runner.launch.run_session.slide_plan",
        lambda study, session: wrong(slides_drawn(study, session)),
    )
    (tmp_path / "study.toml").write_text(template("paper"), encoding="utf-8")
    before = everything(tmp_path)
    assert typed("slide", tmp_path) == 1
    in_one_line(capsys.readouterr().err, message)
    assert device.calls == []
    assert everything(tmp_path) == before


def test_an_amended_study_with_a_wrong_plan_is_not_accepted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "study.toml").write_text(template("paper") + "\n# amended\n", encoding="utf-8")
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant())
    louder = with_one("trial", voltage_v=201.0)
    monkeypatch.setattr("runner.study.check.plan", lambda *given: louder(drawn(*given)))
    assert typed("amend", tmp_path, "--reason", "TEST") == 1
    in_one_line(capsys.readouterr().err, "amplitude, V, must not exceed 200, got 201")
    with read_journal(tmp_path / "study.db") as journal:
        assert journal.sessions() == ["P01/1"]


def test_a_session_that_would_be_resumed_wrongly_keeps_its_events(
    tmp_path: Path,
    device: FakeDevice,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The same trials by number, kind and condition, at another voltage."""
    (tmp_path / "study.toml").write_text(template("paper"), encoding="utf-8")
    with open_journal(tmp_path / "study.db") as journal:
        context(journal, FakeDevice(), FakeParticipant(), kind="rehearsal")
        before = [event for name in journal.sessions() for event in journal.events(name)]
    monkeypatch.setattr(
        "runner.launch.run_session.plan",
        lambda *given: with_one("trial", voltage_v=201.0)(drawn(*given)),
    )
    assert run(tmp_path) == 1
    in_one_line(capsys.readouterr().err, "amplitude, V, must not exceed 200, got 201")
    assert device.calls == []
    with read_journal(tmp_path / "study.db") as journal:
        assert [e for name in journal.sessions() for e in journal.events(name)] == before
