"""The screens of this computer, and their numbers shown on them.

A process of its own lists and numbers them, because a lost display ends every process that has a
connection to it.
"""

import json
import re
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from typing import Any

import pyglet

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
        # A connector keeps its name when the screens are arranged anew; place and size change.
        if self.name and other.name:
            return self.name == other.name
        return replace(self, number=0, name=None) == replace(other, number=0, name=None)


def listed_screens(touchbeam: Sequence[str]) -> tuple[ScreenPlace, ...]:
    """Return the screens of the display; none if there is no display that answers."""
    # A computer without screens can still run sessions at the console, so that nothing fails here.
    with suppress(ValueError):
        listed = json.loads(_printed([*touchbeam, "participant-screens"], _WITHIN_S))
        return tuple(ScreenPlace(**screen) for screen in listed)
    return ()


def _printed(command: Sequence[str], within_s: float) -> str:
    """Return what `command` prints; nothing if it fails or takes too long."""
    with suppress(OSError, subprocess.SubprocessError):
        return subprocess.run(
            command, capture_output=True, text=True, check=True, timeout=within_s
        ).stdout
    return ""


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
            # The process shows its numbers until then, so that a killed session ends it, too.
            process.stdin.close()
            try:
                process.wait(_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()


# The process that lists the screens of the display and shows their numbers on them.
#
# The import of pyglet's windows needs a display, so only this process imports them.

_XRANDR_WITHIN_S = 5.0
_FRAME_S = 0.05
_MONITOR = re.compile(
    r" (?P<width>\d+)/\d+x(?P<height>\d+)/\d+\+(?P<x>\d+)\+(?P<y>\d+) +(?P<name>\S+)$"
)

Place = tuple[int, int, int, int]
"""x, y, width and height in pixels."""


def connectors(listed: str) -> dict[Place, str]:
    """Return the connector at each place in the output of `xrandr --listmonitors`.

    >>> connectors(" 0: +*HDMI-1 1920/480x1080/270+1280+0  HDMI-1")
    {(1280, 0, 1920, 1080): 'HDMI-1'}
    """
    monitors = filter(None, map(_MONITOR.search, listed.splitlines()))
    return {
        (int(each["x"]), int(each["y"]), int(each["width"]), int(each["height"])): each["name"]
        for each in monitors
    }


def print_screens() -> None:
    # Without xrandr the screens are known by place and size alone.
    names = connectors(_printed(["xrandr", "--listmonitors"], _XRANDR_WITHIN_S))
    screens = [
        asdict(ScreenPlace(number=number, x=x, y=y, width=width, height=height, name=name))
        for number, screen in enumerate(_screens())
        for x, y, width, height in [(screen.x, screen.y, screen.width, screen.height)]
        for name in [names.get((x, y, width, height))]
    ]
    print(json.dumps(screens))


def show_numbers() -> None:
    """Show on each screen its number until the standard input ends."""
    ended = threading.Event()

    def wait_for_end() -> None:
        sys.stdin.read()
        ended.set()

    # A thread, because reading blocks and the windows must go on answering the system.
    threading.Thread(target=wait_for_end, daemon=True).start()
    windows = [_numbered(number, screen) for number, screen in enumerate(_screens())]
    while not ended.wait(_FRAME_S):
        for window, label in windows:
            window.switch_to()
            window.dispatch_events()
            window.clear()
            label.draw()
            window.flip()


def _screens() -> list[Any]:
    return list(pyglet.canvas.get_display().get_screens())


def _numbered(number: int, screen: Any) -> tuple[Any, Any]:
    width, height = screen.width, screen.height
    window = pyglet.window.Window(width, height, screen=screen, style="borderless")
    window.set_location(screen.x, screen.y)
    label = pyglet.text.Label(
        str(number),
        font_size=height // 3,
        x=width // 2,
        y=height // 2,
        anchor_x="center",
        anchor_y="center",
    )
    return window, label
