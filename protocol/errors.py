"""Errors that are not ours, told apart by exit codes, and problems of a study file."""

from dataclasses import dataclass
from pathlib import PurePath


class BadInput(ValueError):
    """A file or value that was given is wrong; the message says what, where and what to do."""


class WorkFailed(Exception):
    """Something that the work needs - a device, a port, a disk, a person - does not do its part."""


Path = tuple[str | int, ...]
MOST_PROBLEMS = 50
"""Of a study file, listed at once."""


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Something wrong with a study: where it stands, the broken rule, the value, what to do.

    `path` leads to the key in the study file, `line` says where that is, counted from 1. `file` is
    another file beside the study file, if it stands there.
    """

    where: str
    rule: str
    value: str
    hint: str = ""
    path: Path = ()
    line: int | None = None
    file: str = ""

    def __str__(self) -> str:
        """One line for a person."""
        line = f"{self.where}: {self.rule}, got {self.value}"
        return f"{line}; {self.hint}" if self.hint else line

    def located(self, source: str) -> str:
        """The same line with the file, and the line in it, in front."""
        place = str(PurePath(source).parent / self.file) if self.file else source
        return f"{place}:{self.line}: {self}" if self.line else f"{place}: {self}"
