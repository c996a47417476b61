"""Which place in the cohort's design a participant has."""

from collections.abc import Iterable, Mapping
from typing import Any


def slot(openings: Iterable[Mapping[str, Any]], participant: str, kind: str) -> int:
    """Return the slot of `participant` among the sessions of `kind`, counted from 0.

    A participant keeps the slot of an earlier session; a new one takes the first that is free.
    Rehearsals have slots of their own, so that they use up nobody's.
    """
    taken: dict[str, int] = {
        opening["participant"]: opening["slot"]
        for opening in openings
        if opening.get("kind") == kind
    }
    if participant in taken:
        return taken[participant]
    used = set(taken.values())
    return next(number for number in range(len(used) + 1) if number not in used)
