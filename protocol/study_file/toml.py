"""The text of a TOML file: its values, or why it cannot be read, and the lines of its keys."""

import re
import tomllib
from bisect import bisect_left
from collections.abc import Mapping
from typing import Any

from protocol.errors import Path, Problem

LONGEST_TEXT = 262_144
"""Bytes or characters: ten times as many as a study of the most conditions has."""
MAX_DEPTH = 16
"""Three times as deep as anything that a study holds."""
_MOST = 2**63
"""A whole number of TOML has 64 bits; Python's could have so many that it cannot be printed."""
_EXTREME = Problem(
    where="file",
    rule=f"nothing may be nested more than {MAX_DEPTH} deep, nor a number have thousands of digits",
    value="more",
    hint="close the brackets sooner, or shorten the dotted key or the number",
)
_BLANK = re.compile(r"(?:\s|#[^\n]*)+")
_KEY = re.compile(r"""[A-Za-z0-9_-]++|"(?:\\.|[^"\\])*+"|'[^']*+'""")
_TEXT = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|' + r"'''.*?'{3,5}|" + r""""(?:\\.|[^"\\])*"|'[^']*'""", re.DOTALL
)
_PLAIN = re.compile(r"[^,\]}#\n]+")
_DEEP_KEY = re.compile(
    rf"(?P<deep>(?:(?:{_KEY.pattern})[ \t]*+\.[ \t]*+){{{MAX_DEPTH}}})"
    rf"|{_TEXT.pattern}|#[^\n]*+|[A-Za-z0-9_-]++",
    re.DOTALL,
)


def toml_document(text: str) -> dict[str, Any] | Problem:
    """Return the values in `text`, or why there are none."""
    if len(text) > LONGEST_TEXT:
        rule = f"must have at most {LONGEST_TEXT} characters"
        return Problem(where="file", rule=rule, value="more", hint="leave out what is no study")
    # tomllib takes minutes for a key of many parts.
    if any(token["deep"] for token in _DEEP_KEY.finditer(text)):
        return _EXTREME
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        from protocol.study_file.toml_slips import no_toml  # loaded when there is a mistake

        return no_toml(text, error)
    except (RecursionError, ValueError, MemoryError):
        return _EXTREME
    return _extreme(document, ()) or document


def _extreme(value: Any, path: Path) -> Problem | None:
    """The first value that is too deep or too large for anything else to look at it."""
    if len(path) > MAX_DEPTH:
        return _EXTREME
    if isinstance(value, int) and not -_MOST <= value < _MOST:
        return Problem(
            where=".".join(map(str, path)),
            rule="a whole number must fit into 64 bits",
            value=f"one of {value.bit_length()} bits",
            hint="shorten it to 18 digits",
        )
    inner: Any = value.items() if isinstance(value, dict) else ()
    inner = enumerate(value) if isinstance(value, list) else inner
    found = (_extreme(item, (*path, key)) for key, item in inner)
    return next(filter(None, found), None)


def key_lines(text: str) -> Mapping[Path, int]:
    r"""Return the line, from 1, on which each key, table and array element of valid TOML begins.

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
        self.ends = [end.start() for end in re.finditer("\n", text)]
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
        self.lines.setdefault(path, self._line(self.at))

    def _line(self, at: int) -> int:
        return bisect_left(self.ends, at) + 1

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
            self.lines.setdefault(path, self._line(start))
        self.at += 1
        self._value(path)

    def _value(self, path: Path) -> None:
        self._skip_blank()
        first = self.text[self.at]
        if first == "[":
            self._array(path)
        elif first == "{":
            self.at += 1
            while self._next_of("}"):
                self._pair(path)
        else:
            self._taken(_TEXT if first in "\"'" else _PLAIN)

    def _array(self, path: Path) -> None:
        index = 0
        self.at += 1
        while self._next_of("]"):
            self._seen((*path, index))
            self._value((*path, index))
            index += 1

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
