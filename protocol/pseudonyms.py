"""Pseudonyms of participants: the rule for those of sessions and of imported tables."""

import re
from collections.abc import Sequence

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


_NUMBERED = re.compile(r"([A-Za-z]{0,16})[ ._#/:-]*([0-9]{1,12})")


def pseudonyms(subjects: Sequence[str]) -> tuple[dict[str, str], list[str]]:
    """Return what each subject is called, and what to say of it.

    Words with a number keep it. Others may be names of persons, or initials, which are not stored.
    """
    if all(map(_is_pseudonym, subjects)):
        return {name: name for name in subjects}, []
    joined: dict[str, str] = {}
    for name in subjects:
        number = _NUMBERED.fullmatch(name)
        short = name if _is_pseudonym(name) or not number else "".join(number.groups())
        if _is_pseudonym(short):
            joined[name] = short
    if len({it.casefold() for it in joined.values()}) == len(subjects):
        one = next(name for name in subjects if joined[name] != name)
        return joined, [f"Names of subjects were shortened: {one} is {joined[one]}."]
    width = max(2, len(str(len(subjects))))
    numbered = {name: f"S{number:0{width}d}" for number, name in enumerate(subjects, start=1)}
    first, last = numbered[subjects[0]], numbered[subjects[-1]]
    return numbered, [
        f"Subjects are called {first} to {last}, in the order of the table: their names there may "
        "be those of persons, or initials, which are not stored."
    ]


def _is_pseudonym(name: str) -> bool:
    try:
        pseudonym(name)
    except BadInput:
        return False
    return True
