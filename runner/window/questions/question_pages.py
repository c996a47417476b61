"""The page of each kind of question, and its targets for presses."""

from collections.abc import Iterator
from dataclasses import replace
from math import ceil

from protocol.study.participant_texts import Wording, label_text, question_text
from protocol.study.study_question import BETWEEN, StudyQuestion
from runner.screens import Ask
from runner.window.elements import FAINT, INK, WHITE, Box, Outline, Page, Target, Text
from runner.window.questions.page_layout import (
    ANSWER_SIZE,
    BUTTON,
    HINT,
    TITLE,
    TITLE_SIZE,
    PageState,
    answer_box,
    button,
    hint,
)
from runner.window.questions.rating_scale import SCALE_BOX, scale
from runner.window.text_layout import text_width

_FEW = 4
"""As many answers stand one below another, more in two columns."""
_COLUMN_X = 184.0
_SMALL_ANSWER_SIZE = 20.0
_ENTRY = Box(x=0, y=108, width=600, height=46)
_ENTRY_SIZE = 24.0
_KEY_SIZE = 22.0
_DIGITS = ("123456", "7890-.")
_LETTERS = ("1234567890", "qwertyuiop", "asdfghjkl'", "zxcvbnm,.-")
SPACE, BACKSPACE = "space", "backspace"
"""Keys on the screen that are not named by what they type."""


def question_targets(question: StudyQuestion) -> tuple[Target, ...]:
    """Return the targets of a question: answers, a scale or keys, and the button."""
    confirm = Target(name="confirm", box=BUTTON, role="button")
    if question.kind in {"choice", "several"}:
        return (*_answers(question.values), confirm)
    if question.kind in {"scale", "analogue"}:
        return (Target(name="scale", box=SCALE_BOX, role="scale"), confirm)
    return (*_keys(question), confirm)


def question_page(screen: Ask, view: PageState, wording: Wording) -> Page:
    """Return the page of a question; nothing is marked until it is chosen."""
    question, texts, chosen = screen.question, wording.texts, view.chosen
    match question.kind:
        case "choice" | "several":
            shown, key = _answer_boxes(question, chosen, wording), "hint.change"
        case "scale" | "analogue":
            at = None if chosen is None else float(chosen)
            shown, key = scale(question, screen.bands, wording, at), "hint.score"
        case _:
            shown, key = _entry(question, view.typed), "hint.typed"
    if question.kind in {"several", "analogue"}:
        key = f"hint.{question.kind}"
    elif len(question.values) == 2:
        key = "hint.change.two"
    skips = chosen is None and not question.required
    label = "button.skip" if skips else "button.confirm"
    return (
        Text(text=question_text(question, wording), box=TITLE, size=TITLE_SIZE),
        *shown,
        hint(texts[key].format(last=len(question.labels)), HINT),
        *button(label, view, texts, usable=chosen is not None or skips),
    )


def chosen_in_advance(question: StudyQuestion) -> Iterator[str]:
    """Yield answers whose pages are worth drawing in advance."""
    if question.kind == "choice":
        yield from question.values
    if question.kind == "scale":
        yield from (str(question.place(at)) for at in range(min(question.places, 20) + 1))


def _answers(values: tuple[str, ...]) -> tuple[Target, ...]:
    """Return the targets of the answers from top to bottom, in two columns if they are many."""
    columns = 1 if len(values) <= _FEW else 2
    rows = ceil(len(values) / columns)
    step, gap = (78.0, 16.0) if rows <= 3 else (220.0 / rows, 10.0)
    first = Box(x=0, y=131.0 - (step - gap) / 2, width=520, height=step - gap)
    if columns == 2:
        first = replace(first, x=-_COLUMN_X, width=2 * _COLUMN_X - 18)
    return tuple(
        Target(
            name=value,
            box=replace(
                first,
                x=first.x + 2 * _COLUMN_X * (number // rows),
                y=first.y - step * (number % rows),
            ),
        )
        for number, value in enumerate(values)
    )


def _answer_boxes(question: StudyQuestion, chosen: str | None, wording: Wording) -> Page:
    marked = (chosen or "").split(BETWEEN) if question.kind == "several" else [chosen]
    size = ANSWER_SIZE if len(question.labels) <= _FEW else _SMALL_ANSWER_SIZE
    answers = zip(_answers(question.values), question.labels, strict=True)
    return tuple(
        element
        for number, (answer, label) in enumerate(answers, start=1)
        for element in answer_box(
            str(number),
            label_text(label, wording),
            answer.box,
            chosen=answer.name in marked,
            size=size,
        )
    )


def _entry(question: StudyQuestion, typed: str) -> Page:
    """Return what is typed in its frame, and keys for those who answer by touch."""
    unit = f" {question.unit}" if question.unit else ""
    room = _ENTRY.width - 20
    shown = f"{typed or '…'}{unit}"
    while text_width(shown, _ENTRY_SIZE) > room and len(shown) > 1:
        shown = shown[1:]  # the end, which is typed now, stays in view
    keys = [element for key in _keys(question) for element in _key(key)]
    return (
        Outline(points=_ENTRY.corners, fill=WHITE, edge=INK),
        Text(text=shown, box=_ENTRY, size=_ENTRY_SIZE),
        *keys,
    )


def _key(key: Target) -> Page:
    names = {SPACE: "", BACKSPACE: "←"}
    text = names.get(key.name, key.name)
    frame = Outline(points=key.box.corners, fill=WHITE, edge=FAINT, width=1)
    return (frame, Text(text=text, box=key.box, size=_KEY_SIZE)) if text else (frame,)


def _keys(question: StudyQuestion) -> Iterator[Target]:
    rows, step, height = (_DIGITS, 54.0, 46.0) if question.kind == "number" else (_LETTERS, 34, 31)
    top = 66.0 if question.kind == "text" else 50.0
    last = (SPACE, BACKSPACE) if question.kind == "text" else (BACKSPACE,)
    for row, names in enumerate((*map(tuple, rows), last)):
        width = 66.0 if row < len(rows) else 160.0
        for column, name in enumerate(names):
            x = (column - (len(names) - 1) / 2) * width
            box = Box(x=x, y=top - row * step, width=width - 4, height=height)
            yield Target(name=name, box=box)
