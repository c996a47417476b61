"""Errors that are not bugs, distinguished by their exit codes, and problems of a study file."""

from dataclasses import dataclass
from pathlib import PurePath


class BadInput(ValueError):
    """A file or value from the user is wrong; the message says what, where and what to do."""


class WorkFailed(RuntimeError):
    """Something outside touchbeam failed: a device, a port, a disk or a person."""


Path = tuple[str | int, ...]
# One slip can break a whole file, and nobody reads more than a screen of problems.
MOST_PROBLEMS = 50
"""Most problems of a study file that are listed at once."""


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
    def of_key(cls, key: str, rule: str, value: object, hint: str = "") -> "Problem":
        """Return the problem of a key such as `design.repeats`."""
        return cls(key, rule, str(value), hint, tuple(key.split(".")))

    def __str__(self) -> str:
        """Return the problem in one line."""
        line = f"{self.where}: {self.rule}, got {self.value}"
        return f"{line}; {self.hint}" if self.hint else line

    def located(self, source: str) -> str:
        """Return the problem in one line, preceded by the file and the line number."""
        place = str(PurePath(source).parent / self.file) if self.file else source
        return f"{place}:{self.line}: {self}" if self.line else f"{place}: {self}"
