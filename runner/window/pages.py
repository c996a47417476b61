"""Layout of each screen as a page: its elements and its targets for presses.

A page shows the touch to make but nothing about the drive: the participant sees neither the
device's state in this trial nor the expected answer.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import ceil
from typing import Literal, get_args

from protocol.study.participant_texts import Wording, score_text
from protocol.study.questions import ANSWERS
from runner.screens import (
    AskChange,
    AskScore,
    Instruction,
    LeadIn,
    Notice,
    OwnFinger,
    Pacing,
    Screen,
    Welcome,
)
from runner.window.beam_sketch import fingers, labels, sketch
from runner.window.elements import ACCENT, FAINT, INK, PALE, WHITE, Box, Outline, Page, Target, Text
from runner.window.finger_feedback import own_finger
from runner.window.rating_scale import SCALE_BOX, scale

TITLE_SIZE, ANSWER_SIZE, BUTTON_SIZE, HINT_SIZE = 30.0, 26.0, 24.0, 22.0
COUNT_SIZE, NOW_SIZE, BANNER_SIZE, SMALL_SIZE = 50.0, 24.0, 20.0, 18.0
_PROGRESS = Box(x=280, y=282, width=230, height=28)
_CONSENT = Box(x=0, y=266, width=760, height=50)
_TITLE = Box(x=0, y=200, width=720, height=130)
_MIDDLE = Box(x=0, y=90, width=640, height=300)
_BELOW_BEAM = Box(x=0, y=-129, width=720, height=91)
_COUNT = Box(x=0, y=-115, width=120, height=64)
_SOON = Box(x=0, y=-161, width=740, height=28)
_HINT = Box(x=0, y=-132, width=740, height=86)
_BUTTON = Box(x=0, y=-208, width=320, height=66)
_CALL = Box(x=-295, y=-208, width=190, height=66)
_BANNER = Box(x=0, y=-273, width=780, height=50)
_ANSWER = Box(x=0, y=100, width=520, height=62)
_NUMBER_X, _NUMBER_WIDTH = -225.0, 60.0
_WORD_WIDTH = 385.0
_ANSWER_STEP = 78.0


Button = Literal["early", "live", "pressed", "saved"]


@dataclass(frozen=True, kw_only=True)
class PageState:
    """State of a page that changes while its screen is shown.

    The button is `early` until the page has been readable for long enough, `live` until it is
    pressed, then `pressed`, and `saved` once the journal has the answer.
    """

    chosen: str | None = None
    button: Button = "live"
    passed_s: float = 0.0
    operator_called: bool = False
    progress: tuple[int, int] | None = None
    finger: OwnFinger | None = None


def page(screen: Screen, view: PageState, wording: Wording) -> Page:
    """Return the page of `screen` in the state `view`."""
    texts = wording.texts
    around = () if _is_last(screen) else _around(screen, view, texts)
    return (*_page(screen, view, wording, texts), *around)


def states(screen: Screen) -> Iterator[PageState]:
    """Yield the states that the page of `screen` is likely to be in."""
    yield from (PageState(button=button) for button in get_args(Button))
    match screen:
        case LeadIn(seconds=seconds):
            yield from (PageState(passed_s=third * seconds / 3) for third in (1, 2))
        case AskChange(question=question):
            yield from (PageState(chosen=answer) for answer in ANSWERS[question])
        case AskScore(rating=rating):
            scores = range(rating.minimum, min(rating.maximum, rating.minimum + 20) + 1)
            yield from (PageState(chosen=str(score)) for score in scores)


def targets(screen: Screen) -> tuple[Target, ...]:
    """Return the targets on `screen`.

    Enter also activates `ready` and `confirm`, and Escape `call`, which the last page lacks.
    """
    call, ready = Target(name="call", box=_CALL), Target(name="ready", box=_BUTTON)
    confirm = Target(name="confirm", box=_BUTTON)
    match screen:
        case Welcome() | Instruction():
            return (ready, call)
        case AskChange(question=question):
            return (*_answers(ANSWERS[question]), confirm, call)
        case AskScore():
            return (Target(name="scale", box=SCALE_BOX), confirm, call)
    return (ready,) if _is_last(screen) else (call,)


def _is_last(screen: Screen) -> bool:
    return isinstance(screen, Notice) and screen.is_last


def target_at(screen: Screen, x: float, y: float) -> str | None:
    """Return the name of the target at a point, or None."""
    return next((target.name for target in targets(screen) if target.box.holds(x, y)), None)


def _page(screen: Screen, view: PageState, wording: Wording, texts: Mapping[str, str]) -> Page:
    match screen:
        case Welcome():
            return _welcome(screen, view, texts)
        case Instruction():
            return _instruction(screen, view, texts)
        case LeadIn() | Pacing():
            return _touch(screen, view, texts)
        case AskChange():
            return _change(screen, view, texts)
        case AskScore():
            return _score(screen, view, wording)
    closing = _button("button.close", view, texts) if _is_last(screen) else ()
    return (Text(text=texts[screen.text], box=_MIDDLE, size=TITLE_SIZE), *closing)


def _welcome(screen: Welcome, view: PageState, texts: Mapping[str, str]) -> Page:
    filed = texts["consent"].format(reference=screen.consent)
    return (
        Text(text=texts["welcome"], box=_MIDDLE, size=TITLE_SIZE),
        *([] if screen.consent is None else [_small(filed, _CONSENT)]),
        _hint(texts["hint.start"], _HINT),
        *_button("button.ready", view, texts),
    )


def _instruction(screen: Instruction, view: PageState, texts: Mapping[str, str]) -> Page:
    box = _MIDDLE if screen.touch is None else _TITLE
    drawn: Page = () if screen.touch is None else (*sketch(screen.touch), *labels(texts))
    if view.passed_s < screen.after_s:
        left_s = ceil(screen.after_s - view.passed_s)
        time = f"{left_s // 60}:{left_s % 60:02}"
        drawn = (_hint(texts["break.left"].format(time=time), _HINT),)
    title = Text(text=texts[screen.text], box=box, size=TITLE_SIZE)
    return (title, *drawn, *_button("button.ready", view, texts))


def _touch(screen: LeadIn | Pacing, view: PageState, texts: Mapping[str, str]) -> Page:
    """Return the page whose mark rests, then moves at the sliding speed.

    It hides how long to hold a place.
    """
    title = Text(text=texts[screen.text], box=_TITLE, size=TITLE_SIZE)
    own = () if view.finger is None else own_finger(view.finger, texts)
    beam = (title, *sketch(screen), *labels(texts))
    if isinstance(screen, LeadIn):
        return (*beam, *fingers(screen, 0.0), *_lead_in(screen, view, texts), *own)
    marks = fingers(screen, min(view.passed_s / screen.duration_s, 1.0))
    return (*beam, *marks, Text(text=texts["touch.now"], box=_BELOW_BEAM, size=NOW_SIZE), *own)


def _lead_in(screen: LeadIn, view: PageState, texts: Mapping[str, str]) -> Page:
    """Return what to do until the mark moves, and the countdown in three equal steps."""
    soon = texts["touch.soon.full" if screen.several else "touch.soon"]
    if not (screen.countdown and screen.seconds):
        return (Text(text=soon, box=_BELOW_BEAM, size=NOW_SIZE),)
    left = 3 - min(int(3 * view.passed_s / screen.seconds), 2)
    return (Text(text=str(left), box=_COUNT, size=COUNT_SIZE), _hint(soon, _SOON))


def _change(screen: AskChange, view: PageState, texts: Mapping[str, str]) -> Page:
    answers = _answers(ANSWERS[screen.question])
    hint = "hint.change.two" if len(answers) == 2 else "hint.change"
    boxes = [
        element
        for number, answer in enumerate(answers, start=1)
        for element in _box(
            str(number),
            texts[f"answer.{answer.name}"],
            answer.box,
            chosen=answer.name == view.chosen,
        )
    ]
    return (
        Text(text=texts[f"question.{screen.question}"], box=_TITLE, size=TITLE_SIZE),
        *boxes,
        _hint(texts[hint].format(last=len(answers)), _HINT),
        *_button("button.confirm", view, texts, usable=view.chosen is not None),
    )


def _score(screen: AskScore, view: PageState, wording: Wording) -> Page:
    texts = wording.texts
    chosen = None if view.chosen is None else int(view.chosen)
    return (
        Text(text=score_text(wording, screen.rating), box=_TITLE, size=TITLE_SIZE),
        *scale(screen.rating, wording, chosen),
        _hint(texts["hint.score"], _HINT),
        *_button("button.confirm", view, texts, usable=chosen is not None),
    )


def _answers(names: tuple[str, ...]) -> tuple[Target, ...]:
    """Return the targets of the answers from top to bottom."""
    return tuple(
        Target(name=name, box=replace(_ANSWER, y=_ANSWER.y - number * _ANSWER_STEP))
        for number, name in enumerate(names)
    )


def _around(screen: Screen, view: PageState, texts: Mapping[str, str]) -> Page:
    """Return what stands on every page but the last: progress, and the call for the operator."""
    progress: Page = ()
    if view.progress is not None and not isinstance(screen, Welcome):
        number, total = view.progress
        shown = texts["progress"].format(number=number, total=total)
        progress = (_small(shown, _PROGRESS),)
    called = (
        Outline(points=_BANNER.corners, fill=INK),
        Text(text=texts["operator.called"], box=_BANNER, size=BANNER_SIZE, colour=WHITE),
    )
    return (
        *progress,
        Outline(points=_CALL.corners, fill=WHITE, edge=FAINT),
        Text(text=texts["button.call"], box=_CALL, size=SMALL_SIZE),
        *(called if view.operator_called else ()),
    )


def _small(text: str, box: Box) -> Text:
    return Text(text=text, box=box, size=SMALL_SIZE, colour=FAINT)


def _hint(text: str, box: Box) -> Text:
    return Text(text=text, box=box, size=HINT_SIZE, colour=FAINT)


def _box(number: str, text: str, box: Box, *, chosen: bool) -> Page:
    """Return an answer, with its number in a column of its own."""
    fill, colour = (ACCENT, WHITE) if chosen else (WHITE, INK)
    column = replace(box, x=box.x + _NUMBER_X, width=_NUMBER_WIDTH)
    return (
        Outline(points=box.corners, fill=fill, edge=ACCENT, width=3),
        Text(text=number, box=column, size=ANSWER_SIZE, colour=colour),
        Text(text=text, box=replace(box, width=_WORD_WIDTH), size=ANSWER_SIZE, colour=colour),
    )


def _button(label: str, view: PageState, texts: Mapping[str, str], *, usable: bool = True) -> Page:
    """Return the button, grey unless a press on it counts."""
    fill, colour = (ACCENT, WHITE) if usable and view.button == "live" else (PALE, FAINT)
    text = texts["saved" if view.button == "saved" else label]
    return (
        Outline(points=_BUTTON.corners, fill=fill),
        Text(text=text, box=_BUTTON, size=BUTTON_SIZE, colour=colour),
    )
