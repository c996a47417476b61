"""The list of events in docs/journal.md, generated from their records.

`python -m protocol.journal.event_list` prints that section of the page.
"""

import json
import re
from collections.abc import Iterable, Iterator
from inspect import getdoc
from types import NoneType
from typing import Any, get_args, get_origin

from protocol.journal.events import EVENTS
from protocol.journal.json_record import JsonRecord, Key, as_json, is_optional

_INTRODUCTION = """\
## Events

`protocol/journal/events.py` defines the events, and `python -m protocol.journal.event_list`
generates this section from it.

A payload is a JSON object with the keys below. Readers ignore keys that they do not know. A key
that earlier builds did not write may be absent. It then has the value in the column *if absent*.
All other keys are required.
"""

_PLAIN: dict[Any, str] = {
    Any: "any value",
    str: "text",
    int: "whole number",
    float: "number",
    bool: "true or false",
}


def event_list() -> str:
    """Return the section as Markdown."""
    rows = [f"| `{event.TAG}` | {_meaning(event)} |" for event in EVENTS]
    overview = _lines(["| tag | what happened |", "|---|---|", *rows])
    events = [_section(f"`{event.TAG}`", event) for event in EVENTS if event.json_keys()]
    parts = (part for event in EVENTS for key in event.json_keys() for part in _records(key.type))
    records = [_section(_heading(kind), kind) for kind in dict.fromkeys(parts)]
    return "\n".join([_INTRODUCTION, overview, *events, *records])


def _records(hint: Any) -> Iterator[type[JsonRecord]]:
    """Yield the records that a value of type `hint` contains."""
    if isinstance(hint, type) and issubclass(hint, JsonRecord):
        yield hint
    for part in get_args(hint):
        yield from _records(part)


def _section(heading: str, kind: type[JsonRecord]) -> str:
    header = ["| key | value | if absent | meaning |", "|---|---|---|---|"]
    rows = [
        f"| `{key.name}` | {_value(key.type)} | {_absent(key.key)} | {key.key.meaning} |"
        for key in kind.json_keys()
    ]
    return _lines([f"### {heading}", "", _meaning(kind), "", *header, *rows])


def _absent(key: Key) -> str:
    return "" if key.required else f"`{json.dumps(as_json(key.missing))}`"


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
        return f"list of: {_value(parts[0])}"
    if get_origin(hint) is not None:
        return "object" if parts[1] is Any else f"object; each value: {_value(parts[1])}"
    if hint in _PLAIN:
        return _PLAIN[hint]
    if issubclass(hint, tuple):
        return f"list of {len(hint.__annotations__)} numbers"
    name = _heading(hint)
    return f"[{name.lower()}](#{name.lower().replace(' ', '-')})"


if __name__ == "__main__":
    print(event_list(), end="")
