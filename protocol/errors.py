"""Errors that are not bugs, distinguished by their exit codes, and problems of a study file."""

import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import PurePath


class BadInput(ValueError):
    """A file or value from the user is wrong; the message says what, where and what to do."""


class WorkFailed(RuntimeError):
    """Something outside touchbeam failed: a device, a port, a disk or a person."""


IMPOSSIBLE = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""What reading JSON of an edited or damaged journal or file can raise."""

Path = tuple[str | int, ...]
# One slip can break a whole file, and nobody reads more than a screen of problems.
MOST_PROBLEMS = 50
"""Most problems of a study file that are listed at once."""
_LONGEST_VALUE = 80


def dotted(path: Path) -> str:
    """Return where `path` leads, as TOML writes it.

    >>> dotted(("beams", "1.5 mm", 0)), dotted(())
    ('beams."1.5 mm".0', 'file')
    """
    # Here, because nothing but a mistake needs it.
    import json

    # A name with a point in it would read as two keys.
    bare = (re.fullmatch(r"[\w-]+", str(part)) for part in path)
    parts = zip(map(str, path), bare, strict=True)
    return ".".join(part if it else json.dumps(part, ensure_ascii=False) for part, it in parts) or (
        "file"
    )


def shown(value: object) -> str:
    """Return a value as a message shows it: on one line, cut if it is long."""
    text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 3]}..."


def listed(names: Iterable[str]) -> str:
    """Return names as a sentence lists them, by semicolons where a name has a comma of its own.

    >>> listed(["P01", "P02"]), listed(["5 N, slow", "5 N, fast"])
    ('P01, P02', '5 N, slow; 5 N, fast')
    """
    names = list(names)
    return ("; " if any("," in name for name in names) else ", ").join(names)


def page(title: str) -> str:
    """Return how a message names a page of the documentation.

    >>> f"see {page('Journal')}"
    "see 'Journal' (touchbeam docs)"
    """
    return f"'{title}' (touchbeam docs)"


def typed_as(path: object) -> str:
    r"""Return a path as a shell reads it, also where its bytes are no text of this computer.

    >>> typed_as("my study"), typed_as("caf\udce9")
    ("'my study'", "$'caf\\xe9'")
    """
    text = str(path)
    if text.isprintable():
        return shlex.quote(text)
    # What a terminal would obey or cannot show is written by its bytes, as bash and zsh read it.
    halves = any("\ud800" <= it <= "\udfff" and not "\udc80" <= it <= "\udcff" for it in text)
    told = text.encode(errors="surrogatepass" if halves else "surrogateescape")
    plain = re.compile(rb"[A-Za-z0-9/._ -]")
    byte_by_byte = (chr(it) if plain.match(bytes([it])) else f"\\x{it:02x}" for it in told)
    return f"$'{''.join(byte_by_byte)}'"


def meant(name: object, known: Iterable[str], more: Iterable[str] = ()) -> str:
    """Return a hint that names what was probably meant, `more` of it possible; else all `known`."""
    from difflib import get_close_matches

    known = tuple(known)
    close = get_close_matches(str(name), [*known, *more], n=1)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(known)}"


@dataclass(frozen=True)
class Problem:
    """A problem of a study: its place, the rule, the value and a remedy.

    `path` leads to the key in the study file; `line` is the key's line, counted from 1. `file`
    names another file beside the study file if the problem is there.
    """

    where: str
    rule: str
    value: str
    hint: str = ""
    path: Path = ()
    line: int | None = None
    file: str = ""

    @classmethod
    def of_key(
        cls, key: str | Path, rule: str, value: object, hint: str = "", where: str = ""
    ) -> "Problem":
        """Return the problem of a key such as `design.repeats`, or at a path; there in `where`."""
        path = tuple(key.split(".")) if isinstance(key, str) else key
        return cls(where or dotted(path), rule, str(value), hint, path)

    def __str__(self) -> str:
        """Return the problem in one line."""
        line = f"{self.where}: {self.rule}, got {self.value}"
        return f"{line}; {self.hint}" if self.hint else line

    def located(self, source: str) -> str:
        """Return the problem in one line, preceded by the file and the line number."""
        place = str(PurePath(source).parent / self.file) if self.file else source
        return f"{place}:{self.line}: {self}" if self.line else f"{place}: {self}"
