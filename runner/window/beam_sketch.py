"""The sketch of the beam with the touch to make, and the marks that pace it."""

from collections.abc import Mapping

from device.beam.beam import Beam
from runner.screens import FingerPath
from runner.window.elements import ACCENT, FAINT, INK, PALE, Box, Dot, Outline, Page, Text

BEAM_M = Beam().length_m
_LEFT, _LENGTH = -280.0, 600.0
BEAM_Y, _BEAM_HEIGHT = 0.0, 34.0
_ARROW_Y = 52.0
_LABEL_Y = -70.0
LABEL_SIZE = 18.0
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


def labels(texts: Mapping[str, str]) -> Page:
    """Return what the clamp is, and on which side of the beam the participant sits."""
    places = (("beam.clamp", _LEFT - 20, 150.0), ("beam.you", _LEFT + _LENGTH / 2, 300.0))
    return tuple(
        Text(
            text=texts[key],
            box=Box(x=x, y=_LABEL_Y, width=width, height=24),
            size=LABEL_SIZE,
            colour=FAINT,
        )
        for key, x, width in places
    )


def fingers(way: FingerPath, fraction: float) -> tuple[Dot, ...]:
    """Return the pacing marks after `fraction` of the way, from 0 to 1."""
    position_m = way.start_m + fraction * (way.end_m - way.start_m)
    return tuple(
        Dot(x=beam_x(place_m), y=BEAM_Y, radius=_FINGER_RADIUS)
        for place_m in _places(way, position_m)
    )


def _places(way: FingerPath, position_m: float) -> list[float]:
    """Return the positions of the fingers; of several, only those on the beam."""
    if not way.several:
        return [position_m]
    places = [position_m + beside_m for beside_m in BESIDE_M]
    return [place_m for place_m in places if 0 <= place_m <= BEAM_M]


def _beam() -> Page:
    clamp = Box(x=_LEFT - 20, y=BEAM_Y, width=40, height=110)
    beam = Box(x=_LEFT + _LENGTH / 2, y=BEAM_Y, width=_LENGTH, height=_BEAM_HEIGHT)
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
    place = Outline(points=((x, BEAM_Y - 17), (x, BEAM_Y + 17)), edge=ACCENT, width=6)
    tips = [((x, y), (x + 17, y + 26), (x - 17, y + 26)) for y in (26.0, 56.0)[: 1 + harder]]
    return (place, *(Outline(points=points, fill=ACCENT) for points in tips))
