"""Drawings on the canvas: the rating scale, the beam and the touch."""

from itertools import pairwise

from device.beam.beam import Beam
from protocol.study.questions import Band, Rating
from protocol.study.texts import Wording, band_name
from runner.screens import FingerPath
from runner.window.elements import ACCENT, FAINT, INK, PALE, Box, Dot, Element, Outline, Page, Text
from runner.window.text_layout import text_width

_SCALE_LENGTH = 660.0
MOST_STEPS = int(_SCALE_LENGTH)
"""Of a scale: on the smallest screen each score has a pixel of its own."""
_BESIDE = 33.0
"""What lies beside the ends of the scale belongs to it."""
_LABEL_GAP = 12.0
_LINE_Y = 50.0
_BRACKET_Y = -12.0
LABEL_SIZE = 24.0
BAND_SIZE = 18.0


def score_x(score: float, rating: Rating) -> float:
    """Return where a score lies across the canvas; the scale is centred."""
    return (score - (rating.minimum + rating.maximum) / 2) * _step(rating)


def score_at(x: float, rating: Rating) -> float:
    """Return the place `x` in units of the scale, not rounded, within its ends."""
    place = x / _step(rating) + (rating.minimum + rating.maximum) / 2
    return min(max(place, rating.minimum), rating.maximum)


def _step(rating: Rating) -> float:
    return _SCALE_LENGTH / rating.span


SCALE_BOX = Box(x=0, y=_LINE_Y - 12, width=_SCALE_LENGTH + 2 * _BESIDE, height=90)
"""Where a press chooses a score."""


def scale(rating: Rating, wording: Wording, chosen: int | None) -> tuple[Element, ...]:
    """Return the scale with its bands; it bears no mark until one is chosen."""
    ends = [score_x(end, rating) for end in (rating.minimum, rating.maximum)]
    line = Outline(
        points=((ends[0], _LINE_Y), (ends[1], _LINE_Y)),
        edge=INK,
        width=3,
    )
    mark = () if chosen is None else (Dot(x=score_x(chosen, rating), y=_LINE_Y, radius=15.0),)
    ticks = [_tick(score, rating) for score in marked(rating)]
    labels = [_label(score, rating) for score in labelled(rating)]
    bands = [element for band in rating.bands for element in _band(band, rating, wording)]
    return (line, *ticks, *labels, *bands, *mark)


def marked(rating: Rating) -> list[int]:
    """Return the scores that have a tick, as the study asks; all can be chosen.

    Where all are asked for and there are too many, they are those that a round number divides.
    """
    scores = {rating.minimum, rating.maximum}
    if rating.ticks == "all":
        whole = range(rating.minimum, rating.maximum + 1)
        scores |= {score for score in whole if score % _round_step(rating) == 0}
    elif rating.ticks == "bands":
        scores |= {end for band in rating.bands for end in (band.first, band.last)}
    return sorted(scores)


def _round_step(rating: Rating) -> int:
    """The least of 1, 2, 5, 10, 20, … scores that are as far apart as their numbers need."""
    rounds: list[int] = [first * 10**zeros for zeros in range(4) for first in (1, 2, 5)]
    return next(step for step in rounds if step * _step(rating) >= _label_room(rating))


def _label_room(rating: Rating) -> float:
    return text_width(str(rating.maximum), LABEL_SIZE) + _LABEL_GAP


def labelled(rating: Rating) -> list[int]:
    """Return the marked scores that have a number: the ends, and what has room between them."""
    first, *between, last = marked(rating)
    room, shown = _label_room(rating) / _step(rating), [first]
    for score in between:
        if min(score - shown[-1], last - score) >= room:
            shown.append(score)
    return [*shown, last]


def look(rating: Rating, wording: Wording, px_per_unit: float) -> dict[str, object]:
    """Return how the scale looks on a screen, for the journal."""
    length = score_x(rating.maximum, rating) - score_x(rating.minimum, rating)
    return {
        "ticks": marked(rating),
        "labels": [str(score) for score in labelled(rating)],
        "bands": [[band.first, band.last, band_name(band, wording)] for band in rating.bands],
        "length_px": round(length * px_per_unit, 1),
    }


def _tick(score: int, rating: Rating) -> Outline:
    x = score_x(score, rating)
    return Outline(points=((x, _LINE_Y - 10), (x, _LINE_Y + 10)), edge=INK, width=3)


def _label(score: int, rating: Rating) -> Text:
    x, width = score_x(score, rating), _label_room(rating) - 2
    box = Box(x=x, y=_LINE_Y - 34, width=width, height=34)
    return Text(text=str(score), box=box, size=LABEL_SIZE)


def _band(band: Band, rating: Rating, wording: Wording) -> tuple[Element, ...]:
    half = _step(rating) / 2
    gap = min(4.0, half / 4)
    left = score_x(band.first, rating) - half + gap
    right = score_x(band.last, rating) + half - gap
    box = Box(x=(left + right) / 2, y=_BRACKET_Y - 38, width=right - left, height=62)
    corners = ((left, _BRACKET_Y + 6), (left, _BRACKET_Y), (right, _BRACKET_Y))
    bracket = (*corners, (right, _BRACKET_Y + 6))
    sides = pairwise(bracket)
    return (
        *(Outline(points=side, edge=FAINT) for side in sides),
        Text(text=band_name(band, wording) or "", box=box, size=BAND_SIZE),
    )


BEAM_M = Beam().length_m
_LEFT, _LENGTH = -300.0, 600.0
_BEAM_Y, _BEAM_HEIGHT = 0.0, 34.0
_ARROW_Y = 52.0
_HEAD = 16.0
_FINGER_RADIUS = 24.0

BESIDE_M = (-0.024, -0.008, 0.008, 0.024)
"""Positions of several fingers relative to their centre."""


def beam_x(position_m: float) -> float:
    """Return where a place on the beam lies across the canvas; the clamp is on the left."""
    return _LEFT + _LENGTH * position_m / BEAM_M


def sketch(way: FingerPath) -> Page:
    """Return the beam and the touch: an arrow along it, or marks that point at places."""
    if way.start_m != way.end_m:
        return (*_beam(), *_arrow(way))
    marks = [mark for place_m in _places(way, way.start_m) for mark in _mark(place_m, way.harder)]
    return (*_beam(), *marks)


def fingers(way: FingerPath, fraction: float) -> tuple[Dot, ...]:
    """Return the pacing marks after `fraction` of the way, from 0 to 1."""
    position_m = way.start_m + fraction * (way.end_m - way.start_m)
    return tuple(
        Dot(x=beam_x(place_m), y=_BEAM_Y, radius=_FINGER_RADIUS)
        for place_m in _places(way, position_m)
    )


def _places(way: FingerPath, position_m: float) -> list[float]:
    """Return the positions of the fingers; of several, only those on the beam."""
    if not way.several:
        return [position_m]
    places = [position_m + beside_m for beside_m in BESIDE_M]
    return [place_m for place_m in places if 0 <= place_m <= BEAM_M]


def _beam() -> Page:
    clamp = Box(x=_LEFT - 20, y=_BEAM_Y, width=40, height=110)
    beam = Box(x=_LEFT + _LENGTH / 2, y=_BEAM_Y, width=_LENGTH, height=_BEAM_HEIGHT)
    return (
        Outline(points=clamp.corners, fill=FAINT),
        Outline(points=beam.corners, fill=PALE, edge=INK),
    )


def _arrow(way: FingerPath) -> Page:
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
    place = Outline(points=((x, _BEAM_Y - 17), (x, _BEAM_Y + 17)), edge=ACCENT, width=6)
    heights = (26.0, 56.0) if harder else (26.0,)
    return (place, *(_tip(x, height) for height in heights))


def _tip(x: float, height: float) -> Outline:
    points = ((x, height), (x + 17, height + 26), (x - 17, height + 26))
    return Outline(points=points, fill=ACCENT)
