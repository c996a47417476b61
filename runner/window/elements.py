"""Elements of a page and inputs, in units of a canvas of 800 by 600 with its origin in the centre.

The canvas is scaled to the screen as a whole, so that a page looks the same on every screen.
"""

from dataclasses import dataclass
from typing import Literal

CANVAS = (800.0, 600.0)

INK = "#202428"
FAINT = "#5c646c"
ACCENT = "#1f5fa8"
PALE = "#d5dae0"
WHITE = "#ffffff"
BACKGROUND = "#f4f4f0"

Point = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Box:
    """A rectangle centred at (`x`, `y`); `y` points up."""

    x: float
    y: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        """Return whether the point lies inside."""
        return abs(x - self.x) <= self.width / 2 and abs(y - self.y) <= self.height / 2

    @property
    def corners(self) -> tuple[Point, ...]:
        """The four corners, in order."""
        right, top = self.width / 2, self.height / 2
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return tuple((self.x + sx * right, self.y + sy * top) for sx, sy in signs)


@dataclass(frozen=True, kw_only=True)
class Text:
    """Text centred in `box`; `size` is the length of an em."""

    text: str
    box: Box
    size: float
    colour: str = INK


@dataclass(frozen=True, kw_only=True)
class Outline:
    """A polygon, or a line if it has two points."""

    points: tuple[Point, ...]
    fill: str | None = None
    edge: str | None = None
    width: float = 2.0


@dataclass(frozen=True, kw_only=True)
class Dot:
    """A disc; the only element that moves from frame to frame."""

    x: float
    y: float
    radius: float
    fill: str = ACCENT


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A picture, as large as `box` allows; `name` is a file in the study's folder."""

    name: str
    box: Box


Element = Text | Outline | Dot | Picture


Page = tuple[Element, ...]
"""The elements on the screen at one moment, in drawing order."""


@dataclass(frozen=True, kw_only=True)
class Target:
    """An area that reacts to a press: an answer or a key, a scale, or a button."""

    name: str
    box: Box
    role: Literal["answer", "scale", "button", "call"] = "answer"


def pixels_per_unit(width_px: float, height_px: float) -> float:
    """Return the factor that scales the canvas to a screen.

    >>> pixels_per_unit(1920, 1080)
    1.8
    """
    return min(width_px / CANVAS[0], height_px / CANVAS[1])


@dataclass(frozen=True, kw_only=True)
class Pressed:
    """A mouse button or a fingertip goes down."""

    x: float
    y: float


@dataclass(frozen=True, kw_only=True)
class Dragged:
    """The pointer moves while it is down."""

    x: float
    y: float


@dataclass(frozen=True, kw_only=True)
class Released:
    """The pointer goes up."""


@dataclass(frozen=True, kw_only=True)
class Key:
    """A key goes down: a digit, `-`, `.`, left, right, up, down, enter, backspace or escape."""

    name: str


@dataclass(frozen=True, kw_only=True)
class Typed:
    """Text from the keyboard, as the system composes it; a key that makes it also goes down."""

    text: str


Input = Pressed | Dragged | Released | Key | Typed
