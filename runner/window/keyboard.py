"""Keys of the participant's window: what each one means, and whether it went down or repeats.

The import of pyglet's keys needs a display, so only the window's own process imports this module.
"""

import sys
import unicodedata
from collections.abc import Callable
from ctypes import byref, c_char, c_int, c_uint, c_ulong
from typing import Any

from pyglet.window import key

from runner.window.elements import STOP, Input, Key, Typed

_NAMES = {
    key.ENTER: "enter",
    key.NUM_ENTER: "enter",
    key.BACKSPACE: "backspace",
    key.ESCAPE: "escape",
    key.LEFT: "left",
    key.RIGHT: "right",
    key.UP: "up",
    key.DOWN: "down",
    **{getattr(key, f"_{digit}"): str(digit) for digit in range(10)},
    **{getattr(key, f"NUM_{digit}"): str(digit) for digit in range(10)},
    **dict.fromkeys((key.MINUS, key.NUM_SUBTRACT), "-"),
    **dict.fromkeys((key.PERIOD, key.COMMA, key.NUM_DECIMAL, key.NUM_SEPARATOR), "."),
    # Without NumLock; the digits of the keypad are found by their place.
    key.NUM_DELETE: ".",
}
SYMBOLS = {name: symbol for symbol, name in _NAMES.items()}


def meaning(
    symbol: int | None, modifiers: int, digit: str = "", *, is_e: bool = False
) -> str | None:
    """Return the name of a key, that of the emergency stop for Ctrl-E; None if it has none."""
    # Windows reports AltGr, which types a euro sign, as Ctrl and Alt.
    if modifiers & key.MOD_CTRL and not modifiers & key.MOD_ALT and (is_e or symbol == key.E):
        return STOP.name
    return digit or _NAMES.get(symbol)


def listen(window: Any, take: Callable[[Input], object]) -> None:
    """Hand what is typed in pyglet's `window` to `take`."""

    def pressed(symbol: int, modifiers: int) -> bool:
        if name := meaning(symbol, modifiers):
            take(Key(name=name))
        return True  # else pyglet closes the window at Escape

    def typed(text: str) -> bool:
        if text.isprintable():
            take(Typed(text=text))
        return True

    window.push_handlers(on_key_press=pressed, on_text=typed)
    if sys.platform.startswith("linux"):
        _KeysByPlace(window, take)


class _KeysByPlace:
    """The keys of an X server by their numbers, which say where a key lies, whatever it types.

    pyglet tells a key by what it types, so that Shift, NumLock or a lost release confuses it, and
    a key that is held looks as if it went down again and again.
    """

    def __init__(self, window: Any, take: Callable[[Input], object]) -> None:
        from pyglet.libs.x11 import xlib

        self._x, self._window, self._take = xlib, window, take
        self._display = window._x_display
        self._symbol = xlib._lib.XkbKeycodeToKeysym
        self._symbol.restype = c_ulong
        self._symbol.argtypes = [type(self._display), c_uint, c_int, c_int]
        # A key that repeats then goes down again without going up. pyglet asks for it, but on its
        # default connection, while PsychoPy opens one of its own.
        detectable = xlib._lib.XkbSetDetectableAutoRepeat
        self._repeats_are_told = bool(detectable(self._display, 1, byref(c_int())))
        self._look_which_are_down()
        for handlers in (window._event_handlers, window._view_event_handlers):
            handlers[xlib.KeyPress] = handlers[xlib.KeyRelease] = self._on_event
        # Another window has got the releases since the keyboard went there.
        window.push_handlers(on_activate=self._look_which_are_down)

    def _look_which_are_down(self) -> None:
        # By now, and not when the keyboard came: a key that went down in between is taken for one
        # that was held, which is safe.
        states = (c_char * 32)()
        self._x.XQueryKeymap(self._display, states)
        self._down = {at for at in range(256) if states.raw[at // 8] >> at % 8 & 1}

    def _on_event(self, event: Any) -> None:
        # Of each event, because the system composes letters from several.
        text, symbol = self._window._event_text_symbol(event)
        code, state = event.xkey.keycode, event.xkey.state
        if event.type == self._x.KeyRelease:
            self._down.discard(code)
            if not self._repeats_are_told:  # then each repeat comes with a release
                self._look_which_are_down()
            return
        repeated = code in self._down
        self._down.add(code)
        modifiers = self._window._translate_modifiers(state)
        digit = self._digit(code, state)
        if name := meaning(symbol, modifiers, digit, is_e=self._is_e(code)):
            self._take(Key(name=name, repeated=repeated))
        if symbol is not None and key.NUM_SPACE <= symbol <= key.NUM_EQUAL:
            text = text or digit  # without NumLock
        if text and text.isprintable() and not modifiers & (key.MOD_CTRL | key.MOD_ALT):
            self._take(Typed(text=text, repeated=repeated))

    def _digit(self, code: int, state: int) -> str:
        """Return the digit on a key, whether or not it needs Shift or NumLock; else nothing."""
        layout = state >> 13 & 3
        signs = (_sign(self._symbol(self._display, code, layout, level)) for level in range(4))
        values = (unicodedata.decimal(sign, None) for sign in signs)
        return next((str(value) for value in values if value is not None), "")

    def _is_e(self, code: int) -> bool:
        """Return whether a key types an E in any layout that is set up, or lies where E does."""
        layouts = (self._symbol(self._display, code, layout, 0) for layout in range(4))
        return code == _PLACE_OF_E or key.E in layouts


_PLACE_OF_E = 26
"""On a keyboard without Latin letters."""


def _sign(symbol: int) -> str:
    """Return the sign of an X key symbol: Latin, of the keypad, Thai or any other; else a space."""
    if 0x20 < symbol < 0x7F:
        return chr(symbol)
    if key.NUM_0 <= symbol <= key.NUM_9:
        return str(symbol - key.NUM_0)
    if 0xDF0 <= symbol <= 0xDF9:
        return chr(0x0E50 + symbol - 0xDF0)
    return chr(symbol - 0x1000000) if 0x1000100 <= symbol <= 0x110FFFF else " "
