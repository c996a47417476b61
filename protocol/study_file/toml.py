"""From the text of a TOML file to its values, or to the one thing that keeps it from being read.

`tomllib` stops with an internal error at a number that is too long, or at lists in lists in lists.
"""

import re
import tomllib
from collections.abc import Mapping
from typing import Any

from protocol.errors import Path, Problem

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


_BLANK = re.compile(r"(?:\s|#[^\n]*)+")
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"(?:\\.|[^"\\])*"|'[^']*'""")
_TEXT = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|' + r"'''.*?'{3,5}|" + r""""(?:\\.|[^"\\])*"|'[^']*'""", re.DOTALL
)
_PLAIN = re.compile(r"[^,\]}#\n]+")


def key_lines(text: str) -> Mapping[Path, int]:
    r"""Return the line, from 1, on which each key, table and array element of `text` begins.

    Args:
        text: a TOML document that `tomllib` accepts.

    >>> key_lines('[rig]\nlevels = [1,\n 2]')
    {('rig',): 1, ('rig', 'levels'): 2, ('rig', 'levels', 0): 2, ('rig', 'levels', 1): 3}
    """
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


def line_of(lines: Mapping[Path, int], path: Path) -> int | None:
    """Return the line of `path` or of what is nearest above it."""
    for length in range(len(path), 0, -1):
        if path[:length] in lines:
            return lines[path[:length]]
    return None


class _Scanner:
    """One pass over a document that is known to be well formed."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.lines: dict[Path, int] = {}
        self.arrays: dict[Path, int] = {}

    def document(self) -> None:
        table: Path = ()
        while self._skip_blank():
            if self.text[self.at] == "[":
                table = self._header()
            else:
                self._pair(table)

    def _skip_blank(self) -> bool:
        """Whether anything follows."""
        if blank := _BLANK.match(self.text, self.at):
            self.at = blank.end()
        return self.at < len(self.text)

    def _taken(self, pattern: re.Pattern[str]) -> str:
        found = pattern.match(self.text, self.at)
        assert found is not None, f"no TOML at offset {self.at}"
        self.at = found.end()
        return found.group()

    def _seen(self, path: Path) -> None:
        self.lines.setdefault(path, self.text.count("\n", 0, self.at) + 1)

    def _header(self) -> Path:
        """`[table]` or `[[element]]`; the path holds the current element of every array above."""
        is_element = self.text.startswith("[[", self.at)
        self.at += 1 + is_element
        path: Path = ()
        for key in self._keys():
            path = self._current(path)
            path += (key,)
            self._seen(path)
        if is_element:
            self.arrays[path] = self.arrays.get(path, -1) + 1
            self._seen(self._current(path))
        self.at += 1 + is_element
        return self._current(path)

    def _current(self, path: Path) -> Path:
        return (*path, self.arrays[path]) if path in self.arrays else path

    def _keys(self) -> list[str]:
        """A dotted key, up to what ends it."""
        keys = []
        while True:
            self._skip_blank()
            token = self._taken(_KEY)
            keys.append(tomllib.loads(f"key = {token}")["key"] if token[0] in "\"'" else token)
            self._skip_blank()
            if self.text[self.at] != ".":
                return keys
            self.at += 1

    def _pair(self, table: Path) -> None:
        start = self.at
        path = table
        for key in self._keys():
            path += (key,)
            self.lines.setdefault(path, self.text.count("\n", 0, start) + 1)
        self.at += 1
        self._value(path)

    def _value(self, path: Path) -> None:
        self._skip_blank()
        first = self.text[self.at]
        if first == "[":
            self._array(path)
        elif first == "{":
            self._inline_table(path)
        else:
            self._taken(_TEXT if first in "\"'" else _PLAIN)

    def _array(self, path: Path) -> None:
        index = 0
        self.at += 1
        while self._next_of("]"):
            self._seen((*path, index))
            self._value((*path, index))
            index += 1

    def _inline_table(self, path: Path) -> None:
        self.at += 1
        while self._next_of("}"):
            self._pair(path)

    def _next_of(self, closing: str) -> bool:
        """Skip to the next element; at the end, past `closing`."""
        self._skip_blank()
        if self.text[self.at] == ",":
            self.at += 1
            self._skip_blank()
        if self.text[self.at] == closing:
            self.at += 1
            return False
        return True
