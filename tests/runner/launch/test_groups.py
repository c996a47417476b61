"""Which group a participant belongs to: said by the operator, drawn, or answered; then for good."""

import io
import sys
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

import touchbeam
from analysis.export.trial_table import plan_frame
from analysis.loading.study_data import load_study_data
from analysis.trials.trial_checks import OrderAsRun, order_as_run
from device.errors import DeviceError
from protocol.errors import BadInput
from protocol.journal.events import QuestionAnswered, RigDescribed, SessionOpened
from protocol.plan.plan import arrivals, plan
from protocol.registration.registration import FILE, registration_in
from protocol.study_file.loading import parsed_study
from runner.journal.cohort import states
from runner.journal.opening import open_journal
from runner.launch.request import Request, SessionOptions, requested, with_group
from runner.study.folder import StudyFolder
from tests.runner.command_line import typed
from tests.runner.fakes import FakeDevice, FakeOperator, FakeParticipant
from tests.runner.registered_study import drawn_again, run_session, study_in

BOARD = "/dev/ttyUSB0"
OPERATOR, CHANCE, ANSWER = "by the operator", "at random", "by an answer"
WHEN = {
    "young": 'when = { question = "room temperature", at_most = 20 }',
    "old": 'when = { question = "room temperature", at_least = 25 }',
}


def grouped_in(folder: Path, how: str, *changes: tuple[str, str]) -> Path:
    """A study with 2 young and 4 old people."""
    groups = "".join(
        f'[[group]]\nname = "{name}"\nsize = {size}\n{WHEN[name] if how == ANSWER else ""}\n'
        for name, size in (("young", 2), ("old", 4))
    )
    design = f'[design]\nassign_groups = "{how}"\nsessions = 2\n'
    asks = '[session]\noperator_asks = ["room temperature", "cleaning"]\n'
    plain = ("[design]", f"{asks}{design}"), ("\nparticipants = 9 ", "\n# ")
    grouped = ("[[condition]]", f"{groups}\n[[condition]]")
    return study_in(folder, "paper", *plain, grouped, *changes)


def request(place: Path, participant: str, group: str | None = None, number: int = 1) -> Request:
    options = SessionOptions(
        folder=StudyFolder(path=place),
        participant=participant,
        number=number,
        device=BOARD,
        group=group,
    )
    return replace(requested(options), kind="participant")


def groups_in(place: Path) -> dict[str, tuple[str | None, int | None]]:
    with open_journal(place / "study.db") as journal:
        opened = {name: state.opened for name, state in states(journal).items()}
    return {name: (it.group, it.slot) for name, it in opened.items() if it is not None}


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    typed_there = io.StringIO()
    monkeypatch.setattr(sys, "stdin", typed_there)
    monkeypatch.setattr("runner.people.terminal.at_terminal", lambda *_: True)
    return typed_there


def say_nothing(_: str) -> None:
    pass


def test_the_operator_says_the_group_and_it_stays(tmp_path: Path) -> None:
    grouped_in(tmp_path, OPERATOR)
    with pytest.raises(BadInput, match="P01 has no group yet: give one of young, old with --group"):
        with_group(request(tmp_path, "P01"), say_nothing)
    with pytest.raises(BadInput, match=r"a group of the study \(young, old\), got 'middle'"):
        with_group(request(tmp_path, "P01", "middle"), say_nothing)
    for number, group in enumerate(("old", "young", "old"), start=1):
        run_session(tmp_path, f"P0{number}", group=group)
    wanted = {"P01/1": ("old", 0), "P02/1": ("young", 0), "P03/1": ("old", 1)}
    assert groups_in(tmp_path) == wanted, "each group counts its own slots"
    run_session(tmp_path, "P03", number=2)
    assert groups_in(tmp_path)["P03/2"] == ("old", 1)
    with pytest.raises(BadInput, match="P03 belongs to the group old, got --group young"):
        with_group(request(tmp_path, "P03", "young", number=3), say_nothing)
    with pytest.raises(BadInput, match="P03 belongs to the group old, got --group young"):
        run_session(tmp_path, "P03", number=3, group="young")


def test_names_with_commas_are_told_apart(tmp_path: Path) -> None:
    grouped_in(
        tmp_path, OPERATOR, ('"young"', '"young, right hand"'), ('"old"', '"old, left hand"')
    )
    with pytest.raises(BadInput, match="give one of young, right hand; old, left hand with"):
        with_group(request(tmp_path, "P01"), say_nothing)


def test_a_plan_in_python_is_of_the_group_that_is_asked_for(tmp_path: Path) -> None:
    grouped_in(tmp_path, OPERATOR)
    run_session(tmp_path, "P01", group="old")
    loaded = touchbeam.load(tmp_path)
    said = "P07 has no group yet: give one of young, old with the argument group"
    with pytest.raises(ValueError, match=said):
        loaded.plan("P07")
    with pytest.raises(ValueError, match=r"the argument group must be .* \(young, old\), got 'x'"):
        loaded.plan("P07", group="x")
    for group, slot in (("young", 0), ("old", 1)):
        drawn = plan(loaded.file.of_group(group), slot, 1).trials
        assert loaded.plan("P07", group=group).equals(plan_frame(drawn)), group
    assert loaded.plan("P01", group="old").equals(loaded.plan("P01"))
    with pytest.raises(ValueError, match=r"P01 began in .* old, got the argument group young"):
        loaded.plan("P01", group="young")


def test_a_session_is_resumed_in_its_group_with_its_plan(tmp_path: Path) -> None:
    grouped_in(tmp_path, OPERATOR)
    with suppress(KeyboardInterrupt):
        run_session(tmp_path, "P01", group="old", person=FakeParticipant(stops_at="Question"))
    with pytest.raises(BadInput, match="P01 began in the group old, got --group young"):
        run_session(tmp_path, "P01", group="young")
    run_session(tmp_path, "P01")
    with open_journal(tmp_path / "study.db") as journal:
        events = [event.record for event in journal.events("P01/1")]
    opened = events[0]
    assert isinstance(opened, SessionOpened)
    (again,) = (event for event in events if event.TAG == "session-resumed")
    assert (opened.group, opened.trials) == ("old", again.trials)  # type: ignore[attr-defined]
    assert typed("verify", tmp_path) == 0


def test_a_wrong_group_is_mended_by_excluding_the_session(tmp_path: Path) -> None:
    grouped_in(tmp_path, OPERATOR)
    with suppress(KeyboardInterrupt):
        run_session(tmp_path, "P01", group="old", person=FakeParticipant(stops_at="Welcome"))
    assert typed("exclude", tmp_path, "--participant", "P01", "--reason", "is young") == 0
    run_session(tmp_path, "P01", number=2, group="young")
    run_session(tmp_path, "P02", group="old")
    assert groups_in(tmp_path)["P01/2"] == ("young", 0)
    assert groups_in(tmp_path)["P02/1"] == ("old", 0), "the slot is free again"


def test_chance_decides_by_seed_and_place_in_blocks_of_all_groups(tmp_path: Path) -> None:
    study = parsed_study((grouped_in(tmp_path, CHANCE) / "study.toml").read_text())
    foreseen = list(islice(arrivals(study, "participant"), 600))
    for first in range(0, 600, 3):
        assert sorted(name for name, _ in foreseen[first : first + 3]) == ["old", "old", "young"]
    assert len({tuple(name for name, _ in foreseen[k : k + 3]) for k in range(0, 600, 3)}) == 3
    for number in range(1, 5):
        run_session(tmp_path, f"P{number:02d}")
    had = groups_in(tmp_path)
    assert list(had.values()) == foreseen[:4]
    drawn = foreseen[4][0]
    other = "old" if drawn == "young" else "young"
    with pytest.raises(BadInput, match=f"P05 is assigned at random to the group {drawn}"):
        with_group(request(tmp_path, "P05", other), say_nothing)
    # Who comes after one who left takes that place.
    with suppress(KeyboardInterrupt):
        run_session(tmp_path, "P05", person=FakeParticipant(stops_at="Welcome"))
    assert typed("exclude", tmp_path, "--participant", "P05", "--reason", "left") == 0
    run_session(tmp_path, "P06")
    assert groups_in(tmp_path)["P06/1"] == foreseen[4]


def test_rehearsals_are_spread_over_groups_and_take_no_place(tmp_path: Path) -> None:
    for how in (OPERATOR, CHANCE, ANSWER):
        place = grouped_in(tmp_path / how, how)
        for number in range(1, 4):
            run_session(place, f"P{number:02d}", kind="rehearsal")
        run_session(place, "P09", kind="rehearsal", group="young")
        had = [group for group, _ in groups_in(place).values()]
        assert sorted(map(str, had[:3])) == ["old", "old", "young"]
        assert had[3] == "young"
    run_session(tmp_path / CHANCE, "P01")
    study = parsed_study((tmp_path / CHANCE / "study.toml").read_text())
    assert groups_in(tmp_path / CHANCE)["P01/1"] == next(arrivals(study, "participant"))


def test_at_a_terminal_the_operator_is_asked_until_a_group_is_typed(
    tmp_path: Path, terminal: io.StringIO
) -> None:
    grouped_in(tmp_path, OPERATOR)
    terminal.write("middle-aged\nold\n")
    terminal.seek(0)
    said: list[str] = []
    assert with_group(request(tmp_path, "P01"), said.append).options.group == "old"
    wrong = "'middle-aged' is no group; capitals and small letters differ."
    assert said == [(ask := "Type the group of P01 (young, old), then Enter."), wrong, ask]
    run_session(tmp_path, "P01", group="old")
    found = with_group(request(tmp_path, "P01", number=2), pytest.fail)
    assert found.options.group is None, "nobody is asked twice"


def test_an_answer_leads_to_the_group_and_is_kept(tmp_path: Path, terminal: io.StringIO) -> None:
    grouped_in(tmp_path, ANSWER)
    terminal.write("warm\n\n31.5\n")
    terminal.seek(0)
    said: list[str] = []
    found = with_group(request(tmp_path, "P01"), said.append)
    assert (found.options.group, found.options.noted) == ("old", {"room temperature": "31.5"})
    assert any("must be a number" in line for line in said)
    run_session(tmp_path, "P01", group="old", noted=found.options.noted)
    with open_journal(tmp_path / "study.db") as journal:
        described = [event.answers for _, event in journal.records_of(RigDescribed)]
    assert described[0] == {"room temperature": "31.5"}, "before the rest is asked"
    assert described[1:] == [{"room temperature": "31.5", "cleaning": ""}]


def test_an_answer_that_leads_to_no_group_is_refused(tmp_path: Path, terminal: io.StringIO) -> None:
    grouped_in(tmp_path, ANSWER)
    terminal.write("22\n19\n")
    terminal.seek(0)
    told = r"room temperature 22: no group of the study is for P01 \(.* if room temperature is at"
    with pytest.raises(BadInput, match=told):
        with_group(request(tmp_path, "P01"), say_nothing)
    with pytest.raises(BadInput, match="the answer leads to the group young, got --group old"):
        with_group(request(tmp_path, "P01", "old"), say_nothing)
    # The lines are at their end: nobody types any more.
    with pytest.raises(BadInput, match="room temperature decides on the group: run this at a"):
        with_group(request(tmp_path, "P01"), say_nothing)


def test_a_study_without_groups_has_none_to_give(tmp_path: Path) -> None:
    study_in(tmp_path)
    with pytest.raises(BadInput, match=r"a group of the study \(none\), got 'old'"):
        with_group(request(tmp_path, "P01", "old"), say_nothing)
    run_session(tmp_path, "P01")
    with open_journal(tmp_path / "study.db") as journal:
        assert "group" not in journal.events("P01/1")[0].payload


def test_a_registration_locks_the_groups_and_seeds_the_orders_of_each(tmp_path: Path) -> None:
    grouped_in(tmp_path, CHANCE)
    assert typed("register", tmp_path) == 0
    registered = registration_in((tmp_path / FILE).read_text())
    assert (registered.participants, registered.groups) == (6, {"young": 2, "old": 4})
    for number in range(1, 4):
        run_session(tmp_path, f"P0{number}")
    assert typed("verify", tmp_path) == 0
    run_session(tmp_path, "P01", number=2)
    drawn, _ = groups_in(tmp_path)["P01/1"]
    with open_journal(tmp_path / "study.db") as journal:
        opened = [state.opened for state in states(journal).values()]
        chains = [journal.events(name) for name in journal.sessions()]
    for event in opened:
        assert isinstance(event, SessionOpened)
        assert event.trials == drawn_again(event)
        other = "old" if event.group == "young" else "young"
        assert event.trials != drawn_again(replace(event, group=other))
    data = load_study_data(chains, rehearsals=False)
    study = StudyFolder(path=tmp_path).study()
    as_run = order_as_run(data, study)
    assert isinstance(as_run, OrderAsRun)
    assert as_run.problems == ()
    assert data.lock is not None
    assert data.lock.groups == {drawn: 1}, "one person has had both sessions"
    assert set(data.trials["group"]) == {"young", "old"}


def test_virtual_people_are_those_of_their_group(tmp_path: Path) -> None:
    place, people = grouped_in(tmp_path / "study", OPERATOR), tmp_path / "people.toml"
    people.write_text("[person]\ngain = 5\n[group.old.person]\ngain = 2\n")
    virtual = ("--ratings", "virtual", "--people", people)
    for number in range(1, 4):
        assert typed("run", place, "--participant", f"P{number:02d}", *virtual) == 0
    with open_journal(place / "study.db") as journal:
        opened = [state.opened for state in states(journal).values()]
    gains = {
        (event.group, event.virtual.gain)
        for event in opened
        if isinstance(event, SessionOpened) and event.virtual is not None
    }
    assert gains == {("old", 2.0), ("young", 5.0)}
    people.write_text("[group.odl.person]\ngain = 2\n")
    assert typed("run", place, "--participant", "P05", *virtual) == 2


DESK = """
[[question]]
name = "age"
kind = "number"
when = "desk"
sessions = "first"
minimum = 18
text = { en = "Age?", zh = "\u5e74\u9f84\uff1f" }
"""
AGES = {
    'question = "room temperature", at_most = 20': 'question = "age", at_most = 35',
    'question = "room temperature", at_least = 25': 'question = "age", at_least = 60',
}


def test_an_answer_of_the_desk_leads_to_the_group_and_is_not_asked_again(
    tmp_path: Path, terminal: io.StringIO
) -> None:
    grouped_in(tmp_path, ANSWER, *AGES.items(), ("[design]", f"{DESK}\n[design]"))
    terminal.write("17\n64\n")
    terminal.seek(0)
    said: list[str] = []
    found = with_group(request(tmp_path, "P01"), said.append)
    assert (found.options.group, found.options.noted) == ("old", {"age": "64"})
    assert said == [
        "Age?",
        "the answer to age must be a whole number, at least 18, got '17'",
        "Age?",
    ]
    run_session(tmp_path, "P01", group="old", noted=found.options.noted)
    with open_journal(tmp_path / "study.db") as journal:
        answers = [it for _, it in journal.records_of(QuestionAnswered) if it.name == "age"]
    assert [it.answer for it in answers] == [64]
    # A virtual operator answers so that the group that was drawn follows.
    for number in range(2, 5):
        options = ("--participant", f"P{number:02d}", "--ratings", "virtual")
        assert typed("run", tmp_path, *options) == 0
    with open_journal(tmp_path / "study.db") as journal:
        for state in states(journal).values():
            assert isinstance(state.opened, SessionOpened)
            age = state.questions["age", None]
            assert age <= 35 if state.opened.group == "young" else age >= 60


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (
            ("at_least = 60", "at_most = 10"),
            "group old, when: must say at_least or at_most, within",
        ),
        (('question = "age", at_least', 'question = "aeg", at_least'), "of the operator's desk"),
    ],
)
def test_a_group_to_which_no_answer_leads_is_refused(
    tmp_path: Path, changed: tuple[str, str], told: str
) -> None:
    place = grouped_in(tmp_path, ANSWER, *AGES.items(), ("[design]", f"{DESK}\n[design]"), changed)
    with pytest.raises(BadInput, match=told):
        requested(SessionOptions(folder=StudyFolder(path=place), participant="P01", device=BOARD))


DECIDED = pytest.mark.parametrize(
    ("changes", "noted", "text"),
    [
        ((), {"room temperature": "31.5"}, "temperature"),
        ((*AGES.items(), ("[design]", f"{DESK}\n[design]")), {"age": "64"}, "Age?"),
    ],
)


@DECIDED
def test_what_decides_on_the_group_is_written_when_the_session_is_opened(
    tmp_path: Path, changes: tuple[tuple[str, str], ...], noted: dict[str, str], text: str
) -> None:
    """A session that ends before its device is armed, and is resumed, asks for none of it."""
    grouped_in(tmp_path, ANSWER, *changes)
    with pytest.raises(DeviceError, match="arm failed"):
        run_session(tmp_path, "P01", group="old", noted=noted, device=FakeDevice(fails="arm"))
    operator = FakeOperator(device := FakeDevice(), answers=["", "", "70"])
    run_session(tmp_path, "P01", device=device, operator=operator)
    assert not [asked for asked in operator.asked if text in asked]
    with open_journal(tmp_path / "study.db") as journal:
        tags = [event.tag for event in journal.events("P01/1")]
        state = states(journal)["P01/1"]
    assert tags[1] in {"rig-described", "question-answered"}
    known = {name: str(answer) for (name, _), answer in state.questions.items()}
    assert noted.items() <= (known | dict(state.described)).items()
    assert typed("verify", tmp_path) == 0


def test_opening_and_what_decided_on_the_group_are_written_together_or_not_at_all(
    tmp_path: Path,
) -> None:
    grouped_in(tmp_path, ANSWER, *AGES.items(), ("[design]", f"{DESK}\n[design]"))
    with pytest.raises(ValueError, match="the answer to age must be a whole number"):
        run_session(tmp_path, "P01", group="old", noted={"age": "old"})
    assert not (tmp_path / "study.db").exists()


def test_an_answer_of_a_later_session_that_means_another_group_says_what_to_do(
    tmp_path: Path,
) -> None:
    every = DESK.replace('sessions = "first"\n', "")
    grouped_in(tmp_path, ANSWER, *AGES.items(), ("[design]", f"{every}\n[design]"))
    run_session(tmp_path, "P01", group="young", noted={"age": "35"})
    operator = FakeOperator(device := FakeDevice(), answers=["", "", "70"])
    run_session(tmp_path, "P01", number=2, device=device, operator=operator)
    said = next(text for text in operator.notices if text.startswith("noted: age 70"))
    assert "the session keeps its group, young, because its trials are planned: for old" in said
