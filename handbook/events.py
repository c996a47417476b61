"""The page of the journal's events, generated from their records."""

import json
import re
from collections.abc import Iterable, Iterator
from inspect import getdoc
from types import NoneType
from typing import Any, get_args, get_origin

from device.people.person import PARAMETERS
from handbook.meanings import meanings
from protocol.journal.events import EVENTS
from protocol.journal.json_record import JsonRecord, KeyOf, as_json, is_optional
from protocol.journal.records import VirtualTruth

_INTRODUCTION = """\
# The journal's events

This page is written from the program by `python -m handbook.reference`.
[The journal](../journal.md) says which event is allowed when.

A payload is a JSON object with the keys below; readers ignore others. `key?` may be null or absent,
which is the same; an absent `key = value` has that value; all other keys are required.
"""

_OF_A_PERSON = """
All [parameters of a person](people-parameters.md), each a number. One that is absent is as in
the column *one person*; without `criterion_less` it is `criterion`, without reaction times they
are not known.
"""
_PLAIN: dict[Any, str] = {
    Any: "any value",
    str: "text",
    int: "whole number",
    float: "number",
    bool: "true or false",
}


def event_list() -> str:
    """Return the page as Markdown."""
    parts = (part for event in EVENTS for key in event.json_keys() for part in _records(key.type))
    headings: dict[type[JsonRecord], str] = {event: f"`{event.TAG}`" for event in EVENTS}
    headings |= {kind: _heading(kind) for kind in parts}
    said: dict[str, str] = {}
    sections = [_section(kind, heading, said) for kind, heading in headings.items()]
    return "\n".join([_INTRODUCTION, *sections])


def _records(hint: Any) -> Iterator[type[JsonRecord]]:
    """Yield the records that a value of type `hint` contains."""
    if isinstance(hint, type) and issubclass(hint, JsonRecord):
        yield hint
        for key in hint.json_keys():
            yield from _records(key.type)
    for part in get_args(hint):
        yield from _records(part)


def _section(kind: type[JsonRecord], heading: str, said: dict[str, str]) -> str:
    """Return heading, meaning and keys; a row that `said` has only names where it is."""
    rows, again = [], dict[str, list[str]]()
    of_a_person, below = PARAMETERS if kind is VirtualTruth else {}, meanings(kind)
    for key in kind.json_keys():
        if key.name in of_a_person:
            continue
        row = f"- `{_key(key)}` ({_cell(key)}): {key.key.meaning or below[key.name]}"
        if (where := said.setdefault(row, heading)) == heading:
            rows.append(row)
        else:
            again.setdefault(where, []).append(f"`{key.name}`")
    lines = [f"## {heading}", "", _meaning(kind)]
    if of_a_person:
        lines += _OF_A_PERSON.rstrip().splitlines()
    for where, names in again.items():
        link = where.strip("`").lower().replace(" ", "-")
        lines += ["", f"As in [{where}](#{link}): {', '.join(names)}."]
    if rows:
        lines += ["", *rows]
    return _lines(lines)


def _key(key: KeyOf) -> str:
    """Return the name with the value it has if absent."""
    if key.key.required:
        return key.name
    missing = as_json(key.key.missing)
    if isinstance(missing, dict):
        missing = {name: value for name, value in missing.items() if value is not None}
    return f"{key.name}?" if missing is None else f"{key.name} = {json.dumps(missing)}"


def _cell(key: KeyOf) -> str:
    """Return the form of a key's value; the name of a `key?` says already that it may be null."""
    may_be_absent = not key.key.required and key.key.missing is None
    return _value(key.type).removesuffix(", or null" if may_be_absent else "")


def _lines(lines: Iterable[str]) -> str:
    return "".join(f"{line}\n" for line in lines)


def _meaning(kind: type[JsonRecord]) -> str:
    return (getdoc(kind) or "").partition("\n\n")[0]


def _heading(kind: type[JsonRecord]) -> str:
    """Return the name of a record class in words.

    >>> from protocol.journal.records import PlannedTrial
    >>> _heading(PlannedTrial)
    'Planned trial'
    """
    return re.sub(r"(?<=[a-z])([A-Z])", lambda found: f" {found[1].lower()}", kind.__name__)


def _value(hint: Any) -> str:
    """Return in words the JSON form of a value of type `hint`."""
    parts = [part for part in get_args(hint) if part is not NoneType]
    if is_optional(hint):
        return f"{_value(parts[0])}, or null"
    if get_origin(hint) is tuple:
        return f"list of {_value(parts[0])}"
    if get_origin(hint) is not None:
        return "object" if parts[1] is Any else f"object of {_value(parts[1])}"
    if hint in _PLAIN:
        return _PLAIN[hint]
    if issubclass(hint, tuple):
        return f"list of {len(hint.__annotations__)} numbers"
    name = _heading(hint)
    return f"[{name.lower()}](#{name.lower().replace(' ', '-')})"
