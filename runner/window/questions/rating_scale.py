"""A scale: its drawing, and which of its places a point means."""

from collections.abc import Sequence
from itertools import count, pairwise

from protocol.study.participant_texts import Wording, band_name, label_text
from protocol.study.rating import Band
from protocol.study.study_question import Label, StudyQuestion
from runner.window.elements import ACCENT, CANVAS, FAINT, INK, Box, Dot, Element, Outline, Text
from runner.window.text_layout import text_width

_SCALE_LENGTH = 660.0
MOST_STEPS = int(_SCALE_LENGTH)
"""Of a scale: on the smallest screen each place has a pixel of its own."""
_BESIDE = 33.0
"""What lies beside the ends of the scale belongs to it."""
_LABEL_GAP = 12.0
_TICK_GAP = 12.0
"""Ticks at least as far apart can be told apart."""
_LINE_Y = 50.0
_BRACKET_Y = -12.0
LABEL_SIZE = 24.0
CHOSEN_SIZE = 36.0
NAME_SIZE, BAND_SIZE = 20.0, 18.0
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
) -> tuple[Element, ...]:
    """Return the scale with its labels or bands; it bears no mark until one is chosen."""
    line = Outline(
        points=((-_SCALE_LENGTH / 2, _LINE_Y), (_SCALE_LENGTH / 2, _LINE_Y)), edge=INK, width=3
    )
    mark = () if chosen is None else _mark(chosen, question)
    ticks = [
        Outline(points=((x, _LINE_Y - 10), (x, _LINE_Y + 10)), edge=INK, width=3)
        for x in (score_x(place, question) for place in marked(question, bands))
    ]
    numbers = [_number(place, question) for place in labelled(question, bands)]
    names = [_name(label, question, wording) for label in question.labels]
    brackets = [element for band in bands for element in _band(band, question, wording)]
    return (line, *ticks, *numbers, *names, *brackets, *mark)


def _mark(chosen: float, question: StudyQuestion) -> tuple[Element, ...]:
    """Return the mark at the chosen place and, of a scale with numbers, its number in large."""
    x = score_x(chosen, question)
    dot = Dot(x=x, y=_LINE_Y, radius=15.0)
    if question.kind == "analogue":
        return (dot,)
    box = Box(x=x, y=_LINE_Y + 44, width=100, height=46)
    return (dot, Text(text=_shown(chosen), box=box, size=CHOSEN_SIZE, colour=ACCENT))


def marked(question: StudyQuestion, bands: Sequence[Band] = ()) -> list[int | float]:
    """Return the places that have a tick, as the study asks; all can be chosen.

    Where all are asked for and there are too many, they are those that have a number.
    """
    low, _, step = question.scale
    ends = {0, question.places}
    if question.kind == "analogue":
        pass
    elif question.ticks == "all":
        has_room = _unit(question) * step >= _TICK_GAP
        ends |= set(range(question.places)) if has_room else _round_steps(question)
    elif question.ticks == "labels":
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
    return max(text_width(_shown(end), LABEL_SIZE) for end in ends) + _LABEL_GAP


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
        if min(place - shown[-1], last - place) >= room:
            shown.append(place)
    return [*shown, last]


def look(
    question: StudyQuestion, bands: Sequence[Band], wording: Wording, px_per_unit: float
) -> dict[str, object]:
    """Return how the scale looks on a screen, for the journal."""
    return {
        "ticks": marked(question, bands),
        "labels": [_shown(place) for place in labelled(question, bands)],
        "bands": [[band.first, band.last, band_name(band, wording)] for band in bands],
        "length_px": round(_SCALE_LENGTH * px_per_unit, 1),
    }


def _shown(place: float) -> str:
    return f"{place:.10g}"


def _number(place: float, question: StudyQuestion) -> Text:
    x, width = score_x(place, question), _room(question) - 2
    box = Box(x=x, y=_LINE_Y - 34, width=width, height=34)
    return Text(text=_shown(place), box=box, size=LABEL_SIZE)


def _name(label: Label, question: StudyQuestion, wording: Wording) -> Text:
    """Return the name of a place below it, as wide as its neighbours and the canvas allow."""
    x = score_x(label.at or 0.0, question)
    others = [score_x(other.at or 0.0, question) for other in question.labels if other != label]
    width = min([_WIDEST_NAME, *(abs(other - x) - 4 for other in others)])
    edge = CANVAS[0] / 2 - 4 - width / 2
    below = 50.0 if question.kind == "analogue" else 86.0  # the numbers are between
    box = Box(x=min(max(x, -edge), edge), y=_LINE_Y - below, width=width, height=62)
    return Text(text=label_text(label, wording), box=box, size=NAME_SIZE)


def _band(band: Band, question: StudyQuestion, wording: Wording) -> tuple[Element, ...]:
    half = _unit(question) / 2
    gap = min(4.0, half / 4)
    left = score_x(band.first, question) - half + gap
    right = score_x(band.last, question) + half - gap
    box = Box(x=(left + right) / 2, y=_BRACKET_Y - 38, width=right - left, height=62)
    corners = [(left, _BRACKET_Y + 6), (left, _BRACKET_Y), (right, _BRACKET_Y)]
    bracket = [*corners, (right, _BRACKET_Y + 6)]
    return (
        *(Outline(points=side, edge=FAINT) for side in pairwise(bracket)),
        Text(text=band_name(band, wording) or "", box=box, size=BAND_SIZE),
    )
