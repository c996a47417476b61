"""What a key or a press makes of a choice, for each kind of question, and what makes an answer."""

from dataclasses import dataclass
from decimal import Decimal

from protocol.study.study_question import BETWEEN, StudyQuestion
from runner.window.elements import Input, Key, Pressed, Released, Typed
from runner.window.questions.question_pages import BACKSPACE, SPACE
from runner.window.questions.rating_scale import SCALE_BOX, nearest, score_x

_STEPS = {"left": -1, "right": 1, "down": -1, "up": 1}
_ANALOGUE_STEPS = {"left": -10, "right": 10, "down": -100, "up": 100}
"""In tenths, too small to be made by hand."""


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What is chosen, as an answer; and what is typed, which may not be an answer yet."""

    chosen: str | None = None
    typed: str = ""


def by_key(question: StudyQuestion, now: Choice, key: Key | Typed, start: float = 0.5) -> Choice:
    """Return the choice after a key; a text is read as the system composes it, else as keys.

    The first arrow marks a visual analogue scale at `start`, as a share of its length.
    """
    if isinstance(key, Typed):
        return _longer(question, now, key.text) if question.kind == "text" else now
    if key.name == BACKSPACE:
        return _typed(question, now.typed[:-1])
    match question.kind:
        case "choice":
            now = Choice(chosen=_label_by_key(question, now.chosen, key.name))
        case "several":
            label = _label_by_key(question, None, key.name if key.name.isdigit() else "")
            now = now if label is None else by_press(question, now, label)
        case "scale" | "analogue":
            now = _place_by_key(question, now, key.name, start)
        case "number" if _is_sign(key.name):
            now = _longer(question, now, key.name)
    return now


def by_press(question: StudyQuestion, now: Choice, target: str) -> Choice:
    """Return the choice after a press on an answer, or on a key on the screen."""
    match question.kind:
        case "choice":
            return Choice(chosen=target)
        case "several":
            return Choice(chosen=_turned(question, now.chosen, target))
    if target == BACKSPACE:
        return _typed(question, now.typed[:-1])
    return _longer(question, now, " " if target == SPACE else target)


def on_scale(question: StudyQuestion, x: float) -> Choice:
    """Return the choice of the place nearest to `x`."""
    return Choice(chosen=str(nearest(x, question)))


def inputs_for(question: StudyQuestion, answer: str) -> tuple[Input, ...]:
    """Return what a person presses to choose `answer`; nothing to skip the question.

    These are keys, but on a line, along which the arrows take wider steps, a press at the place.
    """
    if not answer:
        return ()
    match question.kind:
        case "choice" | "several":
            numbers = [question.values.index(value) + 1 for value in answer.split(BETWEEN)]
            return tuple(Key(name=str(number)) for number in numbers)
        case "text":
            return tuple(Typed(text=sign) for sign in answer)
        case "analogue":
            at = Pressed(x=score_x(float(answer), question), y=SCALE_BOX.y)
            return (at, Released())
    return tuple(Key(name=sign) for sign in f"{Decimal(answer):f}")


def _longer(question: StudyQuestion, now: Choice, text: str) -> Choice:
    """Return the choice after `text` is typed; what is too long is left out."""
    return _typed(question, (now.typed + text)[: question.longest])


def _typed(question: StudyQuestion, text: str) -> Choice:
    """Return the choice of what is typed if it is an answer, else none."""
    given = text.strip()
    try:
        value = question.answer(given) if given else None
    except ValueError:
        value = None
    return Choice(chosen=None if value is None else str(value), typed=text)


def _is_sign(name: str) -> bool:
    return name.isdigit() or name in {"-", "."}


def _label_by_key(question: StudyQuestion, chosen: str | None, name: str) -> str | None:
    values = question.values
    if name.isdigit():
        number = int(name)
        return values[number - 1] if 1 <= number <= len(values) else chosen
    step = -_STEPS[name] if name in {"up", "down"} else _STEPS.get(name, 0)
    at = None if chosen is None else values.index(chosen)
    moved = _stepped(at, step, len(values) - 1)
    return None if moved is None else values[moved]


def _turned(question: StudyQuestion, chosen: str | None, label: str) -> str | None:
    """Return the chosen labels with one more or less, in the order of the question."""
    now = set(chosen.split(BETWEEN)) if chosen else set()
    return BETWEEN.join(value for value in question.values if value in now ^ {label}) or None


def _place_by_key(question: StudyQuestion, now: Choice, name: str, start: float) -> Choice:
    if question.kind == "scale" and _is_sign(name):
        possible = (text for text in (now.typed + name, name) if _possible(question, text))
        text = next(possible, "")
        return _typed(question, text) if text else Choice(chosen=now.chosen)
    steps = _ANALOGUE_STEPS if question.kind == "analogue" else _STEPS
    low, _, step = question.scale
    at = None if now.chosen is None else round((float(now.chosen) - low) / step)
    if at is None and question.kind == "analogue" and name in steps:
        moved: int | None = round(start * question.places)  # an end would draw marks towards it
    else:
        moved = _stepped(at, steps.get(name, 0), question.places)
    return Choice(chosen=None if moved is None else str(question.place(moved)))


def _possible(question: StudyQuestion, text: str) -> bool:
    """Return whether a place on the scale is or may begin with `text`."""
    low, high, step = question.scale
    if text == "-":
        return low < 0
    try:
        number = float(text)
    except ValueError:
        return False
    whole = step.is_integer() and low.is_integer()
    return min(low, 0.0) <= number <= max(high, 0.0) and not (whole and "." in text)


def _stepped(at: int | None, step: int, last: int) -> int | None:
    """Return the place `step` further; without a choice, the end at which an arrow starts."""
    if step == 0:
        return at
    if at is None:
        return 0 if step > 0 else last
    return min(max(at + step, 0), last)
