"""Layout of each screen as a page: its elements and its targets for presses.

A page shows the touch to make but nothing about the drive: the participant sees neither the
device's state in this trial nor the expected answer.
"""

from collections.abc import Iterator, Mapping
from itertools import chain
from math import ceil
from typing import get_args

from device.beam.beam import Beam
from protocol.study.participant_texts import Wording, filled, is_own_page
from runner import screens
from runner.window import question_pages as parts
from runner.window.elements import (
    ACCENT,
    FAINT,
    INK,
    PALE,
    WHITE,
    Box,
    Dot,
    Outline,
    Page,
    Picture,
    Size,
    Target,
    Text,
    framed,
)

BEAM_M = Beam().length_m
_LEFT, _LENGTH = -280.0, 600.0
BEAM_Y, _BEAM_HEIGHT = 0.0, 34.0
_ARROW_Y, _LABEL_Y, _HEAD, _FINGER_RADIUS = 52.0, -70.0, 16.0, 24.0

BESIDE_M = (-0.024, -0.008, 0.008, 0.024)
"""Positions of several fingers relative to their centre."""


def beam_x(position_m: float) -> float:
    """Return where a place on the beam lies across the canvas; the clamp is on the left."""
    return _LEFT + _LENGTH * position_m / BEAM_M


def sketch(way: screens.FingerPath, texts: Mapping[str, str]) -> Page:
    """Return the beam and the touch: an arrow along it, or marks that point at places.

    Below it stands what the clamp is, and on which side of the beam the participant sits.
    """
    clamp = Box(x=_LEFT - 20, y=BEAM_Y, width=40, height=110)
    beam = Box(x=_LEFT + _LENGTH / 2, y=BEAM_Y, width=_LENGTH, height=_BEAM_HEIGHT)
    marks = [_arrow(way)]
    if way.start_m == way.end_m:
        marks = [_mark(place_m, way.harder) for place_m in _places(way, way.start_m)]
    return (
        Outline(points=clamp.corners, fill=FAINT),
        Outline(points=beam.corners, fill=PALE, edge=INK),
        *chain.from_iterable(marks),
        _small(texts["beam.clamp"], Box(x=_LEFT - 20, y=_LABEL_Y, width=150.0, height=24)),
        _small(texts["beam.you"], Box(x=_LEFT + _LENGTH / 2, y=_LABEL_Y, width=300.0, height=24)),
    )


def fingers(way: screens.FingerPath, fraction: float) -> tuple[Dot, ...]:
    """Return the pacing marks after `fraction` of the way, from 0 to 1."""
    position_m = way.start_m + fraction * (way.end_m - way.start_m)
    places_m = _places(way, position_m)
    return tuple(Dot(x=beam_x(place_m), y=BEAM_Y, radius=_FINGER_RADIUS) for place_m in places_m)


def _places(way: screens.FingerPath, position_m: float) -> list[float]:
    """Return the positions of the fingers; of several, only those on the beam."""
    if not way.several:
        return [position_m]
    places = [position_m + beside_m for beside_m in BESIDE_M]
    return [place_m for place_m in places if 0 <= place_m <= BEAM_M]


def _arrow(way: screens.FingerPath) -> Page:
    start, end = beam_x(way.start_m), beam_x(way.end_m)
    base = end - _HEAD if end > start else end + _HEAD
    head = ((end, _ARROW_Y), (base, _ARROW_Y + _HEAD), (base, _ARROW_Y - _HEAD))
    return (
        Outline(points=((start, _ARROW_Y), (base, _ARROW_Y)), edge=ACCENT, width=6),
        Outline(points=((start, _ARROW_Y - 14), (start, _ARROW_Y + 14)), edge=ACCENT, width=6),
        Outline(points=head, fill=ACCENT),
    )


def _mark(place_m: float, harder: bool) -> Page:
    """Return the mark of a place to touch: one tip points at it, two mean to press harder."""
    x = beam_x(place_m)
    place = Outline(points=((x, BEAM_Y - 17), (x, BEAM_Y + 17)), edge=ACCENT, width=6)
    tips = [((x, y), (x + 17, y + 26), (x - 17, y + 26)) for y in (26.0, 56.0)[: 1 + harder]]
    return (place, *(Outline(points=points, fill=ACCENT) for points in tips))


_OWN_RADIUS = 9.0
_BAR = Box(x=20, y=-196, width=360, height=26)
_LABEL = Box(x=20, y=-228, width=380, height=26)
_LONGEST = 2.0
"""Force at the bar's right end, relative to the instructed one."""


def own_finger(finger: screens.OwnFinger, texts: Mapping[str, str]) -> Page:
    """Return a dot at the finger's place, and a bar with the range in which its force should be."""
    low, high = (_bar_x(1 + sign * finger.within) for sign in (-1, 1))
    wanted = Box(x=(low + high) / 2, y=_BAR.y, width=high - low, height=_BAR.height)
    # A sensor may report a place beside the beam, which is off the page.
    place_m = min(max(finger.position_m, 0.0), BEAM_M)
    return (
        Outline(points=_BAR.corners, fill=WHITE, edge=INK),
        Outline(points=wanted.corners, fill=PALE, edge=ACCENT),
        Text(text=texts["own.finger"], box=_LABEL, size=Size.SMALL),
        Dot(x=_bar_x(finger.force), y=_BAR.y, radius=_OWN_RADIUS, fill=INK),
        Dot(x=beam_x(place_m), y=BEAM_Y, radius=_OWN_RADIUS, fill=INK),
    )


def _bar_x(force: float) -> float:
    share = min(max(force, 0.0), _LONGEST) / _LONGEST
    return _BAR.x + (share - 0.5) * _BAR.width


_WHOLE = Box(x=0, y=45, width=720, height=400)
_ABOVE = Box(x=0, y=200, width=720, height=130)
_PICTURE = Box(x=0, y=-20, width=720, height=290)
_PROGRESS = Box(x=280, y=282, width=230, height=28)
_INTERVAL = Box(x=0, y=282, width=220, height=30)
_CONSENT = Box(x=0, y=266, width=760, height=50)
_BELOW_BEAM = Box(x=0, y=-126, width=720, height=87)
_COUNT = Box(x=0, y=-112, width=120, height=58)
_SOON = Box(x=0, y=-155, width=740, height=28)
_CALL = Box(x=-295, y=-208, width=190, height=66)
_BANNER = Box(x=0, y=-273, width=780, height=50)


def page(screen: screens.Screen, view: parts.PageState, wording: Wording) -> Page:
    texts = wording.texts
    match screen:
        case screens.Welcome():
            shown = _welcome(screen, view, texts)
        case screens.Instruction():
            shown = _instruction(screen, view, texts)
        case screens.LeadIn() | screens.Pacing():
            shown = _touch(screen, view, texts)
        case screens.Ask():
            shown = parts.question_page(screen, view, wording)
        case screens.Notice():
            shown = (Text(text=texts[screen.text], box=parts.MIDDLE, size=Size.TITLE),)
    if screens.is_last(screen):
        return (*shown, *parts.button("button.close", view, texts))
    return (*shown, *_interval(screen, texts), *_around(screen, view, texts))


def states(screen: screens.Screen) -> Iterator[parts.PageState]:
    """Yield the states that the page of `screen` is likely to be in."""
    yield from (parts.PageState(button=state) for state in get_args(parts.Button))
    match screen:
        case screens.LeadIn(seconds=seconds):
            yield from (parts.PageState(passed_s=third * seconds / 3) for third in (1, 2))
        case screens.Ask(question=question):
            yield from (
                parts.PageState(chosen=chosen) for chosen in parts.chosen_in_advance(question)
            )


def targets(screen: screens.Screen) -> tuple[Target, ...]:
    """Return the targets on `screen`.

    Enter also activates `ready` and `confirm`, and Escape `call`, which the last page lacks.
    """
    call = Target(name="call", box=_CALL, role="call")
    ready = Target(name="ready", box=parts.BUTTON, role="button")
    match screen:
        case screens.Welcome() | screens.Instruction():
            return (ready, call)
        case screens.Ask():
            return (*parts.question_targets(screen), call)
    return (ready,) if screens.is_last(screen) else (call,)


def target_at(screen: screens.Screen, x: float, y: float) -> Target | None:
    return next((target for target in targets(screen) if target.box.holds(x, y)), None)


def _welcome(screen: screens.Welcome, view: parts.PageState, texts: Mapping[str, str]) -> Page:
    filed = filled(texts["consent"], reference=screen.consent)
    return (
        Text(text=texts["welcome"], box=parts.MIDDLE, size=Size.TITLE),
        *([] if screen.consent is None else [_small(filed, _CONSENT)]),
        parts.hint(texts["hint.start"], parts.HINT),
        *parts.button("button.ready", view, texts),
    )


def _instruction(
    screen: screens.Instruction, view: parts.PageState, texts: Mapping[str, str]
) -> Page:
    size, box = Size.TITLE, parts.MIDDLE
    drawn: Page = ()
    if is_own_page(screen.text):
        size, box = Size.PAGE, _WHOLE
    if screen.picture is not None:
        box, drawn = _ABOVE, (Picture(name=screen.picture, box=_PICTURE),)
    if screen.touch is not None:
        box, drawn = parts.TITLE, sketch(screen.touch, texts)
    if view.passed_s < screen.after_s:
        left_s = ceil(screen.after_s - view.passed_s)
        time = f"{left_s // 60}:{left_s % 60:02}"
        drawn = (parts.hint(filled(texts["break.left"], time=time), parts.HINT),)
    title = Text(text=texts[screen.text], box=box, size=size)
    return (title, *drawn, *parts.button("button.ready", view, texts))


def _touch(
    screen: screens.LeadIn | screens.Pacing, view: parts.PageState, texts: Mapping[str, str]
) -> Page:
    """Return the page whose mark rests, then moves; it hides how long to hold a place."""
    title = Text(text=texts[screen.text], box=parts.TITLE, size=Size.TITLE)
    own = () if view.finger is None else own_finger(view.finger, texts)
    beam = (title, *sketch(screen, texts))
    if isinstance(screen, screens.LeadIn):
        return (*beam, *fingers(screen, 0.0), *_lead_in(screen, view, texts), *own)
    # The mark stays at its end until the session shows the next page.
    marks = fingers(screen, min(view.passed_s / screen.duration_s, 1.0))
    return (*beam, *marks, Text(text=texts["touch.now"], box=_BELOW_BEAM, size=Size.NOW), *own)


def _lead_in(screen: screens.LeadIn, view: parts.PageState, texts: Mapping[str, str]) -> Page:
    """Return what to do until the mark moves, and the countdown in three equal steps."""
    soon = texts["touch.soon.full" if screen.several else "touch.soon"]
    if not (screen.countdown and screen.seconds):
        return (Text(text=soon, box=_BELOW_BEAM, size=Size.NOW),)
    left = 3 - min(int(3 * view.passed_s / screen.seconds), 2)
    return (Text(text=str(left), box=_COUNT, size=Size.COUNT), parts.hint(soon, _SOON))


def _interval(screen: screens.Screen, texts: Mapping[str, str]) -> Page:
    """Return which of the touches of a trial it is, as a marked line."""
    touch = screen.touch if isinstance(screen, screens.Instruction) else screen
    if not isinstance(touch, screens.FingerPath) or not touch.interval:
        return ()
    text = texts[f"interval.{touch.interval}"]
    return framed(Text(text=text, box=_INTERVAL, size=Size.INTERVAL, colour=WHITE), fill=ACCENT)


def _around(screen: screens.Screen, view: parts.PageState, texts: Mapping[str, str]) -> Page:
    """Return what stands on every page but the last: progress, and the call for the operator."""
    progress: Page = ()
    if view.progress is not None and not isinstance(screen, screens.Welcome):
        number, total = view.progress
        shown = filled(texts["progress"], number=number, total=total)
        progress = (_small(shown, _PROGRESS),)
    call = Text(text=texts["button.call"], box=_CALL, size=Size.SMALL)
    called = Text(text=texts["operator.called"], box=_BANNER, size=Size.BANNER, colour=WHITE)
    return (
        *progress,
        *framed(call, fill=WHITE, edge=FAINT),
        *(framed(called, fill=INK) if view.operator_called else ()),
    )


def _small(text: str, box: Box) -> Text:
    return Text(text=text, box=box, size=Size.SMALL, colour=FAINT)
