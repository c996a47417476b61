"""Labels of letters and digits, as BIDS and Psych-DS want them in the names of files."""

import re
from collections.abc import Iterable

_OTHER = re.compile(r"[^0-9A-Za-z]")


def label(text: str) -> str:
    """Return what remains of `text` when all but ASCII letters and digits is left out.

    >>> label("P-01 触觉")
    'P01'
    """
    return _OTHER.sub("", text)


def labels(names: Iterable[str]) -> dict[str, str]:
    """Return a label for each of `names`, no two alike, not even on disks that ignore case.

    A name that is a label already keeps it; where several come to the same, the later ones get
    `x2`, `x3` and so on; a name without letters or digits becomes `s`.

    >>> labels(["P-01", "P01", "p_01", "受试者"])
    {'P-01': 'P01x2', 'P01': 'P01', 'p_01': 'p01x3', '受试者': 's'}
    """
    distinct = list(dict.fromkeys(names))
    found: dict[str, str] = {}
    taken: set[str] = set()
    for name in sorted(distinct, key=lambda name: label(name) != name):
        found[name] = _free(label(name) or "s", taken)
        taken.add(found[name].casefold())
    return {name: found[name] for name in distinct}


def _free(wanted: str, taken: set[str]) -> str:
    candidate, number = wanted, 1
    while candidate.casefold() in taken:
        number += 1
        candidate = f"{wanted}x{number}"
    return candidate
