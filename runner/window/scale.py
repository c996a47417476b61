"""The rating scale on the canvas: where each score lies, how it looks, and how that is logged."""

from itertools import pairwise

from protocol.study import Band, Rating
from protocol.texts import Language
from runner.window.elements import FAINT, INK, Dot, Element, Outline, Room, Text

_STEP = 66.0
_LINE_Y = 50.0
_BRACKET_Y = -12.0
LABEL_SIZE = 24.0
BAND_SIZE = 18.0


def score_x(score: float, rating: Rating) -> float:
    """Return where a score lies across the canvas; the scale is centred."""
    return (score - (rating.minimum + rating.maximum) / 2) * _STEP


def score_at(x: float, rating: Rating) -> float:
    """Return the place `x` in units of the scale, not rounded, within its ends."""
    place = x / _STEP + (rating.minimum + rating.maximum) / 2
    return min(max(place, rating.minimum), rating.maximum)


def scale_room(rating: Rating) -> Room:
    """Return where a press chooses a score."""
    width = (rating.maximum - rating.minimum + 1) * _STEP
    return Room(x=0, y=_LINE_Y - 12, width=width, height=90)


def scale(rating: Rating, language: Language, chosen: int | None) -> tuple[Element, ...]:
    """Return the scale with its four bands; it bears no mark until one is chosen."""
    ends = [score_x(end, rating) for end in (rating.minimum, rating.maximum)]
    line = Outline(
        points=((ends[0], _LINE_Y), (ends[1], _LINE_Y)),
        edge=INK,
        width=3,
    )
    mark = () if chosen is None else (Dot(x=score_x(chosen, rating), y=_LINE_Y, radius=15.0),)
    ticks = [element for score in marked(rating) for element in _tick(score, rating)]
    bands = [element for band in rating.bands for element in _band(band, rating, language)]
    return (line, *ticks, *bands, *mark)


def marked(rating: Rating) -> list[int]:
    """Return the scores that have a tick and a number, as the study asks; all can be chosen."""
    if rating.ticks == "all":
        return list(range(rating.minimum, rating.maximum + 1))
    ends = {rating.minimum, rating.maximum}
    if rating.ticks == "bands":
        ends |= {end for band in rating.bands for end in (band.first, band.last)}
    return sorted(ends)


def look(rating: Rating, language: Language, px_per_unit: float) -> dict[str, object]:
    """Return how the scale looks on a screen, for the journal."""
    length = score_x(rating.maximum, rating) - score_x(rating.minimum, rating)
    return {
        "ticks": marked(rating),
        "labels": [str(score) for score in marked(rating)],
        "bands": [[band.first, band.last, getattr(band, language)] for band in rating.bands],
        "length_px": round(length * px_per_unit, 1),
    }


def _tick(score: int, rating: Rating) -> tuple[Element, ...]:
    x = score_x(score, rating)
    room = Room(x=x, y=_LINE_Y - 34, width=_STEP - 4, height=34)
    return (
        Outline(points=((x, _LINE_Y - 10), (x, _LINE_Y + 10)), edge=INK, width=3),
        Text(text=str(score), room=room, size=LABEL_SIZE),
    )


def _band(band: Band, rating: Rating, language: Language) -> tuple[Element, ...]:
    left = score_x(band.first, rating) - _STEP / 2 + 4
    right = score_x(band.last, rating) + _STEP / 2 - 4
    room = Room(x=(left + right) / 2, y=_BRACKET_Y - 38, width=right - left, height=62)
    corners = ((left, _BRACKET_Y + 6), (left, _BRACKET_Y), (right, _BRACKET_Y))
    bracket = (*corners, (right, _BRACKET_Y + 6))
    sides = pairwise(bracket)
    return (
        *(Outline(points=side, edge=FAINT) for side in sides),
        Text(text=getattr(band, language), room=room, size=BAND_SIZE),
    )
