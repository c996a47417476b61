"""Layout of each screen as a page: its elements and its targets for presses.

A page shows the touch to make but nothing about the drive: the participant sees neither the
device's state in this trial nor the expected answer.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from protocol.study.participant_texts import Wording, score_text
from protocol.study.questions import ANSWERS
from runner.screens import AskChange, AskScore, Instruction, LeadIn, Notice, Pacing, Screen, Welcome
from runner.window.beam_sketch import fingers, sketch
from runner.window.elements import ACCENT, FAINT, INK, PALE, WHITE, Box, Outline, Page, Target, Text
from runner.window.rating_scale import SCALE_BOX, scale

TITLE_SIZE, ANSWER_SIZE, BUTTON_SIZE, SMALL_SIZE = 30.0, 26.0, 24.0, 19.0
COUNT_SIZE = 60.0
_TITLE = Box(x=0, y=205, width=720, height=130)
_MIDDLE = Box(x=0, y=90, width=640, height=300)
_CONSENT = Box(x=0, y=-88, width=720, height=46)
_HINT = Box(x=0, y=-140, width=740, height=48)
_BUTTON = Box(x=0, y=-215, width=320, height=68)
_FOOT = Box(x=0, y=-275, width=760, height=30)
_BELOW_BEAM = Box(x=0, y=-133, width=720, height=100)
_COUNT = Box(x=0, y=-110, width=120, height=76)
_SOON = Box(x=0, y=-165, width=740, height=34)
_ANSWER = Box(x=0, y=95, width=420, height=62)
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


def page(screen: Screen, view: PageState, wording: Wording) -> Page:
    """Return the page of `screen` in the state `view`."""
    texts = wording.texts
    called = (_small(texts["operator.called"], _FOOT),) if view.operator_called else ()
    return (*_page(screen, view, wording, texts), *called)


def targets(screen: Screen) -> tuple[Target, ...]:
    """Return the targets on `screen`; Enter also activates `ready` and `confirm`."""
    match screen:
        case Welcome() | Instruction() | Notice(text="thanks"):
            return (Target(name="ready", box=_BUTTON),)
        case AskChange(question=question):
            return (*_answers(ANSWERS[question]), Target(name="confirm", box=_BUTTON))
        case AskScore():
            return (Target(name="scale", box=SCALE_BOX), Target(name="confirm", box=_BUTTON))
    return ()


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
    closing = _button("button.close", view, texts) if targets(screen) else ()
    return (Text(text=texts[screen.text], box=_MIDDLE, size=TITLE_SIZE), *closing)


def _welcome(screen: Welcome, view: PageState, texts: Mapping[str, str]) -> Page:
    filed = texts["consent"].format(reference=screen.consent)
    return (
        Text(text=texts["welcome"], box=_MIDDLE, size=TITLE_SIZE),
        *([] if screen.consent is None else [_small(filed, _CONSENT)]),
        _small(texts["hint.start"], _HINT),
        *_button("button.ready", view, texts),
    )


def _instruction(screen: Instruction, view: PageState, texts: Mapping[str, str]) -> Page:
    box, drawn = (_MIDDLE, ()) if screen.touch is None else (_TITLE, sketch(screen.touch))
    title = Text(text=texts[screen.text], box=box, size=TITLE_SIZE)
    return (title, *drawn, *_button("button.ready", view, texts))


def _touch(screen: LeadIn | Pacing, view: PageState, texts: Mapping[str, str]) -> Page:
    """Return the page whose mark rests, then moves at the sliding speed.

    It hides how long to hold a place.
    """
    title = Text(text=texts[screen.text], box=_TITLE, size=TITLE_SIZE)
    if isinstance(screen, LeadIn):
        return (title, *sketch(screen), *fingers(screen, 0.0), *_lead_in(screen, view, texts))
    marks = fingers(screen, min(view.passed_s / screen.duration_s, 1.0))
    now = Text(text=texts["touch.now"], box=_BELOW_BEAM, size=ANSWER_SIZE)
    return (title, *sketch(screen), *marks, now)


def _lead_in(screen: LeadIn, view: PageState, texts: Mapping[str, str]) -> Page:
    """Return what to do until the mark moves, and the countdown in three equal steps."""
    soon = texts["touch.soon.full" if screen.several else "touch.soon"]
    if not (screen.countdown and screen.seconds):
        return (Text(text=soon, box=_BELOW_BEAM, size=ANSWER_SIZE),)
    left = 3 - min(int(3 * view.passed_s / screen.seconds), 2)
    return (Text(text=str(left), box=_COUNT, size=COUNT_SIZE), _small(soon, _SOON))


def _change(screen: AskChange, view: PageState, texts: Mapping[str, str]) -> Page:
    answers = _answers(ANSWERS[screen.question])
    boxes = [
        element
        for number, answer in enumerate(answers, start=1)
        for element in _box(
            f"{number}   {texts[f'answer.{answer.name}']}",
            answer.box,
            chosen=answer.name == view.chosen,
        )
    ]
    return (
        Text(text=texts[f"question.{screen.question}"], box=_TITLE, size=TITLE_SIZE),
        *boxes,
        _small(texts["hint.change"].format(last=len(answers)), _HINT),
        *_button("button.confirm", view, texts, usable=view.chosen is not None),
    )


def _score(screen: AskScore, view: PageState, wording: Wording) -> Page:
    texts = wording.texts
    chosen = None if view.chosen is None else int(view.chosen)
    return (
        Text(text=score_text(wording, screen.rating), box=_TITLE, size=TITLE_SIZE),
        *scale(screen.rating, wording, chosen),
        _small(texts["hint.score"], _HINT),
        *_button("button.confirm", view, texts, usable=chosen is not None),
    )


def _answers(names: tuple[str, ...]) -> tuple[Target, ...]:
    """Return the targets of the answers from top to bottom."""
    return tuple(
        Target(name=name, box=replace(_ANSWER, y=_ANSWER.y - number * _ANSWER_STEP))
        for number, name in enumerate(names)
    )


def _small(text: str, box: Box) -> Text:
    return Text(text=text, box=box, size=SMALL_SIZE, colour=FAINT)


def _box(text: str, box: Box, *, chosen: bool) -> Page:
    fill, colour = (ACCENT, WHITE) if chosen else (WHITE, INK)
    return (
        Outline(points=box.corners, fill=fill, edge=ACCENT, width=3),
        Text(text=text, box=box, size=ANSWER_SIZE, colour=colour),
    )


def _button(label: str, view: PageState, texts: Mapping[str, str], *, usable: bool = True) -> Page:
    """Return the button, grey unless a press on it counts."""
    fill, colour = (ACCENT, WHITE) if usable and view.button == "live" else (PALE, FAINT)
    text = texts["saved" if view.button == "saved" else label]
    return (
        Outline(points=_BUTTON.corners, fill=fill),
        Text(text=text, box=_BUTTON, size=BUTTON_SIZE, colour=colour),
    )
