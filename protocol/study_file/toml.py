"""The text of a TOML file: its values, or why it cannot be read, and the lines of its keys."""

import json
import re
import tomllib
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from tomllib import TOMLDecodeError
from typing import Any, NamedTuple

from protocol.errors import Path, Problem

# What is wrong with a line that is not TOML, and how to write it: the usual slips.
#
# People who do not write programs edit study files. They are shown their own line and the remedy,
# and nothing of the parser's.

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
    place = re.search(r"at line (\d+)", str(error))
    number = int(place[1]) if place else text.rstrip().count("\n") + 1
    unclosed = "Unclosed" in str(error) or "end of document" in str(error)
    # The parser stops at the end of the file; the slip is where the bracket was opened.
    if unclosed and not _has_comma_slip(lines[number - 1]):
        number = _opened(lines, number)
    line = _without_comment(lines[number - 1])
    shown = line if len(line) <= _LONGEST else f"{line[: _LONGEST - 3]}..."
    hint = _remedy(line, str(error), unclosed=unclosed)
    return Problem("file", "must be TOML", f"the line '{shown}'", hint, line=number)


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
    # Word processors put these quotes; nothing else that is wrong with the line matters before.
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
        if matched := re.fullmatch(slip.value, value):
            return _filled(slip.remedy, key, matched)
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
    # The length comes first: all that follows takes time that grows with it.
    if len(text) > LONGEST_TEXT:
        rule = f"must have at most {LONGEST_TEXT} characters"
        return Problem("file", rule, "more", "leave out what is no study")
    # tomllib takes minutes for a key of many parts.
    if any(token["deep"] for token in _DEEP_KEY.finditer(text)):
        return _EXTREME
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        return no_toml(text, error)
    # `tomllib` raises these, which are no TOMLDecodeError, at nesting or numbers beyond all use.
    except (RecursionError, ValueError, MemoryError):
        return _EXTREME
    return _extreme(document, ()) or document


def in_toml(value: Any) -> str:
    """Return a text, number or list of texts as TOML: JSON but for one control character."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")


def _extreme(value: Any, path: Path) -> Problem | None:
    """The first value that is too deep or too large for anything else to look at it."""
    if len(path) > MAX_DEPTH:
        return _EXTREME
    if isinstance(value, int) and not -_MOST <= value < _MOST:
        rule, many = "a whole number must fit into 64 bits", f"one of {value.bit_length()} bits"
        return Problem(".".join(map(str, path)), rule, many, "shorten it to 18 digits")
    inner: Any = value.items() if isinstance(value, dict) else ()
    inner = enumerate(value) if isinstance(value, list) else inner
    extremes = (_extreme(item, (*path, key)) for key, item in inner)
    return next(filter(None, extremes), None)


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
        # Kept once, so that the line of a key is found by bisection.
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
        matched = pattern.match(self.text, self.at)
        assert matched is not None, f"no TOML at offset {self.at}"
        self.at = matched.end()
        return matched.group()

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
            # A quoted key may have escapes, which the parser knows how to read.
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


# Hints for values that were entered in the wrong unit.


@dataclass(frozen=True, kw_only=True)
class Unit:
    """A unit, the one that is taken for it, what that one is in it, and an example in that one."""

    name: str
    mistaken: str
    worth: float
    example: float

    def hint(self, value: object, *, too_large: bool) -> str:
        """Return the unit, and what `value` would be if it were in the mistaken one.

        >>> METRE.hint(41.4, too_large=True)
        'in m: 41.4 mm is 0.0414'
        """
        shown = self.example
        if isinstance(value, int | float) and too_large == (self.worth < 1):
            # A value far from everything that can be meant makes no example.
            shown = value if 1e-3 <= abs(value) <= 1e5 else shown
        return f"in {self.name}: {shown:g} {self.mistaken} is {shown * self.worth:.5g}"


METRE = Unit(name="m", mistaken="mm", worth=1e-3, example=10)
_BY_ENDING = {
    "_m_s": Unit(name="m/s", mistaken="mm/s", worth=1e-3, example=40),
    "_m": METRE,
    "_s": Unit(name="s", mistaken="ms", worth=1e-3, example=500),
    "_n": Unit(name="N", mistaken="g", worth=9.80665e-3, example=50),
    "_hz": Unit(name="Hz", mistaken="kHz", worth=1e3, example=24.221),
    "_nf": Unit(name="nF", mistaken="pF", worth=1e-3, example=2200),
    "_ma": Unit(name="mA", mistaken="A", worth=1e3, example=0.1),
    "_vpp": Unit(name="V", mistaken="mV", worth=1e-3, example=500),
}
_RELATIVE = "relative to the resonance: 1.0 drives the beam there; {} is in Hz"
_FIXED = "in Hz: 24.221 kHz is 24221; {} is relative to the resonance"
_HINTS = {
    "frequency": _RELATIVE.format("frequency_hz"),
    "frequencies": _RELATIVE.format("frequencies_hz"),
    "frequency_hz": _FIXED.format("frequency"),
    "sweep_to_hz": _FIXED.format("sweep_to"),
    "sweep_to": _RELATIVE.format("sweep_to_hz"),
    "press": "relative to touch.force_n: 1.5 presses half as hard again",
    "levels": "amplitudes are multiplied by it: 0.5 halves them",
    "amplifier_gain": "volts out per volt in: 26 dB is 20",
    "rate_hz": "samples per second",
}


def unit_hint(path: Path, value: object = None, *, too_large: bool = True) -> str:
    """Return which unit the number at `path` of a study file is in, empty where it has none.

    The `value` there is `too_large`, or else too small.
    """
    if path[0] == "beams":
        return METRE.hint(value, too_large=too_large)
    key = next((part for part in reversed(path) if isinstance(part, str)), "")
    if key in _HINTS:
        return _HINTS[key]
    units = (unit for ending, unit in _BY_ENDING.items() if key.endswith(ending))
    # `v_per_s` ends in `_s` and is no time.
    unit = None if key.endswith("_per_s") else next(units, None)
    return unit.hint(value, too_large=too_large) if unit else ""
