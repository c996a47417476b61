"""Layout of each screen as a page: its elements and its targets for presses.

A page shows the touch to make but nothing about the drive: the participant sees neither the
device's state in this trial nor the expected answer.
"""

from collections.abc import Iterator, Mapping
from math import ceil
from typing import get_args

from protocol.study.participant_texts import Wording, is_own_page
from runner.screens import Ask, Instruction, LeadIn, Notice, Pacing, Screen, Welcome
from runner.window.beam_sketch import fingers, labels, sketch
from runner.window.elements import FAINT, INK, WHITE, Box, Outline, Page, Picture, Target, Text
from runner.window.finger_feedback import own_finger
from runner.window.questions.page_layout import (
    BUTTON,
    HINT,
    MIDDLE,
    TITLE,
    TITLE_SIZE,
    Button,
    PageState,
    button,
    hint,
)
from runner.window.questions.question_pages import (
    chosen_in_advance,
    question_page,
    question_targets,
)

COUNT_SIZE, NOW_SIZE, PAGE_SIZE, BANNER_SIZE, SMALL_SIZE = 46.0, 23.0, 23.0, 20.0, 18.0
_WHOLE = Box(x=0, y=45, width=720, height=400)
_ABOVE = Box(x=0, y=200, width=720, height=130)
_PICTURE = Box(x=0, y=-20, width=720, height=290)
_PROGRESS = Box(x=280, y=282, width=230, height=28)
_CONSENT = Box(x=0, y=266, width=760, height=50)
_BELOW_BEAM = Box(x=0, y=-126, width=720, height=87)
_COUNT = Box(x=0, y=-112, width=120, height=58)
_SOON = Box(x=0, y=-155, width=740, height=28)
_CALL = Box(x=-295, y=-208, width=190, height=66)
_BANNER = Box(x=0, y=-273, width=780, height=50)


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
        case Ask(question=question):
            yield from (PageState(chosen=chosen) for chosen in chosen_in_advance(question))


def targets(screen: Screen) -> tuple[Target, ...]:
    """Return the targets on `screen`.

    Enter also activates `ready` and `confirm`, and Escape `call`, which the last page lacks.
    """
    call = Target(name="call", box=_CALL, role="call")
    ready = Target(name="ready", box=BUTTON, role="button")
    match screen:
        case Welcome() | Instruction():
            return (ready, call)
        case Ask():
            return (*question_targets(screen), call)
    return (ready,) if _is_last(screen) else (call,)


def _is_last(screen: Screen) -> bool:
    return isinstance(screen, Notice) and screen.is_last


def target_at(screen: Screen, x: float, y: float) -> Target | None:
    """Return the target at a point, or None."""
    return next((target for target in targets(screen) if target.box.holds(x, y)), None)


def _page(screen: Screen, view: PageState, wording: Wording, texts: Mapping[str, str]) -> Page:
    match screen:
        case Welcome():
            return _welcome(screen, view, texts)
        case Instruction():
            return _instruction(screen, view, texts)
        case LeadIn() | Pacing():
            return _touch(screen, view, texts)
        case Ask():
            return question_page(screen, view, wording)
    closing = button("button.close", view, texts) if _is_last(screen) else ()
    return (Text(text=texts[screen.text], box=MIDDLE, size=TITLE_SIZE), *closing)


def _welcome(screen: Welcome, view: PageState, texts: Mapping[str, str]) -> Page:
    filed = texts["consent"].format(reference=screen.consent)
    return (
        Text(text=texts["welcome"], box=MIDDLE, size=TITLE_SIZE),
        *([] if screen.consent is None else [_small(filed, _CONSENT)]),
        hint(texts["hint.start"], HINT),
        *button("button.ready", view, texts),
    )


def _own_page(screen: Instruction, view: PageState, texts: Mapping[str, str]) -> Page:
    """Return a page of the study's own: its text alone, or above its picture."""
    shown = () if screen.picture is None else (Picture(name=screen.picture, box=_PICTURE),)
    text = Text(text=texts[screen.text], box=_ABOVE if shown else _WHOLE, size=PAGE_SIZE)
    return (text, *shown, *button("button.ready", view, texts))


def _instruction(screen: Instruction, view: PageState, texts: Mapping[str, str]) -> Page:
    if is_own_page(screen.text):
        return _own_page(screen, view, texts)
    box = MIDDLE if screen.touch is None else TITLE
    drawn: Page = () if screen.touch is None else (*sketch(screen.touch), *labels(texts))
    if view.passed_s < screen.after_s:
        left_s = ceil(screen.after_s - view.passed_s)
        time = f"{left_s // 60}:{left_s % 60:02}"
        drawn = (hint(texts["break.left"].format(time=time), HINT),)
    title = Text(text=texts[screen.text], box=box, size=TITLE_SIZE)
    return (title, *drawn, *button("button.ready", view, texts))


def _touch(screen: LeadIn | Pacing, view: PageState, texts: Mapping[str, str]) -> Page:
    """Return the page whose mark rests, then moves at the sliding speed.

    It hides how long to hold a place.
    """
    title = Text(text=texts[screen.text], box=TITLE, size=TITLE_SIZE)
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
    return (Text(text=str(left), box=_COUNT, size=COUNT_SIZE), hint(soon, _SOON))


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
