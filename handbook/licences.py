"""Licences of what touchbeam needs: `python -m handbook.licences` prints them as a table.

They are read from the metadata of the installed packages, in the environment that is there.
"""

import re
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

COMPATIBLE = (
    r"0BSD|BSD|MIT|ISC|Apache|PSF|Python Software Foundation|HPND|Historical Permission|"
    r"MPL[- ]2|Mozilla Public License 2|ZPL|Zope|Zlib|CC0|Unlicense|WTFPL|Public Domain|"
    r"\bL?GPL|GNU (Lesser |Library )?General Public|GNU General"
)
"""Licences under which a program of GPL-3.0-or-later may use a package."""

INCOMPATIBLE = r"GPL-?2\.0-only|\(GPLv2\)|AGPL|Affero|\bNC\b|Non-?Commercial|Proprietary"

READ_BY_HAND = {
    "psychtoolbox": "MIT, as its files say; see the decision record",
    "questplus": "GPL-3.0, as its LICENSE says",
}
"""Licences of packages whose metadata name none, or no version, as their own files state them."""


def licence(package: Distribution) -> str:
    """Return the licence that a package declares, in one line; empty if it declares none."""
    name = canonicalize_name(package.metadata["Name"])
    if name in READ_BY_HAND:
        return READ_BY_HAND[name]
    if expression := _field(package, "License-Expression"):
        return expression
    classified = [
        entry.rpartition(" :: ")[2].removesuffix(" License")
        for entry in package.metadata.get_all("Classifier") or []
        if entry.startswith("License ::") and entry != "License :: OSI Approved"
    ]
    if classified:
        return ", ".join(classified)
    return _field(package, "License").partition("\n")[0]


def _field(package: Distribution, name: str) -> str:
    return "".join((package.metadata.get_all(name) or [])[:1]).strip()


def is_compatible(text: str) -> bool:
    """Return whether a declared licence is one of `COMPATIBLE`.

    >>> is_compatible("MIT"), is_compatible("CC BY-NC 4.0"), is_compatible("")
    (True, False, False)
    >>> is_compatible("GPL-2.0-only"), is_compatible("GPL-2.0-or-later")
    (False, True)
    """
    known, bad = (re.search(rule, text, re.IGNORECASE) for rule in (COMPATIBLE, INCOMPATIBLE))
    return known is not None and bad is None


def needed(name: str = "touchbeam", extras: tuple[str, ...] = ()) -> Iterator[Distribution]:
    """Yield the installed packages that `name` needs, directly or not, each once, by name."""
    found: dict[str, Distribution] = {}
    waiting = [(name, extras)]
    while waiting:
        wanted, chosen = waiting.pop()
        for line in distribution(wanted).requires or []:
            requirement = Requirement(line)
            known = canonicalize_name(requirement.name)
            if known in found or not _applies(requirement, chosen):
                continue
            try:
                found[known] = distribution(known)
            except PackageNotFoundError:  # left out of the locked environment
                continue
            waiting.append((known, tuple(requirement.extras)))
    yield from (found[known] for known in sorted(found))


def _applies(requirement: Requirement, extras: tuple[str, ...]) -> bool:
    if requirement.marker is None:
        return True
    return any(requirement.marker.evaluate({"extra": extra}) for extra in ("", *extras))


def table() -> str:
    """Return the packages and their licences as Markdown."""
    rows = [f"| {package.metadata['Name']} | {licence(package)} |\n" for package in needed()]
    return "| package | licence |\n|---|---|\n" + "".join(rows)


if __name__ == "__main__":
    print(table(), end="")
