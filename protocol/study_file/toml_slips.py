"""What is wrong with a line that is not TOML, and how to write it: the usual slips.

People who do not write programs edit study files. They are shown their own line and the remedy, and
nothing of the parser's.
"""

import re
from tomllib import TOMLDecodeError
from typing import NamedTuple

from protocol.errors import Problem

_CURLY = re.compile("[“”„‟‘’‚«»]")
_TRUTH = {"True": "true", "TRUE": "true", "False": "false", "FALSE": "false", "yes": "true"}
_LISTS = {"question", "page", "opening", "condition"}
"""Tables that may stand several times."""
_LONGEST = 60
_NUMBER = r"[-+]?[0-9][0-9_]*"


class _Slip(NamedTuple):
    """What the value of a key looks like, and the remedy; `{0}` is the value, `{key}` the key."""

    value: str
    remedy: str


_SLIPS = (
    _Slip("", "a value is missing after ="),
    _Slip(rf"({_NUMBER}),([0-9]+)", "a decimal number has a point, not a comma: {key} = {1}.{2}"),
    _Slip(
        r"\[.*[0-9],[0-9].*",
        "decimal numbers have a point, and a comma stands between two numbers: [0.1, 0.2]",
    ),
    _Slip(
        rf"({_NUMBER}(?:\.[0-9]+)?)\s*[^\W\d_%]+[\w/·²]*|({_NUMBER}(?:\.[0-9]+)?)\s*[%°].*",
        "a number stands alone, without its unit: {key} = {number}",
    ),
    _Slip(r"0[0-9]+", "a number must not begin with 0: {key} = {stripped}"),
    _Slip(r"\.[0-9]+", "a number must begin with a digit: {key} = 0{0}"),
    _Slip("|".join(_TRUTH), "write {key} = {truth}, in small letters"),
    _Slip(r"\".*\\.*\"", "a backslash in a text stands twice, or the text is in single quotes"),
    _Slip(r"\"[^\"]*|'[^']*", "the text lacks the quote at its end"),
    _Slip(r"[^\W\d][^\"'\[\]{}]*", 'a text stands in quotes: {key} = "{0}"'),
)


def no_toml(text: str, error: TOMLDecodeError) -> Problem:
    """Return the problem of the line at which `error` says that `text` is not TOML."""
    lines = text.split("\n")
    found = re.search(r"at line (\d+)", str(error))
    number = int(found[1]) if found else text.rstrip().count("\n") + 1
    unclosed = "Unclosed" in str(error) or "end of document" in str(error)
    if unclosed and not _has_comma_slip(lines[number - 1]):
        number = _opened(lines, number)
    line = _without_comment(lines[number - 1])
    shown = line if len(line) <= _LONGEST else f"{line[: _LONGEST - 3]}..."
    return Problem(
        where="file",
        rule="must be TOML",
        value=f"the line '{shown}'",
        hint=_remedy(line, str(error), unclosed=unclosed),
        line=number,
    )


def _has_comma_slip(line: str) -> bool:
    return re.search(r"[0-9],[0-9]", line) is not None


def _opened(lines: list[str], number: int) -> int:
    """Return the last line, up to `number`, that opens a bracket and does not close it."""
    for candidate in range(number, 0, -1):
        line = _without_comment(lines[candidate - 1])
        if line.count("[") + line.count("{") > line.count("]") + line.count("}"):
            return candidate
    return number


def _without_comment(line: str) -> str:
    """Return the line without a comment; a quote before # may belong to a text."""
    before, mark, _ = line.partition("#")
    return (before if mark and before.count('"') % 2 == 0 else line).strip()


def _remedy(line: str, said: str, *, unclosed: bool) -> str:
    key, equals, value = (part.strip() for part in line.partition("="))
    if _CURLY.search(line):
        return f"a text stands in straight quotes: {_CURLY.sub(chr(34), line)}"
    if "Cannot" in said and line.startswith("[") and (name := line.strip("[]")) in _LISTS:
        return f"each {name} begins with two brackets: [[{name}]]"
    if "Cannot overwrite" in said or "Cannot declare" in said:
        return f"{key} stands twice; keep one, with the keys of both"
    if unclosed and re.search(r"[\[{]", line) and not _has_comma_slip(line):
        return "what is opened here with [ or { must be closed with ] or }"
    return _remedy_of_value(key, value) if equals else _remedy_of_key(line)


def _remedy_of_key(line: str) -> str:
    if line.startswith("["):
        return "the name of a table stands in brackets: [rig], or [[condition]]"
    return "a key and its value need = between them"


def _remedy_of_value(key: str, value: str) -> str:
    for slip in _SLIPS:
        if found := re.fullmatch(slip.value, value):
            return _filled(slip.remedy, key, found)
    return "docs/study-file.md shows how each value is written"


def _filled(remedy: str, key: str, found: "re.Match[str]") -> str:
    groups = [group or "" for group in found.groups()]
    return remedy.format(
        found[0],
        *groups,
        key=key,
        number="".join(groups),
        stripped=found[0].lstrip("0") or "0",
        truth=_TRUTH.get(found[0], ""),
    )
