"""Layout of each screen as a page: its elements and its targets for presses.

A page shows the touch to make but nothing about the drive: the participant sees neither the
device's state in this trial nor the expected answer.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from math import ceil, hypot
from typing import get_args

from protocol.study.participant_texts import Wording, filled, is_own_page
from protocol.study.surface import NO_PICTURE
from runner import screens
from runner.window import question_pages as parts
from runner.window.elements import (
    ACCENT,
    CANVAS,
    FAINT,
    INK,
    PALE,
    WHITE,
    Box,
    Dot,
    Outline,
    Page,
    Picture,
    Point,
    Size,
    Target,
    Text,
    framed,
)

_EDGE, _CLAMP = 320.0, 40.0
BEAM_Y, _BEAM_HEIGHT = 0.0, 34.0
_ARROW_Y, _LABEL_Y, _HEAD, _FINGER_RADIUS = 52.0, -70.0, 16.0, 24.0
_SURFACE = Box(x=0, y=26, width=720, height=212)
"""Of a picture of the surface."""
_RIM = 3.0

BESIDE_M = (-0.024, -0.008, 0.008, 0.024)
"""Positions of several fingers relative to their centre."""
_SEVERAL_M = 0.064
"""Length under several fingers; on a shorter surface they lie closer together."""


def beam_ends(surface: screens.ShownSurface) -> tuple[float, float]:
    """Return where a drawn bar begins and ends across the canvas: a clamp needs its own room."""
    left, right = surface.supports or ("free", "free")
    return (
        _CLAMP * (left == "clamped") - _EDGE,
        _EDGE - _CLAMP * (right == "clamped"),
    )


@dataclass(frozen=True, kw_only=True)
class _Line:
    """The line on the canvas along which places of a surface lie, from 0 to `length_m`.

    `room` holds everything on it: the canvas, or a picture. `up` is 1, or -1 if there is more room
    on the line's other side.
    """

    begin: Point
    end: Point
    length_m: float
    room: Box
    up: float = 1.0
    level: bool = False
    """Whether it is that of a bar, which lies level on the page's own ground."""

    def at(self, place_m: float, along: float = 0.0, beside: float = 0.0) -> Point:
        """Return the point of a place, moved along the line and off it."""
        across, rise = self.end[0] - self.begin[0], self.end[1] - self.begin[1]
        long = hypot(across, rise)
        unit_x, unit_y = across / long, rise / long
        beside *= self.up
        return (
            self.begin[0] + across * place_m / self.length_m + unit_x * along - unit_y * beside,
            self.begin[1] + rise * place_m / self.length_m + unit_y * along + unit_x * beside,
        )

    def nearest(self, place_m: float) -> Point:
        """Return the point of a place, which a sensor may report beside the surface."""
        x, y = self.at(min(max(place_m, 0.0), self.length_m))
        (left, low), _, (right, high), _ = self.room.corners
        return (min(max(x, left), right), min(max(y, low), high))

    def holds(self, place_m: float) -> bool:
        return 0 <= place_m <= self.length_m and self.room.holds(*self.at(place_m))


_CANVAS = Box(x=0, y=0, width=CANVAS[0], height=CANVAS[1])


def _line(surface: screens.ShownSurface) -> _Line:
    if surface.path_in_picture is None:
        left, right = beam_ends(surface)
        ends = ((left, BEAM_Y), (right, BEAM_Y))
        return _Line(
            begin=ends[0], end=ends[1], length_m=surface.length_m, room=_CANVAS, level=True
        )
    # The picture is as large as its box allows.
    height = min(_SURFACE.height, _SURFACE.width / surface.picture_shape)
    room = Box(x=_SURFACE.x, y=_SURFACE.y, width=height * surface.picture_shape, height=height)
    (left, _), _, (_, top), _ = room.corners
    first, last = (
        (left + across * room.width, top - down * room.height)
        for across, down in surface.path_in_picture
    )
    path_m = surface.path_m
    parts = [(end_m - path_m[0]) / (path_m[1] - path_m[0]) for end_m in (0.0, surface.length_m)]
    begin, end = (
        (first[0] + part * (last[0] - first[0]), first[1] + part * (last[1] - first[1]))
        for part in parts
    )
    middle = ((first[0] + last[0]) / 2, (first[1] + last[1]) / 2)
    across, rise = last[0] - first[0], last[1] - first[1]
    inward = across * (room.y - middle[1]) - rise * (room.x - middle[0])
    up = inward if abs(inward) > 1e-6 else across
    return _Line(
        begin=begin, end=end, length_m=surface.length_m, room=room, up=1.0 if up >= 0 else -1.0
    )


def sketch(way: screens.FingerPath, texts: Mapping[str, str]) -> Page:
    """Return the surface and the touch: an arrow along it, or marks that point at places.

    Nothing is drawn for words alone, and nothing is marked in a picture that does not say where.
    """
    surface = way.surface
    if surface.picture == NO_PICTURE:
        return ()
    drawn = (
        _bar(surface) if surface.picture is None else (Picture(name=surface.picture, box=_SURFACE),)
    )
    marks: list[Page] = []
    if surface.is_marked:
        line = _line(surface)
        marks = [_arrow(way, line)]
        if way.start_m == way.end_m:
            marks = [
                _mark(place_m, line, way.harder) for place_m in _places(way, line, way.start_m)
            ]
    words = _bar_words(surface, texts) if surface.picture is None else ()
    return (*drawn, *chain.from_iterable(marks), *words)


def _bar(surface: screens.ShownSurface) -> Page:
    """Return a bar on its supports: a clamp around its end, or a triangle below it."""
    left, right = beam_ends(surface)
    supports: list[Outline] = []
    for kind, end, outward in zip(surface.supports or (), (left, right), (-1, 1), strict=False):
        if kind == "clamped":
            x = end + outward * _CLAMP / 2
            clamp = Box(x=x, y=BEAM_Y, width=_CLAMP, height=110)
            supports.append(Outline(points=clamp.corners, fill=FAINT))
        elif kind == "pinned":
            low = BEAM_Y - _BEAM_HEIGHT / 2
            points = ((end, low), (end - 18, low - 32), (end + 18, low - 32))
            supports.append(Outline(points=points, fill=FAINT))
    bar = Box(x=(left + right) / 2, y=BEAM_Y, width=right - left, height=_BEAM_HEIGHT)
    return (*supports, Outline(points=bar.corners, fill=PALE, edge=INK))


def _bar_words(surface: screens.ShownSurface, texts: Mapping[str, str]) -> Page:
    """Return what a clamp is, and on which side of the bar the participant sits."""
    left, right = beam_ends(surface)
    clamps = [
        _small(
            texts["beam.clamp"],
            Box(x=end + outward * _CLAMP / 2, y=_LABEL_Y, width=150.0, height=24),
        )
        for kind, end, outward in zip(surface.supports or (), (left, right), (-1, 1), strict=False)
        if kind == "clamped"
    ]
    you = Box(x=(left + right) / 2, y=_LABEL_Y, width=300.0, height=24)
    return (*clamps, _small(texts["beam.you"], you))


def fingers(way: screens.FingerPath, fraction: float) -> tuple[Dot, ...]:
    """Return the pacing marks after `fraction` of the way, from 0 to 1."""
    if not way.surface.is_marked:
        return ()
    position_m = way.start_m + fraction * (way.end_m - way.start_m)
    line = _line(way.surface)
    points = map(line.at, _places(way, line, position_m))
    return tuple(dot for at in points for dot in _dots(at, _FINGER_RADIUS, ACCENT, line))


def _places(way: screens.FingerPath, line: _Line, position_m: float) -> list[float]:
    """Return the positions of the fingers; of several, only those on the surface.

    On a surface that is shorter than several fingers they rest evenly along it.
    """
    if not way.several:
        return [position_m]
    closer = min(line.length_m / _SEVERAL_M, 1.0)
    if closer < 1 and way.start_m == way.end_m:
        position_m = line.length_m / 2
    places = [position_m + closer * beside_m for beside_m in BESIDE_M]
    return [place_m for place_m in places if line.holds(place_m)]


def _arrow(way: screens.FingerPath, line: _Line) -> Page:
    """Return an arrow beside a bar, or on the path in a picture, which has no room beside it."""
    # A slender head points clearly whichever way it is turned.
    beside, long, wide = (_ARROW_Y, _HEAD, _HEAD) if line.level else (0.0, 28.0, 14.0)
    back = -long if way.end_m > way.start_m else long
    base = line.at(way.end_m, back, beside)
    head = (
        line.at(way.end_m, 0.0, beside),
        line.at(way.end_m, back, beside + wide),
        line.at(way.end_m, back, beside - wide),
    )
    stop = (line.at(way.start_m, 0.0, beside - 14), line.at(way.start_m, 0.0, beside + 14))
    strokes = ((line.at(way.start_m, 0.0, beside), base), stop)
    return _drawn(strokes, [head], line)


def _mark(place_m: float, line: _Line, harder: bool) -> Page:
    """Return the mark of a place to touch: one tip points at it, two mean to press harder."""
    wide = 17.0 if line.level else 10.0
    tips = [
        (
            line.at(place_m, 0.0, beside),
            line.at(place_m, wide, beside + 26),
            line.at(place_m, -wide, beside + 26),
        )
        for beside in (26.0, 56.0)[: 1 + harder]
    ]
    return _drawn([(line.at(place_m, 0.0, -17.0), line.at(place_m, 0.0, 17.0))], tips, line)


def _drawn(
    strokes: Sequence[tuple[Point, ...]], shapes: Sequence[tuple[Point, ...]], line: _Line
) -> Page:
    """Return strokes and filled shapes; in a picture with a pale rim, whatever its colours."""
    rims = [(strokes, 6 + 2 * _RIM), (shapes, 2 * _RIM)] if not line.level else []
    return (
        *(Outline(points=at, edge=WHITE, width=wide) for those, wide in rims for at in those),
        *(Outline(points=points, edge=ACCENT, width=6) for points in strokes),
        *(Outline(points=points, fill=ACCENT) for points in shapes),
    )


def _dots(point: Point, radius: float, fill: str, line: _Line) -> tuple[Dot, ...]:
    x, y = point
    rim = () if line.level else (Dot(x=x, y=y, radius=radius + _RIM, fill=WHITE),)
    return (*rim, Dot(x=x, y=y, radius=radius, fill=fill))


_OWN_RADIUS = 9.0
_BAR = Box(x=20, y=-196, width=360, height=26)
_LABEL = Box(x=20, y=-228, width=380, height=26)
_LONGEST = 2.0
"""Force at the bar's right end, relative to the instructed one."""


def own_finger(
    finger: screens.OwnFinger, surface: screens.ShownSurface, texts: Mapping[str, str]
) -> Page:
    """Return a bar with the range in which the finger's force should be, and a dot at its place."""
    low, high = (_bar_x(1 + sign * finger.within) for sign in (-1, 1))
    wanted = Box(x=(low + high) / 2, y=_BAR.y, width=high - low, height=_BAR.height)
    force = (
        Outline(points=_BAR.corners, fill=WHITE, edge=INK),
        Outline(points=wanted.corners, fill=PALE, edge=ACCENT),
        Text(text=texts["own.finger"], box=_LABEL, size=Size.SMALL),
        Dot(x=_bar_x(finger.force), y=_BAR.y, radius=_OWN_RADIUS, fill=INK),
    )
    if not surface.is_marked:
        return force
    line = _line(surface)
    return (*force, *_dots(line.nearest(finger.position_m), _OWN_RADIUS, INK, line))


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
    text = screen.touch.surface.text(screen.text, texts) if screen.touch else texts[screen.text]
    return (Text(text=text, box=box, size=size), *drawn, *parts.button("button.ready", view, texts))


def _touch(
    screen: screens.LeadIn | screens.Pacing, view: parts.PageState, texts: Mapping[str, str]
) -> Page:
    """Return the page whose mark rests, then moves; it hides how long to hold a place."""
    surface = screen.surface
    title = Text(text=surface.text(screen.text, texts), box=parts.TITLE, size=Size.TITLE)
    own = () if view.finger is None else own_finger(view.finger, surface, texts)
    beam = (title, *sketch(screen, texts))
    if isinstance(screen, screens.LeadIn):
        return (*beam, *fingers(screen, 0.0), *_lead_in(screen, view, texts), *own)
    # The mark stays at its end until the session shows the next page.
    marks = fingers(screen, min(view.passed_s / screen.duration_s, 1.0))
    return (*beam, *marks, Text(text=texts["touch.now"], box=_BELOW_BEAM, size=Size.NOW), *own)


def _lead_in(screen: screens.LeadIn, view: parts.PageState, texts: Mapping[str, str]) -> Page:
    """Return what to do until the mark moves, and the countdown in three equal steps."""
    soon = screen.surface.text("touch.soon.full" if screen.several else "touch.soon", texts)
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
