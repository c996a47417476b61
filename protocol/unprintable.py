"""Characters that no name needs and that make a terminal or a page show what is not there."""

import re

_UNPRINTABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
UNWANTED = "must hold no control characters and none that turn the direction of writing"


def unprintable(text: str) -> bool:
    """Return whether `text` holds control characters or such as turn the direction of writing.

    Tabs and line ends are neither.
    """
    return _UNPRINTABLE.search(text) is not None


def printable(text: str) -> str:
    r"""Return `text` with U+FFFD in place of such characters.

    >>> ascii(printable("bell \x07"))
    "'bell \\ufffd'"
    """
    return _UNPRINTABLE.sub("\ufffd", text)


def require_printable(text: str) -> str:
    """Return `text`.

    Raises:
        ValueError: it holds such characters.
    """
    if unprintable(text):
        raise ValueError(UNWANTED)
    return text
