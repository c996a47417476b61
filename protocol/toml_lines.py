"""On which line each key of a TOML file stands; `tomllib` gives the values alone."""

import re
import tomllib
from collections.abc import Mapping

from protocol.problem import Path

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
