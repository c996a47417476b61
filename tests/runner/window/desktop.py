"""A desk as people have it: a display with a window manager, monitors, a layout of the keyboard.

Only a window manager gives a window its place and the keyboard, takes them away and minimises it;
only a layout says what a key types.
"""

import os
import shlex
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.runner.window.person import virtual_display
from tests.system.pty_screen import Screen

PACKAGES = {
    "Xvfb": "xvfb",
    "openbox": "openbox",
    "script": "bsdutils",
    "setxkbmap": "x11-xkb-utils",
    "xdotool": "xdotool",
    "xprop": "x11-utils",
    "xrandr": "x11-xserver-utils",
    "xset": "x11-xserver-utils",
    "xterm": "xterm",
}
"""What a desk is made of, and the Debian package of each."""
PARTICIPANT, CONSOLE = "touchbeam", "console"
"""Titles of the two windows of a session."""
_WITHIN_S = 60.0
_LOOK_EVERY_S = 0.02


@dataclass(frozen=True, kw_only=True)
class Monitor:
    """A monitor of the desk, in pixels."""

    width: int
    height: int
    x: int = 0
    y: int = 0

    def __str__(self) -> str:
        # Behind the slashes xrandr wants the size in mm, here that of 96 dots per inch.
        wide, high = (f"{side}/{round(side * 25.4 / 96)}" for side in (self.width, self.height))
        return f"{wide}x{high}+{self.x}+{self.y}"


BESIDE = (Monitor(width=1280, height=1024), Monitor(width=1024, height=768, x=1280))
"""The operator's monitor, number 0, and the participant's to the right of it, number 1."""


def require_desk() -> None:
    """Skip the test, and say why, if something is missing that a desk is made of."""
    missing = {package for tool, package in PACKAGES.items() if shutil.which(tool) is None}
    if missing:
        pytest.skip(f"needs {', '.join(sorted(missing))}; make test installs them")


@contextmanager
def desk(*monitors: Monitor) -> Iterator["Desk"]:
    """Yield a desk with these monitors, or one of 1280 by 1024, with a US keyboard."""
    require_desk()
    placed = monitors or BESIDE[:1]
    size = (max(m.x + m.width for m in placed), max(m.y + m.height for m in placed))
    with virtual_display(*size) as display:
        made = Desk(display)
        made.run("xset", "s", "off")
        for number, monitor in enumerate(placed):
            # The display has one output. Monitors without any are still monitors for everybody.
            output = "none" if number else "screen"
            made.run("xrandr", "--setmonitor", f"monitor-{number}", str(monitor), output)
        made.layout("us")
        with made.running("openbox", "--sm-disable"):
            until(lambda: "window id" in made.said("xprop", "-root", "_NET_SUPPORTING_WM_CHECK"))
            yield made


def until(is_so: Callable[[], object], within_s: float = _WITHIN_S) -> float:
    """Look until it is so; return after how many seconds it was."""
    began_s = time.monotonic()
    while not is_so():
        assert time.monotonic() < began_s + within_s, f"not so within {within_s:g} s"
        time.sleep(_LOOK_EVERY_S)
    return time.monotonic() - began_s


@dataclass
class Desk:
    """A person's hands at the keyboard, at the mouse and at the window manager of `display`."""

    display: str

    @property
    def environment(self) -> dict[str, str]:
        """What a program needs to appear on this desk."""
        return {**os.environ, "DISPLAY": self.display}

    def run(self, *command: str) -> None:
        """Run `command` here; a failure ends the test."""
        subprocess.run(command, env=self.environment, check=True, capture_output=True)

    def said(self, *command: str) -> str:
        """Return what `command` prints here, nothing if it fails."""
        done = subprocess.run(
            command, env=self.environment, check=False, capture_output=True, text=True
        )
        return done.stdout.strip()

    @contextmanager
    def running(self, *command: str, **environment: str) -> Iterator["subprocess.Popen[bytes]"]:
        """Run `command` here and end it afterwards."""
        process = subprocess.Popen(
            command,
            env={**self.environment, **environment},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            yield process
        finally:
            process.terminate()
            process.wait()

    @contextmanager
    def terminal(
        self, command: Sequence[str], kept: Path, environment: Mapping[str, str] | None = None
    ) -> Iterator["Terminal"]:
        """Run `command` in a terminal's window; `kept` is a file for what it prints."""
        # `script` hands on what is typed and keeps a copy of what is printed.
        words = [
            "script",
            "--quiet",
            "--flush",
            "--return",
            "--command",
            shlex.join(command),
            str(kept),
        ]
        window = ["xterm", "-title", CONSOLE, "-geometry", "100x30+20+40", "-fa", "Monospace"]
        with self.running(*window, "-e", *words, **(environment or {})) as process:
            self.focus(CONSOLE)
            yield Terminal(process, kept)

    # Windows.

    def window(self, title: str) -> str:
        """Return the number of the window with this title; wait until it is there."""
        ids: list[str] = []

        def is_there() -> bool:
            ids[:] = self.said("xdotool", "search", "--name", f"^{title}$").split()
            return bool(ids)

        until(is_there)
        return ids[-1]

    def focus(self, title: str) -> None:
        """Give a window the keyboard, as a click on it or on its name in the task bar does."""
        number = self.window(title)

        def has_it() -> bool:
            # Again, because a window that opens just now takes the keyboard after this one.
            self.run("xdotool", "windowactivate", number)
            return self.focused() == title

        until(has_it)

    def focused(self) -> str:
        """Return the title of the window that has the keyboard; nothing if none has it."""
        return self.said("xdotool", "getwindowfocus", "getwindowname")

    def minimise(self, title: str) -> None:
        """Minimise a window; `focus` brings it back."""
        number = self.window(title)
        self.run("xdotool", "windowminimize", number)
        until(lambda: "Iconic" in self.said("xprop", "-id", number, "WM_STATE"))

    def place(self, title: str) -> Monitor:
        """Return where a window is, without its frame, and its size."""
        shown = self.said("xdotool", "getwindowgeometry", "--shell", self.window(title))
        values = dict(line.split("=", 1) for line in shown.splitlines() if "=" in line)
        x, y, width, height = (int(values[name]) for name in ("X", "Y", "WIDTH", "HEIGHT"))
        return Monitor(width=width, height=height, x=x, y=y)

    def remove_monitor(self, number: int) -> None:
        """Take a monitor away, as somebody who pulls its cable."""
        self.run("xrandr", "--delmonitor", f"monitor-{number}")

    # The keyboard and the mouse.

    def layout(self, name: str) -> None:
        """Connect a keyboard of another country, such as `fr`."""
        self.run("setxkbmap", "-layout", name)

    def num_lock(self, *, on: bool) -> None:
        """Switch the keypad to digits, or to arrows."""
        if self._num_lock_is_on() is not on:
            self.key("Num_Lock")
        until(lambda: self._num_lock_is_on() is on)

    def _num_lock_is_on(self) -> bool:
        return "Num Lock:    on" in self.said("xset", "q")

    def key(self, *names: str) -> None:
        """Press and release keys, each named by what it types or, from 10, by its number."""
        self.run("xdotool", "key", *names)

    def move(self, title: str, x: int, y: int) -> None:
        """Move a window, so that others are seen beside it."""
        self.run("xdotool", "windowmove", self.window(title), str(x), str(y))

    def hold(self, name: str, seconds: float) -> None:
        """Press a key, hold it, release it."""
        self.run("xdotool", "keydown", name, "sleep", f"{seconds:g}", "keyup", name)

    def type(self, text: str) -> None:
        """Type `text`, a key after the other."""
        self.run("xdotool", "type", "--delay", "30", text)

    def click(self, x: int, y: int, button: int = 1) -> None:
        """Press and release a button of the mouse at a point of the display."""
        self.run("xdotool", "mousemove", str(x), str(y), "click", str(button))

    def picture(self, file: Path) -> None:
        """Keep what stands on the display."""
        from PIL import ImageGrab

        ImageGrab.grab(xdisplay=self.display).save(file)


@dataclass
class Terminal:
    """A terminal's window."""

    process: "subprocess.Popen[bytes]"
    kept: Path
    _screen: Screen = field(default_factory=lambda: Screen(100, 30), init=False)
    _read: int = field(default=0, init=False)

    @property
    def text(self) -> str:
        """What stands on its screen."""
        written = self.kept.read_bytes() if self.kept.exists() else b""
        # Up to a whole line or control, as `Screen` puts its parts together; a letter is whole.
        fresh = written[self._read :].decode("utf-8", "ignore")
        self._read += len(fresh.encode())
        self._screen.feed(fresh)
        return self._screen.text

    def watch(self, shown: str, within_s: float = _WITHIN_S) -> float:
        """Look until `shown` stands on the screen; return after how many seconds it did."""
        try:
            return until(lambda: shown in self.text, within_s)
        except AssertionError as error:
            error.add_note(self.text)
            raise

    def end(self) -> int:
        """Wait until the program has ended; return its exit code."""
        self.process.wait(_WITHIN_S)
        return int(self.text.rpartition('COMMAND_EXIT_CODE="')[2].partition('"')[0])
