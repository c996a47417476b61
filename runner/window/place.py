"""Where the window is, in pixels of the display: on the screen that was asked for, or not.

A window manager may put a window elsewhere than where it was opened, or move it when a monitor
comes or goes. What counts is what the X server says of the window. Other systems are not asked.
"""

import sys
import time
from collections.abc import Sequence
from ctypes import POINTER, byref, cast
from dataclasses import dataclass
from typing import Any

_MOVES = 3
"""How often the window manager is asked to move the window before the session is refused."""
_OPENS_WITHIN_S, _MOVES_WITHIN_S = 0.6, 3.0
"""How long a window may take to its place: by itself, and once a window manager was asked."""
_STEADY_S = 0.25
"""A window that has just opened may still be moved: it must stay in its place for so long."""
_LOOK_EVERY_S = 0.02


@dataclass(frozen=True, kw_only=True)
class Area:
    """A part of the display, of a screen or a window."""

    x: int
    y: int
    width: int
    height: int

    def __str__(self) -> str:
        return f"{self.width}x{self.height} at {self.x},{self.y}"

    def holds_centre(self, other: "Area") -> bool:
        x, y = other.x + other.width / 2, other.y + other.height / 2
        return self.x <= x < self.x + self.width and self.y <= y < self.y + self.height


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """The screen that the window shall cover or, if it has a `size` of its own, stand on."""

    number: int
    screen: Area
    size: tuple[int, int] | None = None

    def __str__(self) -> str:
        return f"screen {self.number} ({self.screen})"

    def is_met_by(self, window: Area) -> bool:
        if self.size is None:
            return window == self.screen
        return (window.width, window.height) == self.size and self.screen.holds_centre(window)

    def lost(self, window: Area, screens: Sequence[Area]) -> str:
        """Return why the participant may not see the window any more; nothing if they see it."""
        if self.screen not in screens:
            there = ", ".join(f"{number} ({screen})" for number, screen in enumerate(screens))
            return f"lost {self}: this computer now has {there or 'none'}"
        return "" if self.is_met_by(window) else f"left {self}: it is {window}"


def area_of(screen: Any) -> Area:
    """Return the area of one of pyglet's screens."""
    return Area(x=screen.x, y=screen.y, width=screen.width, height=screen.height)


class Placed:
    """A window of pyglet's, `handle`, in its place as far as the system tells it."""

    def __init__(self, handle: Any, wanted: Wanted) -> None:
        self._handle = handle
        self._wanted = wanted
        self._is_asked = sys.platform.startswith("linux")
        self._doubts = 0

    def settle(self) -> bool:
        """Wait until the window stays in its place, move it if need be; return whether it does."""
        if not self._is_asked:
            return True
        stays, moves = self._stays(_OPENS_WITHIN_S), 0
        while not stays and moves < _MOVES:
            self._move()
            stays, moves = self._stays(_MOVES_WITHIN_S), moves + 1
        window = self.area()
        if not stays or window is None:
            return False
        # Pyglet does not follow a window that fills a screen, and takes presses by its old size.
        self._handle._width, self._handle._height = window.width, window.height
        self._handle._update_view_size()
        return True

    def area(self) -> Area | None:
        """Return where the window is; None if it is gone or the system is not asked."""
        if not self._is_asked:
            return None
        from pyglet.libs.x11 import xlib

        seen = xlib.XWindowAttributes()
        if not xlib.XGetWindowAttributes(
            self._handle._x_display, self._handle._window, byref(seen)
        ):
            return None
        x, y = self._handle.get_location()
        return Area(x=x, y=y, width=seen.width, height=seen.height)

    def lost(self) -> str:
        """Return why the participant may not see the window any more, once two looks agree."""
        window = self.area()
        if window is None:
            return ""  # a window that is gone is noticed as such
        display = self._handle.screen.display
        display._screens = []  # else it keeps those of the beginning
        why = self._wanted.lost(window, [area_of(screen) for screen in display.get_screens()])
        self._doubts = self._doubts + 1 if why else 0
        # A window manager may move windows about while it arranges the desktop.
        return why if self._doubts > 1 else ""

    def _stays(self, within_s: float) -> bool:
        began_s = steady_s = time.monotonic()
        while (now_s := time.monotonic()) - began_s < within_s:
            window = self.area()
            if window is None or not self._wanted.is_met_by(window):
                steady_s = now_s
            elif now_s - steady_s >= _STEADY_S:
                return True
            time.sleep(_LOOK_EVERY_S)
        return False

    def _move(self) -> None:
        """Ask the window manager to put the window on its screen.

        A window that fills a screen is not moved: it must cease to, and fill it again.
        """
        from pyglet.libs.x11 import xlib

        screen, number = self._wanted.screen, self._wanted.number
        if self._wanted.size is not None:
            width, height = self._wanted.size
            across, down = (screen.width - width) // 2, (screen.height - height) // 2
            self._handle.set_location(screen.x + across, screen.y + down)
            return
        self._ask("_NET_WM_STATE", 0, self._atom("_NET_WM_STATE_FULLSCREEN"))
        xlib.XMoveResizeWindow(
            self._handle._x_display,
            self._handle._window,
            screen.x,
            screen.y,
            screen.width,
            screen.height,
        )
        # Window managers that know this one need no move.
        self._ask("_NET_WM_FULLSCREEN_MONITORS", number, number, number, number)
        self._ask("_NET_WM_STATE", 1, self._atom("_NET_WM_STATE_FULLSCREEN"))

    def _atom(self, name: str) -> int:
        from pyglet.libs.x11 import xlib

        return int(xlib.XInternAtom(self._handle._x_display, name.encode(), False))

    def _ask(self, what: str, *values: int) -> None:
        """Send the window manager a request (EWMH, "Root Window Messages")."""
        from pyglet.libs.x11 import xlib

        display = self._handle._x_display
        event = xlib.XEvent()
        event.xclient.type = xlib.ClientMessage
        event.xclient.message_type = self._atom(what)
        event.xclient.display = cast(display, POINTER(xlib.Display))
        event.xclient.window = self._handle._window
        event.xclient.format = 32
        for place, value in enumerate(values):
            event.xclient.data.l[place] = value
        mask = xlib.SubstructureRedirectMask | xlib.SubstructureNotifyMask
        xlib.XSendEvent(display, self._handle._get_root(), False, mask, byref(event))
