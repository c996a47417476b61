"""A program on a terminal of its own, and what stands on that terminal's screen."""

import codecs
import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

_CONTROL = re.compile(r"\x1b\[([0-9;?]*)([A-Za-z])|\r|\n|\x07")


@dataclass
class Screen:
    """What a terminal shows: text, cursor to a place, and nothing that moves what is there."""

    width: int
    height: int
    rings: int = 0
    rows: list[str] = field(default_factory=list)
    _row: int = 0
    _column: int = 0
    _left: str = ""

    def feed(self, written: str) -> None:
        """Show what was written."""
        self._left += written
        at = 0
        for control in _CONTROL.finditer(self._left):
            self._put(self._left[at : control.start()])
            self._obey(control[0], control[1] or "", control[2] or "")
            at = control.end()
        begun = self._left.rfind("\x1b", at)
        end = begun if begun >= 0 else len(self._left)
        self._put(self._left[at:end])
        self._left = self._left[end:]

    def _put(self, text: str) -> None:
        while len(self.rows) <= self._row:
            self.rows.append("")
        row = self.rows[self._row].ljust(self._column)
        self.rows[self._row] = row[: self._column] + text + row[self._column + len(text) :]
        self._column += len(text)

    def _obey(self, control: str, numbers: str, letter: str) -> None:
        if control == "\x07":
            self.rings += 1
        elif control == "\n":
            self._row += 1
        elif control == "\r":
            self._column = 0
        elif letter == "H":
            self._row = self._column = 0
        elif letter == "h" and numbers == "?1049":
            self.rows, self._row, self._column = [], 0, 0

    @property
    def text(self) -> str:
        """The screen's lines."""
        return "\n".join(row.rstrip() for row in self.rows)


@dataclass
class OnTerminal:
    """A running program with its keyboard and screen."""

    process: "subprocess.Popen[bytes]"
    keyboard: int
    screen: Screen

    def __post_init__(self) -> None:
        self._text = codecs.getincrementaldecoder("utf-8")("replace")

    def type(self, keys: str) -> None:
        """Press keys."""
        os.write(self.keyboard, keys.encode())

    def look(self, seconds: float = 0.02) -> bool:
        """Take what is written within `seconds`; False once the program has closed the terminal."""
        ready, _, _ = select.select([self.keyboard], [], [], seconds)
        if not ready:
            return True
        try:
            written = os.read(self.keyboard, 65536)
        except OSError:
            return False
        self.screen.feed(self._text.decode(written))
        return bool(written)

    def watch(self, until: Callable[[str], bool], within_s: float = 60.0) -> str:
        """Look until the screen's text is as wanted; return it."""
        end_s = time.monotonic() + within_s
        while not until(self.screen.text):
            assert time.monotonic() < end_s, self.screen.text
            assert self.look(), f"the program has ended\n{self.screen.text}"
        return self.screen.text

    def end(self, within_s: float = 60.0) -> int:
        """Take everything until the program ends; return its exit code."""
        end_s = time.monotonic() + within_s
        while self.look() and time.monotonic() < end_s:
            pass
        return self.process.wait(within_s)


@contextmanager
def on_terminal(
    command: Sequence[str], width: int, height: int, **environment: str
) -> Iterator[OnTerminal]:
    """Run `command` on a terminal of this size; kill it if it is still there afterwards."""
    keyboard, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))
    inherited = {name: value for name, value in os.environ.items() if name not in _SIZES}
    process = subprocess.Popen(
        command,
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        env={**inherited, "TERM": "xterm-256color", **environment},
        start_new_session=True,
    )
    os.close(terminal)
    try:
        yield OnTerminal(process, keyboard, Screen(width, height))
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
        os.close(keyboard)


_SIZES = {"COLUMNS", "LINES"}
