"""Choosing and confirming: every key and press, and no answer without confirmation."""

import json
import random
from dataclasses import replace
from itertools import combinations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from device.people.person import Person
from protocol.study.participant_texts import study_wording
from protocol.study.rules import Rating
from protocol.study.study_question import ANSWERS, Question, StudyQuestion, score_question
from protocol.study_file.loading import parsed_study, template
from runner.people.virtual_participant import VirtualParticipant
from runner.screens import Ask, Instruction, Notice, Pacing, Screen, Welcome, ask_change, ask_score
from runner.window.elements import Dragged, Input, Key, Pressed, Released, Text, Typed
from runner.window.pages import page, targets
from runner.window.preflight import fits
from runner.window.question_pages import PageState, inputs_for, score_x
from runner.window.response import EARLY_S, PendingResponse
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.fakes import FakeClock

RATING = Rating()
CHANGE, SCORE = ask_change("roughness"), ask_score(RATING)
KEYS = [*"0123456789", "left", "right", "up", "down", "enter", "backspace", "escape"]
POINTS = st.tuples(st.floats(-400, 400), st.floats(-300, 300))
INPUTS: st.SearchStrategy[Input] = st.one_of(
    st.sampled_from(KEYS).map(lambda name: Key(name=name)),
    POINTS.map(lambda point: Pressed(x=point[0], y=point[1])),
    POINTS.map(lambda point: Dragged(x=point[0], y=point[1])),
    st.just(Released()),
)


def after(screen: Screen, *given_inputs: Input | str) -> PendingResponse:
    """Return the response after inputs a second apart; a string is a sequence of keys."""
    pending = PendingResponse(screen)
    inputs = [
        single
        for entry in given_inputs
        for single in ([Key(name=n) for n in entry.split()] if isinstance(entry, str) else [entry])
    ]
    for number, single in enumerate(inputs, start=1):
        pending.take(single, float(number))
    return pending


def press(screen: Screen, name: str) -> Pressed:
    """A press in the middle of a target."""
    box = next(target.box for target in targets(screen) if target.name == name)
    return Pressed(x=box.x, y=box.y)


def press_score(score: float) -> Pressed:
    return Pressed(x=score_x(score, score_question(RATING)), y=50)


@pytest.mark.parametrize(
    ("keys", "chosen"),
    [
        ("7", "7"),
        ("1 0", "10"),
        ("1 5", "5"),
        ("0 5", "5"),
        ("1 0 0", "0"),
        ("1 0 backspace", "1"),
        ("7 backspace", None),
        ("right", "0"),
        ("left", "10"),
        ("up", "0"),
        ("5 right", "6"),
        ("5 down left", "3"),
        ("1 0 right", "10"),
        ("0 left", "0"),
        ("1 right 0", "0"),
        ("enter", None),
    ],
)
def test_a_score_by_keys(keys: str, chosen: str | None) -> None:
    assert after(SCORE, keys).choice.chosen == chosen
    assert after(SCORE, keys).answer is None
    assert after(SCORE, f"{keys} enter").answer == chosen


@pytest.mark.parametrize(
    ("ends", "keys", "chosen"),
    [
        ((0, 100), "1 0 0", "100"),
        ((0, 100), "1 0 1", "1"),
        ((0, 100), "5 5", "55"),
        ((0, 100), "up", "0"),
        ((0, 100), "down down", "99"),
        ((1, 7), "0", None),
        ((1, 7), "8", None),
        ((1, 7), "3 9", "3"),
        ((1, 7), "3 9 up", "4"),
        ((1, 7), "0 3", "3"),
        ((5, 12), "1", None),
        ((5, 12), "1 2", "12"),
        ((5, 12), "1 2 backspace", None),
        ((5, 12), "1 3", None),
        ((5, 12), "1 left", "12"),
    ],
)
def test_a_score_by_keys_lies_on_the_scale(
    ends: tuple[int, int], keys: str, chosen: str | None
) -> None:
    screen = ask_score(Rating(minimum=ends[0], maximum=ends[1]))
    assert after(screen, keys).choice.chosen == chosen
    assert after(screen, keys, "enter").answer == chosen


@pytest.mark.parametrize(
    ("keys", "chosen"),
    [
        ("1", "smoother"),
        ("3", "same"),
        ("4", None),
        ("0", None),
        ("2 9", "rougher"),
        ("down", "smoother"),
        ("up", "same"),
        ("down down", "rougher"),
        ("1 up", "smoother"),
        ("2 backspace", None),
    ],
)
def test_a_change_by_keys(keys: str, chosen: str | None) -> None:
    assert after(CHANGE, keys).choice.chosen == chosen
    assert after(CHANGE, f"{keys} enter").answer == chosen


@pytest.mark.parametrize("question", ANSWERS)
def test_a_change_by_the_pointer(question: Question) -> None:
    screen = ask_change(question)
    for answer in ANSWERS[question]:
        chosen = after(screen, press(screen, answer), Released(), press(screen, "confirm"))
        assert chosen.answer == answer


@pytest.mark.parametrize("score", range(11))
def test_a_score_by_the_pointer_is_the_nearest_one(score: int) -> None:
    for beside in (-0.45, 0.0, 0.45):
        assert after(SCORE, press_score(score + beside)).choice.chosen == str(score)


def test_the_mark_follows_the_pointer_and_its_path_is_recorded() -> None:
    drag = [Dragged(x=score_x(place, score_question(RATING)), y=-200) for place in (2.4, 3.2, 4.0)]
    pending = after(SCORE, press_score(2), *drag, Released(), drag[0], "enter")
    assert pending.answer == "4"
    trace = pending.trace()
    assert trace["start"] == {"t_s": 1.0, "value": "2", "by": "pointer"}
    assert [step["at"] for step in trace["path"]] == [2.0, 2.4, 3.2, 4.0]
    assert [change["value"] for change in trace["changes"]] == ["2", "3", "4"]
    assert trace["confirmed_s"] == 7.0


def test_a_drag_that_began_elsewhere_does_not_move_the_mark() -> None:
    assert after(SCORE, Pressed(x=0, y=250), Dragged(x=0, y=50)).choice.chosen is None


@pytest.mark.parametrize("screen", [Welcome(), Instruction(text="remember"), Notice(text="thanks")])
def test_a_page_with_a_button_is_answered_by_the_button_or_enter(screen: Screen) -> None:
    assert after(screen, "enter").answer == "ready"
    assert after(screen, press(screen, "ready")).answer == "ready"
    assert after(screen, Pressed(x=0, y=0), "5 left").answer is None


def test_a_press_shorter_than_any_reaction_time_is_only_counted() -> None:
    pending = PendingResponse(Instruction(text="remember"))
    pending.take(Key(name="enter"), EARLY_S / 2)
    assert (pending.answer, pending.early) == (None, 1)


@pytest.mark.parametrize("screen", [CHANGE, SCORE, Instruction(text="remember"), Welcome()])
def test_enter_ten_times_a_second_confirms_one_mark_of_a_page_that_could_be_read(
    screen: Screen,
) -> None:
    pending = PendingResponse(screen, readable_s=1.0)
    pressed = [number / 10 for number in range(1, 40)]
    for t_s in pressed:
        if t_s == 2.0 and isinstance(screen, Ask):
            assert pending.answer is None, "nothing is marked"
            pending.take(Key(name="1"), 1.95)
        pending.take(Key(name="enter"), t_s)
    has_mark = isinstance(screen, Ask)
    assert pending.confirmed_s == (2.0 if has_mark else 1.0)
    assert pending.reaction_time_s == (1.95 if has_mark else 1.0)
    assert len(pending.changes) == has_mark


@pytest.mark.parametrize("screen", [CHANGE, SCORE, Instruction(text="remember"), Welcome()])
def test_a_held_enter_confirms_nothing(screen: Screen) -> None:
    pending = PendingResponse(screen, readable_s=1.0)
    pending.take(Key(name="1"), 0.5)
    pending.take(Key(name="enter"), 0.9)  # too early, and still held when the button works
    for repeat in range(100):
        pending.take(Key(name="enter", repeated=True), 1.0 + repeat / 10)
    assert (pending.answer, pending.early) == (None, 1)
    pending.take(Key(name="enter"), 12.0)
    assert pending.confirmed_s == 12.0


def test_a_key_held_since_another_page_chooses_nothing_and_is_not_early() -> None:
    pending = PendingResponse(SCORE)
    for t_s in (0.1, 0.5, 1.0):
        pending.take(Key(name="right", repeated=True), t_s)
    assert (pending.choice.chosen, pending.early) == (None, 0)
    # One that went down on this page goes on while it is held.
    pending.take(Key(name="right"), 2.0)
    pending.take(Key(name="right", repeated=True), 2.5)
    assert pending.choice.chosen == "1"


def test_an_answer_may_be_marked_before_it_can_be_confirmed() -> None:
    pending = PendingResponse(CHANGE, readable_s=1.0)
    for t_s, name in ((0.2, "2"), (0.6, "enter"), (1.2, "enter")):
        pending.take(Key(name=name), t_s)
    assert (pending.answer, pending.reaction_time_s, pending.confirmed_s) == ("rougher", 0.2, 1.2)
    assert pending.trace()["early_presses"] == 1


@given(inputs=st.lists(INPUTS, max_size=60))
def test_only_a_confirmed_choice_of_the_scale_is_an_answer(
    inputs: list[Input],
) -> None:
    pending = after(SCORE, *inputs)
    assert pending.choice.chosen in {None, *(str(score) for score in range(11))}
    if pending.answer is not None:
        assert pending.answer == pending.choice.chosen == pending.changes[-1]["value"]
        assert all(0 <= step["at"] <= 10 for step in pending.path if step["at"] is not None)


@given(inputs=st.lists(INPUTS, max_size=60))
def test_no_input_ends_a_notice_or_a_touch(inputs: list[Input]) -> None:
    pacing = Pacing(start_m=0.01, end_m=0.08, duration_s=1, force_n=0.5, direction="right")
    for screen in (Notice(text="touch.end"), Notice(text="pause"), pacing):
        assert after(screen, *inputs).answer is None


def test_a_call_for_the_operator_chooses_nothing() -> None:
    for screen in (CHANGE, SCORE):
        assert after(screen, press(screen, "call"), "enter").answer is None


def test_the_first_arrow_starts_at_an_end_of_the_scale() -> None:
    keys = random.Random(1).choices(["left", "right"], k=50)
    assert {after(SCORE, key).choice.chosen for key in keys} == {"0", "10"}


def test_the_first_arrow_marks_an_analogue_scale_at_a_place_of_the_pages_own() -> None:
    screen = Ask(question=StudyQuestion(name="line", kind="analogue"))
    for start, marked in ((0.0, "0"), (0.2345, "23.4"), (1.0, "100")):
        for arrow in ("left", "right", "up", "down"):
            pending = PendingResponse(screen, start=start)
            pending.take(Key(name=arrow), 1.0)
            assert pending.trace()["start"] == {"t_s": 1.0, "value": marked, "by": "key"}
    moved = PendingResponse(screen, start=0.5)
    for second, key in enumerate(("right", "right", "up", "left"), start=1):
        moved.take(Key(name=key), float(second))
    assert moved.choice.chosen == "60"


KINDS = [
    *parsed_study(template("paper") + OWN_QUESTIONS).question,
    StudyQuestion(name="turn", kind="scale", minimum=-1.5, maximum=1.0, step=0.25),
    StudyQuestion(name="fine", kind="scale", minimum=0.00001, maximum=0.00002, step=0.000001),
    StudyQuestion(name="high", kind="scale", minimum=-120.0, maximum=-100.0),
    StudyQuestion(name="line", kind="analogue", required=False),
    StudyQuestion(name="shift", kind="number", minimum=-5.0, maximum=5.0, decimals=3),
    StudyQuestion(name="words", kind="text", max_length=6),
]


class Numb:
    """A finger of somebody who only answers."""

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        raise AssertionError("nothing is touched")

    def lift(self) -> None: ...


@pytest.mark.parametrize("question", KINDS, ids=lambda question: question.name)
def test_what_a_virtual_person_presses_gives_its_answer(question: StudyQuestion) -> None:
    person = VirtualParticipant(Numb(), FakeClock(), Person(), name="1/P01/1")
    screen = Ask(question=question)
    for _ in range(40):
        person.show(screen)
        meant = person.poll()
        assert meant
        pending = after(screen, *inputs_for(question, meant.answer), "enter")
        assert pending.answer is not None
        assert question.answer(pending.answer) == question.answer(meant.answer)


@pytest.mark.parametrize(
    "letters",
    [
        *("", "äöüß", "àâçéèêëîïôùœ", "αβγδεζηθικλμνξοπρσςτυφχψω"),
        "абвгдеёжзийклмнопрстуфхцчшщъыьэюя",
    ],
)
def test_the_keys_on_the_screen_type_every_letter_of_the_language(letters: str) -> None:
    screen = Ask(question=StudyQuestion(name="words", kind="text", max_length=200), letters=letters)
    keys = [target for target in targets(screen) if target.role == "answer"]
    named = [key.name for key in keys if len(key.name) == 1]
    assert after(screen, *(press(screen, name) for name in named)).choice.typed == "".join(named)
    assert set(letters) <= set(named)
    assert all(abs(x) <= 400 for key in keys for x, _ in key.box.corners)
    for one, other in combinations([target.box for target in targets(screen)], 2):
        assert (
            abs(one.x - other.x) >= (one.width + other.width) / 2
            or abs(one.y - other.y) >= (one.height + other.height) / 2
        )


def test_a_key_on_the_screen_makes_the_next_letter_a_capital() -> None:
    screen = Ask(question=StudyQuestion(name="words", kind="text", max_length=200), letters="éß")
    words = study_wording(parsed_study(template("paper")), "en")

    def keys(*names: str) -> tuple[str, list[str]]:
        choice = after(screen, *(press(screen, name) for name in names)).choice
        question = StudyQuestion(name="words", kind="text", max_length=200, text={"en": "What?"})
        shown = page(replace(screen, question=question), PageState(**vars(choice)), words)
        return choice.typed, [e.text for e in shown if isinstance(e, Text) and len(e.text) == 1]

    typed, shown = keys("Aa", "é")
    assert typed == "É"
    assert "e" in shown, "the letters after it are small again"
    typed, shown = keys("Aa", "ß", "1", "Aa")
    assert typed == "ß1", "which is no single letter as a capital"
    assert {"E", "É", "1"} <= set(shown)
    assert not {"e", "é"} & set(shown)
    assert keys("Aa", "Aa", "a") == keys("a")


def test_a_language_without_capitals_has_no_key_for_them() -> None:
    question = StudyQuestion(name="words", kind="text", max_length=200)
    for letters, has_key in (("אבגדהוזחטיכלמנסעפצקרשת", False), ("αβγδεζηθικ", True)):
        names = [target.name for target in targets(Ask(question=question, letters=letters))]
        assert ("Aa" in names) is has_key


def test_a_thousand_hostile_texts_are_answers_as_typed_and_fit_their_frame() -> None:
    """Typed, pasted or tapped; a text that is too long is cut, one of spaces is no answer."""
    rng, words = random.Random(1), study_wording(parsed_study(template("paper")), "en")
    question = StudyQuestion(name="words", kind="text", max_length=200, text={"en": "What?"})
    screen = Ask(question=question)
    tapped = [target.name for target in targets(screen) if target.role == "answer"]
    for _ in range(1000):
        given = "".join(rng.choices(HOSTILE, k=rng.randrange(1, 30)))
        pending = PendingResponse(screen)
        for second, sign in enumerate(given if rng.random() < 0.5 else [given], start=1):
            pending.take(Typed(text=sign), float(second))
        pending.take(press(screen, rng.choice(tapped)), 300.0)
        pending.take(Key(name="enter"), 301.0)
        typed = pending.choice.typed
        assert len(typed) <= 200
        assert typed.startswith(given[:198]) or typed == given[:200][:-1]
        assert pending.answer == (typed.strip() or None)
        if pending.answer is not None:
            assert question.answer(pending.answer) == pending.answer
            assert json.loads(json.dumps(pending.trace()))["changes"][-1]["value"] == pending.answer
        shown = page(screen, PageState(chosen=pending.choice.chosen, typed=typed), words)
        assert all(fits(element) for element in shown if isinstance(element, Text))


HOSTILE = (
    *(chr(code) for code in range(32, 127)),
    *("=1+1", "@SUM(A1)", "<script>", "{x}", "%s", "\\", "'; DROP", ";", "\u202e", "\u200b"),
    *("é", "e\u0301" * 9, "ﷺ", "漢字", "🙂", "👩\u200d🔬", "𝔘", "\ufffd", "W" * 40, " " * 40),
)
"""All that a window takes for text, what other programs obey, and what is wide or has no width."""
