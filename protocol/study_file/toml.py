"""The text of a TOML file: its values, or why it cannot be read, and the lines of its keys."""

import json
import re
import tomllib
from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from tomllib import TOMLDecodeError
from typing import Any

from protocol.errors import Path, Problem, page

# What is wrong with a line that is not TOML, and how to write it: the usual slips.
#
# People who do not write programs edit study files. They are shown their own line and the remedy,
# and nothing of the parser's.

_CURLY = re.compile("[“”„‟‘’‚«»]")
_TRUTH = {"True": "true", "TRUE": "true", "False": "false", "FALSE": "false", "yes": "true"}
_LISTS = {"question", "page", "opening", "condition"}
"""Tables that may stand several times."""
_LONGEST = 60
_CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")
_UNSEEN = re.compile(r"[^\S \t]|[\u200b-\u200f\u2060\ufeff]")
_QUOTED = re.compile(r"\"[^\"]*\"?|'[^']*'?")
_COMMA = re.compile(r"[0-9],[0-9]")
_NUMBER = r"[-+]?[0-9][0-9_]*"


_SLIPS = {
    "": "a value is missing after =",
    rf"({_NUMBER}),([0-9]+)": "a decimal number has a point, not a comma: {key} = {1}.{2}",
    r"\[.*[0-9],[0-9].*": "decimal numbers have a point, and a comma stands between two numbers: "
    "[0.1, 0.2]",
    rf"({_NUMBER}(?:\.[0-9]+)?)\s*[^\W\d_%]+[\w/·²]*|({_NUMBER}(?:\.[0-9]+)?)\s*[%°].*": (
        "a number stands alone, without its unit: {key} = {number}"
    ),
    r"0[0-9]+": "a number must not begin with 0: {key} = {stripped}",
    r"\.[0-9]+": "a number must begin with a digit: {key} = 0{0}",
    "|".join(_TRUTH): "write {key} = {truth}, in small letters",
    r"\".*\\.*\"": "a backslash in a text stands twice, or the text is in single quotes",
    r"\"[^\"]*|'[^']*": "the text lacks the quote at its end",
    r"[^\W\d][^\"'\[\]{}]*": 'a text stands in quotes: {key} = "{0}"',
}
"""What the value of a key looks like, and the remedy; `{0}` is the value, `{key}` the key."""


def no_toml(text: str, error: TOMLDecodeError) -> Problem:
    """Return the problem of the line at which `error` says that `text` is not TOML."""
    lines = text.split("\n")
    place = re.search(r"at line (\d+)", str(error))
    number = int(place[1]) if place else text.rstrip().count("\n") + 1
    unclosed = "Unclosed" in str(error) or "end of document" in str(error)
    # The parser stops at the end of the file; the slip is where the bracket was opened.
    if unclosed and not _COMMA.search(lines[number - 1]):
        number = next(filter(lambda each: _opens(lines[each - 1]), range(number, 0, -1)), number)
    line, written = _without_comment(lines[number - 1]), lines[number - 1].rstrip("\r")
    hint = _remedy(line, str(error), unclosed=unclosed)
    # A comment, too, must not hold them; elsewhere than in texts nothing that cannot be seen may.
    if stray := _CONTROL.search(written) or _UNSEEN.search(_QUOTED.sub("", line)):
        column = written.index(stray[0])
        line = written[max(0, column - _LONGEST // 2) :].strip(" ")
        code = f"U+{ord(stray[0]):04X} in column {column + 1}"
        hint = f"delete the character {code}, which cannot be seen"
    shown = line if len(line) <= _LONGEST else f"{line[: _LONGEST - 3]}..."
    return Problem("file", "must be TOML", f"the line '{shown}'", hint, line=number)


def _opens(line: str) -> bool:
    """Return whether a line opens a bracket and does not close it."""
    line = _without_comment(line)
    return line.count("[") + line.count("{") > line.count("]") + line.count("}")


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
    if twice := re.search(
        "Cannot overwrite|Cannot declare|Duplicate inline table key '(.*)'", said
    ):
        of_both = ", with the keys of both" if line.startswith("[") else ""
        return f"{twice[1] or key} stands twice; keep one{of_both}"
    if unclosed and re.search(r"[\[{]", line) and not _COMMA.search(line):
        return "what is opened here with [ or { must be closed with ] or }"
    alone = "a key and its value need = between them"
    if line.startswith("["):
        alone = "the name of a table stands in brackets: [rig], or [[condition]]"
    return _remedy_of_value(key, value) if equals else alone


def _remedy_of_value(key: str, value: str) -> str:
    for pattern, remedy in _SLIPS.items():
        if found := re.fullmatch(pattern, value):
            groups = [group or "" for group in found.groups()]
            worked_out = {
                "number": "".join(groups),
                "stripped": value.lstrip("0") or "0",
                "truth": _TRUTH.get(value, ""),
            }
            return remedy.format(value, *groups, key=key, **worked_out)
    return f"{page('Study file')} shows how each value is written"


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
        return Problem.of_key(path, rule, many, "shorten it to 18 digits")
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
    table: Path = ()
    while scanner.next_sign():
        table = scanner.table() if scanner.next_sign() == "[" else scanner.pair(table)
    return scanner.lines


def line_of(lines: Mapping[Path, int], path: Path) -> int | None:
    """Return the line of `path` or of what is nearest above it."""
    above = (path[:length] for length in range(len(path), 0, -1))
    return next((lines[part] for part in above if part in lines), None)


class _Scanner:
    """One pass over a document that is known to be well formed."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        # Kept once, so that the line of a key is found by bisection.
        self.ends = [end.start() for end in re.finditer("\n", text)]
        self.lines: dict[Path, int] = {}
        self.arrays: dict[Path, int] = {}

    def next_sign(self) -> str:
        """Skip what is blank, and return what follows; nothing at the end."""
        if blank := _BLANK.match(self.text, self.at):
            self.at = blank.end()
        return self.text[self.at : self.at + 1]

    def taken(self, pattern: re.Pattern[str]) -> str:
        matched = pattern.match(self.text, self.at)
        assert matched is not None, f"no TOML at offset {self.at}"
        self.at = matched.end()
        return matched.group()

    def seen(self, path: Path, at: int) -> None:
        self.lines.setdefault(path, bisect_left(self.ends, at) + 1)

    def table(self) -> Path:
        """`[table]` or `[[element]]`; the path holds the current element of every array above."""
        brackets = 2 if self.text.startswith("[[", self.at) else 1
        self.at += brackets
        path: Path = ()
        for key in self.keys():
            path = (*self.current(path), key)
            self.seen(path, self.at)
        if brackets == 2:
            self.arrays[path] = self.arrays.get(path, -1) + 1
            self.seen(self.current(path), self.at)
        self.at += brackets
        return self.current(path)

    def current(self, path: Path) -> Path:
        return (*path, self.arrays[path]) if path in self.arrays else path

    def keys(self) -> list[str]:
        """A dotted key, up to what ends it."""
        keys = []
        while True:
            self.next_sign()
            token = self.taken(_KEY)
            # A quoted key may have escapes, which the parser knows how to read.
            keys.append(tomllib.loads(f"key = {token}")["key"] if token[0] in "\"'" else token)
            if self.next_sign() != ".":
                return keys
            self.at += 1

    def pair(self, table: Path) -> Path:
        """A key and its value; the table stays the same one."""
        start, path = self.at, table
        for key in self.keys():
            path = (*path, key)
            self.seen(path, start)
        self.at += 1
        self.value(path)
        return table

    def value(self, path: Path) -> None:
        first = self.next_sign()
        if first not in {"[", "{"}:
            self.taken(_TEXT if first in "\"'" else _PLAIN)
            return
        self.at += 1
        for index in count():
            if self.next_sign() == ",":
                self.at += 1
            if self.next_sign() == ("]" if first == "[" else "}"):
                self.at += 1
                return
            if first == "{":
                self.pair(path)
            else:
                self.seen((*path, index), self.at)
                self.value((*path, index))


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
