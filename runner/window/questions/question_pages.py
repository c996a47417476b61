"""The page of each kind of question, and its targets for presses."""

from collections.abc import Iterator, Sequence
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
_MORE_LETTERS = 8
"""As many of a language's own stand beside those from a to z; more, an alphabet, replace them."""
_WIDEST_ROW = 744.0
SPACE, BACKSPACE = "space", "backspace"
"""Keys on the screen that are not named by what they type."""
_WIDE = {SPACE: 160.0, BACKSPACE: 160.0}


def question_targets(screen: Ask) -> tuple[Target, ...]:
    """Return the targets of a question: answers, a scale or keys, and the button."""
    question = screen.question
    confirm = Target(name="confirm", box=BUTTON, role="button")
    if question.kind in {"choice", "several"}:
        return (*_answers(question.values), confirm)
    if question.kind in {"scale", "analogue"}:
        return (Target(name="scale", box=SCALE_BOX, role="scale"), confirm)
    return (*_keys(screen), confirm)


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
            shown, key = _entry(screen, view.typed), "hint.typed"
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
    step, gap = (77.0, 16.0) if rows <= 3 else (220.0 / rows, 10.0)
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


def _entry(screen: Ask, typed: str) -> Page:
    """Return what is typed in its frame, and keys for those who answer by touch."""
    unit = f" {screen.question.unit}" if screen.question.unit else ""
    room = _ENTRY.width - 20
    shown = f"{typed}_{unit}"
    while text_width(shown, _ENTRY_SIZE) > room and len(shown) > 1:
        shown = shown[1:]  # the end, which is typed now, stays in view
    keys = [element for key in _keys(screen) for element in _key(key)]
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


def _keys(screen: Ask) -> Iterator[Target]:
    number = screen.question.kind == "number"
    rows = (*_DIGITS, (BACKSPACE,)) if number else _letter_rows(screen.letters)
    step, height, top = (54.0, 46.0, 50.0) if number else (34.0, 31.0, 67.5)
    for row, names in enumerate(rows):
        widest = (_WIDEST_ROW - sum(_WIDE.get(name, 0.0) for name in names)) / len(names)
        widths = [_WIDE.get(name, min(66.0, widest)) for name in names]
        x = -sum(widths) / 2
        for name, width in zip(names, widths, strict=True):
            box = Box(x=x + width / 2, y=top - row * step, width=width - 4, height=height)
            yield Target(name=name, box=box)
            x += width


def _letter_rows(letters: str) -> Sequence[Sequence[str]]:
    """Return the keys of a language with `letters` of its own."""
    if len(letters) <= _MORE_LETTERS:
        return (*_LETTERS, (*letters, SPACE, BACKSPACE))
    third = ceil(len(letters) / 3)
    own = [letters[at : at + third] for at in range(0, len(letters), third)]
    return (_LETTERS[0], *own, ("'", ",", ".", "-", SPACE, BACKSPACE))
