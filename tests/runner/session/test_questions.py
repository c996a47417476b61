"""A study's own questions in a session: asked when they are due, and never twice."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from analysis.export.trial_table import frames
from analysis.loading.sessions import load_sessions
from protocol.journal.events import Answered, QuestionAnswered, SessionOpened
from protocol.journal.state import SessionState
from protocol.plan.plan import plan
from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import open_journal
from runner.journal.store import Journal, SessionLog
from runner.journal.verification import readable_chains
from runner.screens import Ask, Correction, Instruction, Response, Wanted
from runner.session.loop import run
from runner.session.session import Session, answer_order
from runner.session.trial import due
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.fakes import FakeDevice, FakeOperator, FakeParticipant, context

TEXT = template("paper").replace("[design]", "[design]\nrepeats = 2") + OWN_QUESTIONS
ANSWERS = {
    "pleasantness": "5",
    "confidence": "61.8",
    "sensations": "sticking;vibration",
    "hand": "left",
    "age": "31",
    "remarks": "",
}
BEFORE, BLOCKS, AFTER = ["hand", "age"], ["sensations"], ["remarks"]


def carried_out(journal: Journal, participant: FakeParticipant, text: str = TEXT) -> SessionLog:
    session = context(journal, FakeDevice(), participant, text)
    run(session)
    return session.log


def person(**how: str) -> FakeParticipant:
    return FakeParticipant(answers=ANSWERS, **how)  # type: ignore[arg-type]


def recorded(journal: Journal) -> list[tuple[str, int | None]]:
    records = [event.record for event in journal.events("P01/1")]
    return [(e.name, e.block) for e in records if isinstance(e, QuestionAnswered)]


def test_every_question_is_asked_when_it_is_due(tmp_path: Path) -> None:
    participant = person()
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, participant)
        records = [event.record for event in journal.events("P01/1")]
        asked_apart = recorded(journal)
    assert asked_apart == [
        ("hand", None),
        ("age", None),
        ("sensations", 1),
        ("sensations", 2),
        ("remarks", None),
    ]
    answered = [event for event in records if isinstance(event, Answered)]
    for event in answered:
        names = [each.name for each in event.questions]
        wanted = ["pleasantness"] if event.condition else []
        assert names == wanted + ["confidence"] * (event.condition in {"voltage", "pressure"})
    voltage = next(event for event in answered if event.condition == "voltage")
    assert [each.answer for each in voltage.questions] == [5, 61.8]
    apart = {e.name: e.answer for e in records if isinstance(e, QuestionAnswered)}
    assert apart["sensations"] == ["vibration", "sticking"]
    assert (apart["age"], apart["remarks"]) == (31, None)


@pytest.mark.parametrize("moment", ["hand", "age", "sensations", "remarks", "pleasantness"])
def test_a_resumed_session_asks_nothing_twice(tmp_path: Path, moment: str) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(KeyboardInterrupt):
            carried_out(journal, person(stops_at=f"name='{moment}'"))
        before = recorded(journal)
        again = person()
        log = carried_out(journal, again)
        assert len(recorded(journal)) == len(set(recorded(journal))) == 5
    shown = [screen.question.name for screen in again.shown if isinstance(screen, Ask)]
    assert not {name for name, block in before if block is None} & set(shown)
    assert log.state.name == "completed"


def test_a_session_that_stopped_before_the_questions_of_a_block_asks_them(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        with pytest.raises(KeyboardInterrupt):
            carried_out(journal, person(stops_at="name='sensations'"))
        again = person()
        carried_out(journal, again)
    shown = [screen.question.name for screen in again.shown if isinstance(screen, Ask)]
    assert shown[0] == "sensations"


def test_an_answer_that_the_question_does_not_allow_ends_the_session(tmp_path: Path) -> None:
    wrong = FakeParticipant(answers={**ANSWERS, "age": "12"})
    with (
        open_journal(tmp_path / "study.db") as journal,
        pytest.raises(ValueError, match="the answer to age must be a whole number, at least 18"),
    ):
        carried_out(journal, wrong)


def test_a_reversed_order_is_shown_and_the_answers_mean_the_same(tmp_path: Path) -> None:
    participant = person()
    with open_journal(tmp_path / "study.db") as journal:
        session = context(journal, FakeDevice(), participant, TEXT)
        session.session = replace(session.session, answer_order="reversed")
        run(session)
        records = [event.record for event in journal.events("P01/1")]
    shown = {s.question.name: s.question for s in participant.shown if isinstance(s, Ask)}
    assert shown["roughness"].values == ("same", "rougher", "smoother")
    assert shown["hand"].values == ("both", "right", "left")
    assert [label.at for label in shown["pleasantness"].labels] == [1, 4, 7]
    apart = {e.name: e.answer for e in records if isinstance(e, QuestionAnswered)}
    assert apart["sensations"] == ["vibration", "sticking"]


def test_every_other_slot_has_the_reversed_order_and_a_session_keeps_its_own() -> None:
    fixed = parsed_study(TEXT)
    rules = fixed.session.model_copy(update={"answer_order": "counterbalanced"})
    study = fixed.model_copy(update={"session": rules})
    assert [answer_order(study, slot, None) for slot in range(3)] == [
        "forward",
        "reversed",
        "forward",
    ]
    assert answer_order(fixed, 1, None) == "forward"
    session = Session(
        participant="P02",
        number=1,
        kind="participant",
        study=study,
        study_text=TEXT,
        plan=plan(study, slot=1),
        answer_order="reversed",
    )
    begun = SessionState(opened=session.recorded_as(SessionOpened))
    assert answer_order(fixed, 1, begun) == "reversed"


def test_participants_read_once_that_practice_begins(tmp_path: Path) -> None:
    participant = person()
    text = TEXT.replace("[design]", "[design]\npractice_trials = 2", 1)
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, participant, text)
    said = [screen for screen in participant.shown if screen == Instruction(text="practice")]
    assert len(said) == 1


DEPENDENT = (
    TEXT.replace('score_when = "agrees"', 'score_when = "noticed"')
    .replace(
        'name = "confidence"',
        'name = "confidence"\nasked_if = { question = "score", at_least = 5 }',
    )
    .replace(
        'name = "remarks"', 'name = "remarks"\nasked_if = { question = "hand", is = ["left"] }'
    )
)


@pytest.mark.parametrize(("score", "hand"), [("5", "left"), ("4", "right")])
def test_a_question_that_depends_on_an_answer_is_asked_only_after_it(
    tmp_path: Path, score: str, hand: str
) -> None:
    participant = FakeParticipant(answers={**ANSWERS, "hand": hand, "score": score})
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, participant, DEPENDENT)
        answered = [e.record for e in journal.events("P01/1") if isinstance(e.record, Answered)]
        apart = recorded(journal)
    for event in (each for each in answered if each.condition in {"voltage", "pressure"}):
        names = [each.name for each in event.questions]
        assert ("confidence" in names) == (event.score is not None and event.score >= 5)
    assert any(event.score == int(score) for event in answered)
    assert (("remarks", None) in apart) == (hand == "left")


def test_a_score_is_asked_where_anything_was_noticed(tmp_path: Path) -> None:
    given = {"roughness": "rougher", "strength": "same", "places": "not swapped"}
    participant = FakeParticipant(answers={**ANSWERS, **given})
    with open_journal(tmp_path / "study.db") as journal:
        carried_out(journal, participant, DEPENDENT)
        answered = [e.record for e in journal.events("P01/1") if isinstance(e.record, Answered)]
    scored = {event.change: event.score is not None for event in answered if event.condition}
    assert scored == {"rougher": True, "same": False, "not swapped": False}


def test_an_answer_of_the_first_session_counts_in_the_second(tmp_path: Path) -> None:
    with open_journal(tmp_path / "study.db") as journal:
        session = context(journal, FakeDevice(), person(), DEPENDENT)
        session.session = replace(session.session, number=2, told={"hand": "left"})
        assert ("remarks", None) in {
            (question.name, block)
            for _, block, question in due(
                session.session,
                SessionState(answers=dict.fromkeys(range(99), ""), questions={}),
            )
        }


def yes_or_no(name: str, *keys: str) -> str:
    labels = '{ value = "yes", en = "yes", zh = "是" }, { value = "no", en = "no", zh = "否" }'
    text = 'text = { en = "And?", zh = "呢？" }'
    question = ("[[question]]", f'name = "{name}"', 'kind = "choice"', text, *keys)
    return "\n".join(["", *question, f"labels = [{labels}]", ""])


THREE_BLOCKS = template("paper").replace("[design]", "[design]\nrepeats = 3")
PAIN = yes_or_no("pain", 'when = "block"') + yes_or_no(
    "pain_where", 'when = "block"', 'asked_if = { question = "pain", is = ["yes"] }'
)


@dataclass
class InTurn(FakeParticipant):
    """Answers each question of `turns` differently each time that it is asked."""

    turns: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def poll(self) -> Response | None:
        asked = [page.question.name for page in self.shown if isinstance(page, Ask)]
        if isinstance(self.shown[-1], Ask) and asked[-1] in self.turns:
            answer = self.turns[asked[-1]][asked.count(asked[-1]) - 1]
            return Response(answer=answer, reaction_time_s=1.0)
        return super().poll()


@pytest.mark.parametrize("stops_at", ["", "name='pain_where'"])
def test_a_question_after_a_block_follows_from_the_answer_after_that_block(
    tmp_path: Path, stops_at: str
) -> None:
    """So it does in the journal, in a session that was interrupted, and in the exported table."""
    turns = {"pain": ("yes", "no", "yes"), "pain_where": ("no", "yes")}
    with open_journal(tmp_path / "study.db") as journal:
        if stops_at:
            with pytest.raises(KeyboardInterrupt):
                carried_out(journal, InTurn(turns=turns, stops_at=stops_at), THREE_BLOCKS + PAIN)
            turns = {"pain": ("no", "yes"), "pain_where": ("no", "yes")}
        carried_out(journal, InTurn(turns=turns), THREE_BLOCKS + PAIN)
        records = [event.record for event in journal.events("P01/1")]
        tables = frames(
            parsed_study(THREE_BLOCKS + PAIN),
            load_sessions(readable_chains(journal, [])),
            rehearsals=False,
        )
    given = [(e.name, e.block, e.answer) for e in records if isinstance(e, QuestionAnswered)]
    assert given == [
        ("pain", 1, "yes"), ("pain_where", 1, "no"), ("pain", 2, "no"), ("pain", 3, "yes"),
        ("pain_where", 3, "yes"),
    ]  # fmt: skip
    exported = tables.trials[["block", "pain_where"]].dropna().drop_duplicates()
    assert [*exported.itertuples(index=False, name=None)] == [(1, "no"), (3, "yes")]


def test_a_correction_leads_to_no_question_about_a_block_that_is_long_over(tmp_path: Path) -> None:
    """What the operator corrects in the third block counts from then on."""
    text = THREE_BLOCKS + yes_or_no("glasses", 'when = "desk"')
    text += yes_or_no("eyes", 'when = "block"', 'asked_if = { question = "glasses", is = ["yes"] }')
    text += PAIN
    device = FakeDevice()

    class Late(FakeOperator):
        def order(self) -> Wanted | None:
            over = ("pain", 2) in made.log.state.questions
            return super().order() if over else None

    correction = Correction(name="glasses", answer="yes", note="seen")
    operator = Late(device, [("touching", correction)], answers=["no"])
    turns = {"pain": ("no",) * 3}
    with open_journal(tmp_path / "study.db") as journal:
        made = context(journal, device, InTurn(turns=turns), text, operator)
        run(made)
        asked = recorded(journal)
    assert [block for name, block in asked if name == "eyes"] == [3]


def test_nothing_is_asked_about_blocks_that_a_track_has_left_out() -> None:
    study = parsed_study(THREE_BLOCKS + PAIN)
    made = plan(study, slot=0)
    session = Session(
        participant="P01",
        number=1,
        kind="participant",
        study=study,
        study_text=THREE_BLOCKS + PAIN,
        plan=made,
    )
    first = {trial.index for trial in made.trials if trial.block <= 1}
    rest = {trial.index for trial in made.trials} - first
    state = SessionState(answers=dict.fromkeys(first, ""), begun=first, not_needed=rest)
    assert [(question.name, block) for _, block, question in due(session, state)] == [("pain", 1)]
