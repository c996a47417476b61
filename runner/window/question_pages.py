"""The page of each kind of question, and its targets for presses."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import count, pairwise
from math import ceil
from typing import Any, Literal

from protocol.study.participant_texts import Wording, band_name, filled, label_text, question_text
from protocol.study.rules import Band, Label
from protocol.study.study_question import BETWEEN, StudyQuestion
from runner.screens import Ask, OwnFinger
from runner.window.elements import (
    ACCENT,
    CANVAS,
    FAINT,
    INK,
    PALE,
    WHITE,
    Box,
    Dot,
    Element,
    Input,
    Key,
    Outline,
    Page,
    Pressed,
    Released,
    Size,
    Target,
    Text,
    Typed,
    framed,
    text_width,
)

TITLE = Box(x=0, y=200, width=720, height=130)
MIDDLE = Box(x=0, y=90, width=640, height=300)
HINT = Box(x=0, y=-126, width=740, height=84)  # three lines, clear of the buttons
BUTTON = Box(x=0, y=-208, width=320, height=66)
_NUMBER_X, _NUMBER_WIDTH, _BESIDE_WORDS = 35.0, 60.0, 135.0

Button = Literal["early", "live", "pressed", "saved"]


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What is chosen, as an answer; and what is typed, which may not be an answer yet.

    After the key for `capitals` the next letter on the screen is one.
    """

    chosen: str | None = None
    typed: str = ""
    capitals: bool = False


@dataclass(frozen=True, kw_only=True)
class PageState(Choice):
    """State of a page that changes while its screen is shown.

    The button is `early` until the page has been readable for long enough, `live` until it is
    pressed, then `pressed`, and `saved` once the journal has the answer.
    """

    button: Button = "live"
    passed_s: float = 0.0
    operator_called: bool = False
    progress: tuple[int, int] | None = None
    finger: OwnFinger | None = None


def hint(text: str, box: Box) -> Text:
    return Text(text=text, box=box, size=Size.HINT, colour=FAINT)


def button(label: str, view: PageState, texts: Mapping[str, str], *, usable: bool = True) -> Page:
    """Return the button, grey unless a press on it counts."""
    fill, colour = (ACCENT, WHITE) if usable and view.button == "live" else (PALE, FAINT)
    text = texts["saved" if view.button == "saved" else label]
    return framed(Text(text=text, box=BUTTON, size=Size.BUTTON, colour=colour), fill)


_SCALE_LENGTH = 660.0
MOST_STEPS = int(_SCALE_LENGTH)
"""Of a scale: on the smallest screen each place has a pixel of its own."""
_BESIDE = 33.0
"""What lies beside the ends of the scale belongs to it."""
_LABEL_GAP = 12.0
_TICK_GAP = 12.0
"""Ticks at least as far apart can be told apart."""
_LINE_Y, _BRACKET_Y = 50.0, -12.0
_WIDEST_NAME = 170.0
"""Of the name of a place."""


def score_x(place: float, question: StudyQuestion) -> float:
    """Return where a place on the scale lies across the canvas; the scale is centred."""
    low, high, _ = question.scale
    return (place - (low + high) / 2) * _unit(question)


def score_at(x: float, question: StudyQuestion) -> float:
    """Return the place `x` in units of the scale, not rounded, within its ends."""
    low, high, _ = question.scale
    place = x / _unit(question) + (low + high) / 2
    return min(max(place, low), high)


def nearest(x: float, question: StudyQuestion) -> int | float:
    """Return the place on the scale that can be chosen nearest to `x`."""
    low, _, step = question.scale
    return question.place(round((score_at(x, question) - low) / step))


def _unit(question: StudyQuestion) -> float:
    low, high, _ = question.scale
    return _SCALE_LENGTH / (high - low)


SCALE_BOX = Box(x=0, y=_LINE_Y - 12, width=_SCALE_LENGTH + 2 * _BESIDE, height=90)
"""Where a press chooses a place."""


def scale(
    question: StudyQuestion, bands: Sequence[Band], wording: Wording, chosen: float | None
) -> Page:
    """Return the scale with its labels or bands; it bears no mark until one is chosen."""
    line = Outline(
        points=((-_SCALE_LENGTH / 2, _LINE_Y), (_SCALE_LENGTH / 2, _LINE_Y)), edge=INK, width=3
    )
    mark = () if chosen is None else _mark(chosen, question)
    ticks = [
        Outline(points=((x, _LINE_Y - 10), (x, _LINE_Y + 10)), edge=INK, width=3)
        for x in (score_x(place, question) for place in marked(question, bands))
    ]
    width = _room(question) - 2
    numbers = [
        Text(
            text=_shown(place),
            box=Box(x=score_x(place, question), y=_LINE_Y - 34, width=width, height=34),
            size=Size.LABEL,
        )
        for place in labelled(question, bands)
    ]
    names = [_name(label, question, wording) for label in question.labels]
    brackets = [element for band in bands for element in _band(band, question, wording)]
    return (line, *ticks, *numbers, *names, *brackets, *mark)


def _mark(chosen: float, question: StudyQuestion) -> Page:
    """Return the mark at the chosen place and, of a scale with numbers, its number in large."""
    x = score_x(chosen, question)
    dot = Dot(x=x, y=_LINE_Y, radius=15.0)
    if question.kind == "analogue":
        return (dot,)
    box = Box(x=x, y=_LINE_Y + 44, width=100, height=46)
    return (dot, Text(text=_shown(chosen), box=box, size=Size.CHOSEN, colour=ACCENT))


def marked(question: StudyQuestion, bands: Sequence[Band] = ()) -> list[int | float]:
    """Return the places that have a tick, as the study asks; all can be chosen.

    Where all are asked for and there are too many, they are those that have a number.
    """
    low, _, step = question.scale
    ends = {0, question.places}
    ticks = "ends" if question.kind == "analogue" else question.ticks
    if ticks == "all":
        has_room = _unit(question) * step >= _TICK_GAP
        ends |= set(range(question.places)) if has_room else _round_steps(question)
    elif ticks == "labels":
        named: list[float] = [place for band in bands for place in (band.first, band.last)]
        named += [label.at for label in question.labels if label.at is not None]
        ends |= {round((place - low) / step) for place in named}
    return [question.place(at) for at in sorted(ends)]


def _round_steps(question: StudyQuestion) -> set[int]:
    """Return the ends, and the steps that a round number divides, so far apart as numbers need."""
    low, _, step = question.scale
    # The least of 1, 2, 5, 10, 20, … steps.
    rounds = (first * 10**zeros for zeros in count() for first in (1, 2, 5))
    room = _room(question) / _unit(question) / step
    apart = next(steps for steps in rounds if steps >= room)
    first = round(low / step)
    return {0, question.places, *range(-first % apart, question.places + 1, apart)}


def _room(question: StudyQuestion) -> float:
    """Return what the widest number needs."""
    ends = (question.place(0), question.place(1), question.place(question.places))
    return max(text_width(_shown(end), Size.LABEL) for end in ends) + _LABEL_GAP


def labelled(question: StudyQuestion, bands: Sequence[Band] = ()) -> list[int | float]:
    """Return the marked places that have a number: the ends, and what has room between them."""
    if question.kind == "analogue":
        return []
    places = marked(question, bands)
    if question.ticks == "all":
        places = [question.place(at) for at in sorted(_round_steps(question))]
    first, *between, last = places
    room, shown = _room(question) / _unit(question), [first]
    for place in between:
        # The last number stands in any case, so that room is left for it.
        if min(place - shown[-1], last - place) >= room:
            shown.append(place)
    return [*shown, last]


def look(screen: Ask, wording: Wording, display: Mapping[str, Any]) -> dict[str, Any]:
    """Return how the scale of `screen` looks on a `display`, for the journal."""
    question, bands, mm_per_px = screen.question, screen.bands, display["mm_per_px"]
    length_px = round(_SCALE_LENGTH * display["px_per_unit"], 1)
    return {
        "ticks": marked(question, bands),
        "labels": [_shown(place) for place in labelled(question, bands)],
        "bands": [[band.first, band.last, band_name(band, wording)] for band in bands],
        "length_px": length_px,
        "length_mm": None if mm_per_px is None else round(length_px * mm_per_px, 1),
    }


def _shown(place: float) -> str:
    # Steps of 0.1 add up to 0.30000000000000004, which nobody should read.
    return f"{place:.10g}"


def _name(label: Label, question: StudyQuestion, wording: Wording) -> Text:
    """Return the name of a place below it, as wide as its neighbours and the canvas allow."""
    x = score_x(label.at or 0.0, question)
    others = [score_x(other.at or 0.0, question) for other in question.labels if other != label]
    width = min([_WIDEST_NAME, *(abs(other - x) - 4 for other in others)])
    edge = CANVAS[0] / 2 - 4 - width / 2
    below = 50.0 if question.kind == "analogue" else 86.0  # the numbers are between
    box = Box(x=min(max(x, -edge), edge), y=_LINE_Y - below, width=width, height=62)
    return Text(text=label_text(label, wording), box=box, size=Size.NAME)


def _band(band: Band, question: StudyQuestion, wording: Wording) -> Page:
    half = _unit(question) / 2
    # Brackets of neighbouring bands must not touch.
    gap = min(4.0, half / 4)
    left = score_x(band.first, question) - half + gap
    right = score_x(band.last, question) + half - gap
    box = Box(x=(left + right) / 2, y=_BRACKET_Y - 38, width=right - left, height=62)
    corners = [(left, _BRACKET_Y + 6), (left, _BRACKET_Y), (right, _BRACKET_Y)]
    bracket = [*corners, (right, _BRACKET_Y + 6)]
    return (
        *(Outline(points=side, edge=FAINT) for side in pairwise(bracket)),
        Text(text=band_name(band, wording) or "", box=box, size=Size.BAND),
    )


_FEW = 4
"""As many answers stand one below another, more in two columns."""
_COLUMN_X = 184.0
_ENTRY = Box(x=0, y=108, width=600, height=46)
_DIGITS = ("123456", "7890-.")
_LETTERS = ("1234567890", "qwertyuiop", "asdfghjkl'", "zxcvbnm,.-")
_MORE_LETTERS = 8
"""As many of a language's own stand beside those from a to z; more, an alphabet, replace them."""
_WIDEST_ROW = 744.0
SPACE, BACKSPACE, SHIFT = "space", "backspace", "Aa"
"""Keys on the screen that are not named by what they type."""
_WIDE = {SPACE: 160.0, BACKSPACE: 160.0}


def question_targets(screen: Ask) -> tuple[Target, ...]:
    question = screen.question
    confirm = Target(name="confirm", box=BUTTON, role="button")
    match question.form:
        case "labels":
            return (*_answers(question.values), confirm)
        case "scale":
            return (Target(name="scale", box=SCALE_BOX, role="scale"), confirm)
        case "typed":
            return (*_keys(screen), confirm)


def question_page(screen: Ask, view: PageState, wording: Wording) -> Page:
    """Return the page of a question; nothing is marked until it is chosen."""
    question, texts, chosen = screen.question, wording.texts, view.chosen
    match question.form:
        case "labels":
            shown, key = _answer_boxes(question, chosen, wording), "hint.change"
        case "scale":
            at = None if chosen is None else float(chosen)
            shown, key = scale(question, screen.bands, wording, at), "hint.score"
        case "typed":
            shown, key = _entry(screen, view), "hint.typed"
    if question.kind in {"several", "analogue"}:
        key = f"hint.{question.kind}"
    elif len(question.values) == 2:
        key = "hint.change.two"
    skips = chosen is None and not question.required
    label = "button.skip" if skips else "button.confirm"
    return (
        Text(text=question_text(question, wording), box=TITLE, size=Size.TITLE),
        *shown,
        hint(filled(texts[key], last=len(question.labels)), HINT),
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
    top = 131.0 - (step - gap) / 2
    x, width = (0, 520) if columns == 1 else (-_COLUMN_X, 2 * _COLUMN_X - 18)
    boxes = (
        Box(x=x + 2 * _COLUMN_X * column, y=top - step * row, width=width, height=step - gap)
        for column in range(columns)
        for row in range(rows)
    )
    return tuple(Target(name=value, box=box) for value, box in zip(values, boxes, strict=False))


def _answer_boxes(question: StudyQuestion, chosen: str | None, wording: Wording) -> Page:
    """Return the answers to press, each with its number in a column of its own."""
    marked = (chosen or "").split(BETWEEN) if question.kind == "several" else [chosen]
    size = Size.ANSWER if len(question.labels) <= _FEW else Size.SMALL_ANSWER
    drawn: list[Element] = []
    answers = zip(_answers(question.values), question.labels, strict=True)
    for number, (answer, label) in enumerate(answers, start=1):
        box = answer.box
        fill, colour = (ACCENT, WHITE) if answer.name in marked else (WHITE, INK)
        column = replace(box, x=box.x - box.width / 2 + _NUMBER_X, width=_NUMBER_WIDTH)
        words = replace(box, width=box.width - _BESIDE_WORDS)
        drawn += [
            Outline(points=box.corners, fill=fill, edge=ACCENT, width=3),
            Text(text=str(number), box=column, size=size, colour=colour),
            Text(text=label_text(label, wording), box=words, size=size, colour=colour),
        ]
    return tuple(drawn)


def _entry(screen: Ask, view: PageState) -> Page:
    """Return what is typed in its frame, and keys for those who answer by touch."""
    unit = f" {screen.question.unit}" if screen.question.unit else ""
    room = _ENTRY.width - 20
    shown = f"{view.typed}_{unit}"
    while text_width(shown, Size.ENTRY) > room and len(shown) > 1:
        shown = shown[1:]  # the end, which is typed now, stays in view
    names = {SPACE: "", BACKSPACE: "←"}
    keys: list[Element] = []
    for key in _keys(screen):
        keys.append(Outline(points=key.box.corners, fill=WHITE, edge=FAINT, width=1))
        if text := names.get(key.name, _typed_by(key.name, view)):
            keys.append(Text(text=text, box=key.box, size=Size.KEY))
    entry = Text(text=shown, box=_ENTRY, size=Size.ENTRY)
    return (*framed(entry, fill=WHITE, edge=INK), *keys)


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
        return (*_LETTERS, (SHIFT, *letters, SPACE, BACKSPACE))
    third = ceil(len(letters) / 3)
    own = [letters[at : at + third] for at in range(0, len(letters), third)]
    shift = () if letters.upper() == letters else (SHIFT,)  # Hebrew, for one, has no capitals
    return (_LETTERS[0], *own, (*shift, "'", ",", ".", "-", SPACE, BACKSPACE))


def _typed_by(key: str, now: Choice) -> str:
    """Return what a key on the screen types."""
    capital = key.upper()
    return capital if now.capitals and key != SHIFT and len(capital) == 1 else key


# What a key or a press makes of a choice, for each kind of question, and what makes an answer.

_STEPS = {"left": -1, "right": 1, "down": -1, "up": 1}
_ANALOGUE_STEPS = {"left": -10, "right": 10, "down": -100, "up": 100}
"""In tenths, too small to be made by hand."""


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
            return Choice(chosen=_label_by_key(question, now.chosen, key.name))
        case "several":
            label = _label_by_key(question, None, key.name if key.name.isdigit() else "")
            return now if label is None else by_press(question, now, label)
        case "scale" | "analogue":
            return _place_by_key(question, now, key.name, start)
        case "number" | "text":
            is_sign = question.is_number and _is_sign(key.name)
            return _longer(question, now, key.name) if is_sign else now


def by_press(question: StudyQuestion, now: Choice, target: str) -> Choice:
    match question.kind:
        case "choice":
            return Choice(chosen=target)
        case "several":
            marked = set(now.chosen.split(BETWEEN)) if now.chosen else set()
            turned = (value for value in question.values if value in marked ^ {target})
            return Choice(chosen=BETWEEN.join(turned) or None)
        case "scale" | "analogue" | "number" | "text":
            if target == BACKSPACE:
                return _typed(question, now.typed[:-1])
            if target == SHIFT:
                return replace(now, capitals=not now.capitals)
            return _longer(question, now, " " if target == SPACE else _typed_by(target, now))


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
        case "scale" | "number":
            # Without an exponent, which no key of the window types.
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
    # Answers stand one below another, so that "up" leads to the one before.
    step = -_STEPS[name] if name in {"up", "down"} else _STEPS.get(name, 0)
    at = None if chosen is None else values.index(chosen)
    moved = _stepped(at, step, len(values) - 1)
    return None if moved is None else values[moved]


def _place_by_key(question: StudyQuestion, now: Choice, name: str, start: float) -> Choice:
    if question.kind == "scale" and _is_sign(name):
        # A digit that cannot follow begins anew: after 7, a 3 on a scale to 10 is 3.
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
    # The beginning of a number lies between 0 and the number: 1 may become 10 on a scale from 5.
    return min(low, 0.0) <= number <= max(high, 0.0) and not (whole and "." in text)


def _stepped(at: int | None, step: int, last: int) -> int | None:
    """Return the place `step` further; without a choice, the end at which an arrow starts."""
    if step == 0:
        return at
    if at is None:
        return 0 if step > 0 else last
    return min(max(at + step, 0), last)
