"""The parts that pages have in common: title, hint, answers, and the button in its states."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

from runner.screens import OwnFinger
from runner.window.elements import ACCENT, FAINT, INK, PALE, WHITE, Box, Outline, Page, Text

TITLE_SIZE, ANSWER_SIZE, BUTTON_SIZE, HINT_SIZE = 30.0, 26.0, 24.0, 22.0
TITLE = Box(x=0, y=200, width=720, height=130)
MIDDLE = Box(x=0, y=90, width=640, height=300)
HINT = Box(x=0, y=-126, width=740, height=84)  # three lines, clear of the buttons
BUTTON = Box(x=0, y=-208, width=320, height=66)
_NUMBER_X, _NUMBER_WIDTH, _BESIDE_WORDS = 35.0, 60.0, 135.0

Button = Literal["early", "live", "pressed", "saved"]


@dataclass(frozen=True, kw_only=True)
class PageState:
    """State of a page that changes while its screen is shown.

    The button is `early` until the page has been readable for long enough, `live` until it is
    pressed, then `pressed`, and `saved` once the journal has the answer. What is `typed` may not be
    an answer yet.
    """

    chosen: str | None = None
    typed: str = ""
    button: Button = "live"
    passed_s: float = 0.0
    operator_called: bool = False
    progress: tuple[int, int] | None = None
    finger: OwnFinger | None = None


def hint(text: str, box: Box) -> Text:
    """Return a text that helps."""
    return Text(text=text, box=box, size=HINT_SIZE, colour=FAINT)


def answer_box(
    number: str, text: str, box: Box, *, chosen: bool, size: float = ANSWER_SIZE
) -> Page:
    """Return an answer to press, with its number in a column of its own."""
    fill, colour = (ACCENT, WHITE) if chosen else (WHITE, INK)
    column = replace(box, x=box.x - box.width / 2 + _NUMBER_X, width=_NUMBER_WIDTH)
    words = replace(box, width=box.width - _BESIDE_WORDS)
    return (
        Outline(points=box.corners, fill=fill, edge=ACCENT, width=3),
        Text(text=number, box=column, size=size, colour=colour),
        Text(text=text, box=words, size=size, colour=colour),
    )


def button(label: str, view: PageState, texts: Mapping[str, str], *, usable: bool = True) -> Page:
    """Return the button, grey unless a press on it counts."""
    fill, colour = (ACCENT, WHITE) if usable and view.button == "live" else (PALE, FAINT)
    text = texts["saved" if view.button == "saved" else label]
    return (
        Outline(points=BUTTON.corners, fill=fill),
        Text(text=text, box=BUTTON, size=BUTTON_SIZE, colour=colour),
    )
