"""Elements of a page and inputs, in units of a canvas of 800 by 600 with its origin in the centre.

The canvas is scaled to the screen as a whole, so that a page looks the same on every screen.
"""

import unicodedata
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import pairwise
from typing import Literal

CANVAS = (800.0, 600.0)

INK, FAINT, ACCENT = "#202428", "#5c646c", "#1f5fa8"
PALE, WHITE, BACKGROUND = "#d5dae0", "#ffffff", "#f4f4f0"


class Size:
    """Of text, by where it stands: the length of an em, in units of the canvas."""

    TITLE, PAGE, NOW, COUNT = 30.0, 23.0, 23.0, 46.0
    BUTTON, HINT, SMALL, BANNER, INTERVAL = 24.0, 22.0, 18.0, 20.0, 20.0
    ANSWER, SMALL_ANSWER, ENTRY, KEY = 26.0, 20.0, 24.0, 22.0
    LABEL, CHOSEN, NAME, BAND = 24.0, 36.0, 20.0, 18.0


Point = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Box:
    """A rectangle centred at (`x`, `y`); `y` points up."""

    x: float
    y: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        return abs(x - self.x) <= self.width / 2 and abs(y - self.y) <= self.height / 2

    @property
    def corners(self) -> tuple[Point, ...]:
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


def framed(text: Text, fill: str, edge: str | None = None) -> Page:
    """Return `text` on its box, which is filled and may have an edge."""
    return (Outline(points=text.box.corners, fill=fill, edge=edge), text)


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


def on_canvas(x: float, y: float, size: tuple[float, float]) -> Point:
    """Return the point of the canvas at a point of the window, whose origin is at the bottom left.

    The `size` of the window has the unit of the point, whichever that is.

    >>> on_canvas(960, 1080, (1920, 1080)), on_canvas(480, 540, (960, 540))
    ((0.0, 300.0), (0.0, 300.0))
    """
    scale = pixels_per_unit(*size)
    return ((x - size[0] / 2) / scale, (y - size[1] / 2) / scale)


def in_window(x: float, y: float, size: tuple[float, float]) -> Point:
    """Return the point of the window at a point of the canvas, in the unit of its `size`."""
    scale = pixels_per_unit(*size)
    return (size[0] / 2 + x * scale, size[1] / 2 + y * scale)


@dataclass(frozen=True, kw_only=True)
class Pressed:
    """The left mouse button or a fingertip goes down."""

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
    """A key goes down: a digit, `-`, `.`, left, right, up, down, enter, backspace or escape.

    It goes down once and is then `repeated` while it is held.
    """

    name: str
    repeated: bool = False


STOP = Key(name="emergency stop")
"""Ctrl-E, which goes to the session and to no page."""


@dataclass(frozen=True, kw_only=True)
class Typed:
    """Text from the keyboard, as the system composes it; a key that makes it also goes down."""

    text: str
    repeated: bool = False


Input = Pressed | Dragged | Released | Key | Typed

# Text layout without a screen, from upper bounds on the size of text.
#
# A Latin letter counts with its advance in DejaVu Sans, which is wider than its substitute fonts;
# an East Asian character is as wide as high. The same lines are measured and drawn, so a text
# that fits here fits on the screen.

LINE_HEIGHT = 1.25
"""Distance of two lines, in ems."""

ROUNDING = 1.04
"""Letters are drawn at whole pixels; at 16 pixels that widens a line by up to this factor."""

_FIRST = 32
# fmt: off
_ADVANCES = (
    318, 401, 460, 838, 636, 950, 780, 275, 390, 390, 500, 838, 318, 361, 318, 337,  # space to /
    636, 636, 636, 636, 636, 636, 636, 636, 636, 636, 337, 337, 838, 838, 838, 531,  # 0 to ?
    1000, 684, 686, 698, 770, 632, 575, 775, 752, 295, 295, 656, 557, 863, 748, 787,  # @ to O
    603, 787, 695, 635, 611, 732, 684, 989, 685, 611, 685, 390, 337, 390, 838, 500,  # P to _
    500, 613, 635, 550, 635, 615, 352, 635, 634, 278, 278, 579, 278, 974, 634, 612,  # ` to o
    635, 635, 411, 521, 392, 634, 592, 818, 592, 592, 525, 636, 337, 636, 838,  # p to ~
)
# fmt: on
"""Advance widths of the printable ASCII characters in DejaVu Sans 2.37, thousandths of an em."""

_CLOSING = "，。、；：？！）”’,.;:?!)"
"""Characters that must not begin a line."""


def text_width(text: str, size: float) -> float:
    """Return the largest width of one line of `text`, in the unit of `size`.

    >>> round(text_width("smooth", 20), 1)
    77.9
    >>> round(text_width("光滑", 20), 1)
    41.6
    """
    return _thousandths(text) * size * ROUNDING / 1000


def text_height(lines: int, size: float) -> float:
    return lines * size * LINE_HEIGHT


def wrapped(text: str, size: float, width: float) -> tuple[str, ...]:
    """Return `text` in lines that are at most `width` wide, as far as it can be broken.

    Latin text breaks at spaces, Chinese text between any two characters but not before closing
    marks. The lines are about equally long: as narrow, in steps of half an em, as the smallest
    number of lines allows. A line feed ends a line in any case.
    """
    if "\n" in text:
        return tuple(line for part in text.split("\n") for line in wrapped(part, size, width))
    if text_width(text.rstrip(), size) <= width:
        return (text.strip(),)
    cuts = [at for at, (left, right) in enumerate(pairwise(text), start=1) if _breaks(left, right)]
    pieces = [text[start:end] for start, end in pairwise([0, *cuts, len(text)])]

    def lines(halves: int) -> tuple[str, ...]:
        return _filled(pieces, (width - halves * size / 2) * 1000 / (size * ROUNDING))

    fewest = len(lines(0))
    narrower = range(1, int(2 * width / size))
    # Narrower boxes never need fewer lines, so that the narrowest can be searched by halves.
    return lines(bisect_right(narrower, fewest, key=lambda halves: len(lines(halves))))


def _filled(pieces: list[str], box: float) -> tuple[str, ...]:
    """Return lines filled with as many pieces as fit; `box` in thousandths of an em."""
    lines, taken = [""], 0
    for piece in pieces:
        if lines[-1] and taken + _thousandths(piece.rstrip()) > box:
            lines.append("")
            taken = 0
        lines[-1] += piece
        taken += _thousandths(piece)
    return tuple(line.strip() for line in lines)


@lru_cache(maxsize=4096)  # the same words are measured for each width that is tried
def _thousandths(text: str) -> int:
    return sum(map(_advance, text))


@cache
def _advance(character: str) -> int:
    # An accent stands above the letter before it.
    if unicodedata.combining(character):
        return 0
    index = ord(character) - _FIRST
    return _ADVANCES[index] if 0 <= index < len(_ADVANCES) else 1000


def _breaks(left: str, right: str) -> bool:
    """Return whether a line may end between two characters."""
    if left == " ":
        return right != " "
    wide = any(unicodedata.east_asian_width(each) in "WF" for each in (left, right))
    return wide and right not in _CLOSING and right != " "


def missing_font(code: str, fonts: Sequence[str], package: str | None) -> str:
    """Return what to say when a language has none of its fonts; `package` brings the first."""
    return (
        f"no font for the language {code} (looked for {', '.join(fonts)}); "
        f"install {package or 'one of them'}, or use --ratings console"
    )


def first_font(fonts: Sequence[str], there: Callable[[str], bool]) -> str | None:
    return next(filter(there, fonts), None)
