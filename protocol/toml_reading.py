"""From the text of a TOML file to its values, or to the one thing that keeps it from being read.

`tomllib` stops with an internal error at a number that is too long, or at lists in lists in lists.
"""

import re
import tomllib
from typing import Any

from protocol.problem import Path, Problem

MAX_DEPTH = 16
"""Three times as deep as anything that a study holds."""
_MOST = 2**63
"""A whole number of TOML has 64 bits; Python's could have so many that it cannot be printed."""
_LONG = re.compile(r"[0-9_]{4301,}")
_MARK = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|' + r"'''.*?'{3,5}|" + r""""(?:\\.|[^"\\])*"|'[^']*'|"""
    r"#[^\n]*|(?P<opens>[\[{])|(?P<closes>[\]}])",
    re.DOTALL,
)


def toml_document(text: str) -> dict[str, Any] | Problem:
    """Return the values in `text`, or why there are none."""
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return _no_toml(text, error)
    except RecursionError:
        return _nested(text)
    except ValueError as error:
        return _too_long(text, error)
    return _extreme(text, document) or document


def _no_toml(text: str, error: tomllib.TOMLDecodeError) -> Problem:
    line = re.search(r"at line (\d+)", str(error))
    return Problem(
        where="file",
        rule="must be TOML",
        value=str(error),
        hint="mend the line",
        line=int(line[1]) if line else text.rstrip().count("\n") + 1,
    )


def _too_long(text: str, error: ValueError) -> Problem:
    number = _LONG.search(text)
    digits = f"one of {len(number[0])} digits" if number else str(error)
    line = text.count("\n", 0, number.start()) + 1 if number else None
    return _beyond_64_bits("file", digits, (), line)


def _beyond_64_bits(where: str, value: str, path: Path, line: int | None = None) -> Problem:
    return Problem(
        where=where,
        rule="a whole number must fit into 64 bits",
        value=value,
        hint="shorten it to 18 digits",
        path=path,
        line=line,
    )


def _extreme(text: str, document: dict[str, Any]) -> Problem | None:
    """The first value that is too deep or too large for anything else to look at it."""
    left: list[tuple[Path, Any]] = [((), document)]
    while left:
        path, value = left.pop()
        if len(path) > MAX_DEPTH:
            return _nested(text)
        if isinstance(value, dict):
            left += [((*path, key), inner) for key, inner in value.items()]
        elif isinstance(value, list):
            left += [((*path, number), inner) for number, inner in enumerate(value)]
        elif isinstance(value, int) and not -_MOST <= value < _MOST:
            bits = f"one of {value.bit_length()} bits"
            return _beyond_64_bits(".".join(map(str, path)), bits, path)
    return None


def _nested(text: str) -> Problem:
    return Problem(
        where="file",
        rule=f"nothing may be nested more than {MAX_DEPTH} deep",
        value="more",
        hint="close the brackets sooner, or shorten the dotted key",
        line=_deep_line(text),
    )


def _deep_line(text: str) -> int | None:
    """The line of the bracket that is too deep, or of a key with too many dots."""
    depth = 0
    for mark in _MARK.finditer(text):
        depth += (mark["opens"] is not None) - (mark["closes"] is not None)
        if depth > MAX_DEPTH:
            return text.count("\n", 0, mark.start()) + 1
    dotted = (line.partition("=")[0].count(".") for line in text.splitlines())
    return next((number for number, dots in enumerate(dotted, 1) if dots >= MAX_DEPTH), None)
