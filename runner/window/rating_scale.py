"""The rating scale: its drawing, and which score a place on it means."""

from itertools import pairwise

from protocol.study.participant_texts import Wording, band_name
from protocol.study.rating import Band, Rating
from runner.window.elements import ACCENT, FAINT, INK, Box, Dot, Element, Outline, Text
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
CHOSEN_SIZE = 36.0
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
    line = Outline(points=((ends[0], _LINE_Y), (ends[1], _LINE_Y)), edge=INK, width=3)
    mark = () if chosen is None else _mark(chosen, rating)
    ticks = [
        Outline(points=((x, _LINE_Y - 10), (x, _LINE_Y + 10)), edge=INK, width=3)
        for x in (score_x(score, rating) for score in marked(rating))
    ]
    labels = [_label(score, rating) for score in labelled(rating)]
    bands = [element for band in rating.bands for element in _band(band, rating, wording)]
    return (line, *ticks, *labels, *bands, *mark)


def _mark(chosen: int, rating: Rating) -> tuple[Element, ...]:
    """Return the mark at the chosen score, and its number in large."""
    x = score_x(chosen, rating)
    box = Box(x=x, y=_LINE_Y + 44, width=100, height=46)
    number = Text(text=str(chosen), box=box, size=CHOSEN_SIZE, colour=ACCENT)
    return (Dot(x=x, y=_LINE_Y, radius=15.0), number)


def marked(rating: Rating) -> list[int]:
    """Return the scores that have a tick, as the study asks; all can be chosen.

    Where all are asked for and there are too many, they are those that a round number divides.
    """
    scores = {rating.minimum, rating.maximum}
    if rating.ticks == "all":
        # The least of 1, 2, 5, 10, 20, … scores that are as far apart as their numbers need.
        rounds = (first * 10**zeros for zeros in range(4) for first in (1, 2, 5))
        apart = next(step for step in rounds if step * _step(rating) >= _label_room(rating))
        whole = range(rating.minimum, rating.maximum + 1)
        scores |= {score for score in whole if score % apart == 0}
    elif rating.ticks == "bands":
        scores |= {end for band in rating.bands for end in (band.first, band.last)}
    return sorted(scores)


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
    corners = [(left, _BRACKET_Y + 6), (left, _BRACKET_Y), (right, _BRACKET_Y)]
    bracket = [*corners, (right, _BRACKET_Y + 6)]
    return (
        *(Outline(points=side, edge=FAINT) for side in pairwise(bracket)),
        Text(text=band_name(band, wording) or "", box=box, size=BAND_SIZE),
    )
