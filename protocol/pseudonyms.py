"""Pseudonyms of participants: the rule for those of sessions and of imported tables."""

import re

from protocol.errors import BadInput

_PSEUDONYM = re.compile(
    # Hardly any name of a person has a digit.
    r"(?=.*[0-9])"
    r"(?!(?:COM|LPT)[0-9]\Z)"  # which Windows takes for devices, as names of files too
    r"[A-Z0-9][A-Z0-9_-]{0,31}",
    re.ASCII | re.IGNORECASE,
)


def pseudonym(text: str) -> str:
    """Return `text` if it is a valid pseudonym.

    It is part of the names of files and rows, so that it must be one on every system.

    >>> pseudonym("P01")
    'P01'

    Raises:
        BadInput: it could be a real name, a path or the name of a device.
    """
    if not _PSEUDONYM.fullmatch(text):
        raise BadInput(
            "a participant must be a pseudonym of at most 32 letters, digits, - and _ with a digit "
            "in it, such as P01, and not the name of a Windows port, such as COM1; real names are "
            f"not stored, got {text!r}"
        )
    return text
