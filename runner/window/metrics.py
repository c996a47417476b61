"""How much room a text takes, estimated from above, without a screen.

A Latin letter is given its advance in DejaVu Sans, which is wider than the fonts that may stand in
for it; an East Asian character is as wide as high. The same lines are measured and drawn, so a text
that fits here fits on the screen.
"""

import unicodedata
from itertools import pairwise

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
"""What may not begin a line."""


def text_width(text: str, size: float) -> float:
    """Return how wide one line of `text` can become, in the unit of `size`.

    >>> round(text_width("smooth", 20), 1)
    79.1
    >>> round(text_width("光滑", 20), 1)
    41.6
    """
    return sum(_advance(character) for character in text) * size * ROUNDING


def text_height(lines: int, size: float) -> float:
    """Return the height of that many lines."""
    return lines * size * LINE_HEIGHT


def wrapped(text: str, size: float, width: float) -> tuple[str, ...]:
    """Return `text` in lines that are at most `width` wide, as far as it can be broken.

    Latin text breaks at spaces, Chinese text between any two characters but before closing marks;
    the lines are made about equally long.
    """
    pieces = _pieces(text)
    lines = _filled(pieces, size, width)
    for halves in range(1, int(2 * width / size)):
        narrower = _filled(pieces, size, width - halves * size / 2)
        if len(narrower) > len(lines):
            break
        lines = narrower
    return lines


def _filled(pieces: list[str], size: float, width: float) -> tuple[str, ...]:
    """Lines that each take as many pieces as they hold."""
    lines = [""]
    for piece in pieces:
        longer = lines[-1] + piece
        if lines[-1] and text_width(longer.rstrip(), size) > width:
            lines.append(piece.lstrip())
        else:
            lines[-1] = longer
    return tuple(line.strip() for line in lines)


def _advance(character: str) -> float:
    if unicodedata.combining(character):
        return 0.0
    index = ord(character) - _FIRST
    return _ADVANCES[index] / 1000 if 0 <= index < len(_ADVANCES) else 1.0


def _pieces(text: str) -> list[str]:
    """`text` cut at every place where a line may end."""
    cuts = [at for at, (left, right) in enumerate(pairwise(text), start=1) if _breaks(left, right)]
    return [text[start:end] for start, end in pairwise([0, *cuts, len(text)])]


def _breaks(left: str, right: str) -> bool:
    if left == " ":
        return right != " "
    return (_wide(left) or _wide(right)) and right not in _CLOSING and right != " "


def _wide(character: str) -> bool:
    return unicodedata.east_asian_width(character) in "WF"
