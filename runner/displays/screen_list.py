"""The screens of this computer, and their numbers shown on them.

A process of its own lists and numbers them, because a lost display ends every process that has a
connection to it.
"""

import json
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace

_WITHIN_S = 20.0


@dataclass(frozen=True, kw_only=True)
class ScreenPlace:
    """A screen; `name` is its connector, None where the system does not report one."""

    number: int
    x: int
    y: int
    width: int
    height: int
    name: str | None = None

    def __str__(self) -> str:
        name = f" ({self.name})" if self.name else ""
        return f"{self.number}: {self.width}x{self.height} at {self.x},{self.y}{name}"

    def is_same(self, other: "ScreenPlace") -> bool:
        """Return whether both are one screen: by connector, else by place and size."""
        if self.name and other.name:
            return self.name == other.name
        return replace(self, number=0, name=None) == replace(other, number=0, name=None)


def listed_screens(touchbeam: Sequence[str]) -> tuple[ScreenPlace, ...]:
    """Return the screens of the display; none if there is no display that answers."""
    with suppress(OSError, subprocess.SubprocessError, ValueError):
        command = [*touchbeam, "participant-screens"]
        done = subprocess.run(
            command, capture_output=True, text=True, check=True, timeout=_WITHIN_S
        )
        return tuple(ScreenPlace(**screen) for screen in json.loads(done.stdout))
    return ()


@contextmanager
def numbered_screens(touchbeam: Sequence[str]) -> Iterator[None]:
    """Show on each screen its number while the body runs."""
    with subprocess.Popen(
        [*touchbeam, "participant-screens", "--show"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C reaches only the session, which closes the pipe
    ) as process:
        try:
            yield
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
