"""The participant's own finger on the page of a touch: where it is, and how hard it presses."""

from collections.abc import Mapping

from runner.screens import OwnFinger
from runner.window.beam_sketch import BEAM_M, BEAM_Y, beam_x
from runner.window.elements import ACCENT, INK, PALE, WHITE, Box, Dot, Outline, Page, Text

TEXT_SIZE = 18.0
_OWN_RADIUS = 9.0
_BAR = Box(x=20, y=-196, width=360, height=26)
_LABEL = Box(x=20, y=-228, width=380, height=26)
_LONGEST = 2.0
"""Force at the bar's right end, relative to the instructed one."""


def own_finger(finger: OwnFinger, texts: Mapping[str, str]) -> Page:
    """Return a dot at the finger's place, and a bar with the range in which its force should be."""
    low, high = (_bar_x(1 + sign * finger.within) for sign in (-1, 1))
    wanted = Box(x=(low + high) / 2, y=_BAR.y, width=high - low, height=_BAR.height)
    place_m = min(max(finger.position_m, 0.0), BEAM_M)
    return (
        Outline(points=_BAR.corners, fill=WHITE, edge=INK),
        Outline(points=wanted.corners, fill=PALE, edge=ACCENT),
        Text(text=texts["own.finger"], box=_LABEL, size=TEXT_SIZE),
        Dot(x=_bar_x(finger.force), y=_BAR.y, radius=_OWN_RADIUS, fill=INK),
        Dot(x=beam_x(place_m), y=BEAM_Y, radius=_OWN_RADIUS, fill=INK),
    )


def _bar_x(force: float) -> float:
    share = min(max(force, 0.0), _LONGEST) / _LONGEST
    return _BAR.x + (share - 0.5) * _BAR.width
