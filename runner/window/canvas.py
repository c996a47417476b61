"""The psychopy window, which draws pages and collects presses and keys.

The import of psychopy needs a display, so only the window's own process imports this module.
"""

import ctypes
import os
import sys
import tempfile
import time
from functools import partial
from importlib.util import LazyLoader, find_spec, module_from_spec
from pathlib import Path
from typing import Any

import pyglet
import scipy
from pyglet.window import mouse

from protocol.errors import WorkFailed
from runner.window import elements, keyboard, writing
from runner.window.messages import Settings
from runner.window.place import Placed, Wanted, area_of

# Psychopy imports it for the calibration of monitors alone, which no session has: the window opens
# sooner by a third if it comes only when it is used. Where scipy does not have it yet, an import
# from scipy would use it.
if (spec := find_spec("scipy.interpolate")) and spec.loader:
    spec.loader = LazyLoader(spec.loader)
    sys.modules[spec.name] = vars(scipy)["interpolate"] = module_from_spec(spec)
    spec.loader.exec_module(sys.modules[spec.name])

# Psychopy obeys preferences of the user's, such as the kind of window, and fails where it cannot
# write beside them. It looks for their folder here alone; fonts remain the user's own.
_PREFERENCES = tempfile.TemporaryDirectory(prefix="touchbeam-psychopy-")
_OWN = dict.fromkeys(("HOME", "APPDATA"), _PREFERENCES.name)
_USERS = {name: os.environ[name] for name in _OWN.keys() & os.environ.keys()}
os.environ.update(_OWN)
try:
    import psychopy.monitors
    import psychopy.preferences  # noqa: F401
finally:
    for name in _OWN.keys() - _USERS.keys():
        del os.environ[name]
    os.environ.update(_USERS)

from psychopy import logging, visual  # noqa: E402

SMALL_WINDOW_PX = (800, 600)
MOST_KEPT = 1000
LOOK_FOR_WINDOW_EVERY_S = 0.5
# The constants of X and of its window managers (ICCCM 4.1.3.1).
_BELOW_POINTER, _VIEWABLE, _ICONIC = 1, 2, 3


class PsychopyCanvas:
    """An open window. Only `flip` blocks, until the screen refreshes."""

    def __init__(self, settings: Settings) -> None:
        logging.console.setLevel(logging.CRITICAL)
        self._font = _font(settings)
        self._from_the_right = writing.is_from_the_right(settings.wording)
        wanted = _wanted(settings)
        self._window = _window(wanted)
        self._handle = self._window.winHandle
        self._placed = Placed(self._handle, wanted)
        if not self._placed.settle():
            raise WorkFailed(
                f"the participant's window cannot be put on {wanted}: the window manager leaves it "
                f"{self._placed.area()}; choose another one with --screen, or use --ratings console"
            )
        self._scale = float(elements.pixels_per_unit(*self._window.size))
        self._screen = settings.screen
        self._folder = settings.folder
        self.lost = ""
        self._drawn: dict[elements.Element, list[Any]] = {}
        self._inputs: list[tuple[float, elements.Input]] = []
        self.closed = False
        self.state = {"has_keys": self._has_keys(), "is_shown": True}
        self._looked_s = 0.0
        self._window.setMouseVisible(True)
        self._handle.push_handlers(
            on_mouse_press=self._on_press,
            on_mouse_drag=self._on_drag,
            on_mouse_release=self._on_release,
            on_activate=partial(self.state.update, has_keys=True),
            on_deactivate=partial(self.state.update, has_keys=False),
            on_show=partial(self.state.update, is_shown=True),
            on_hide=partial(self.state.update, is_shown=False),
            on_close=self._on_close,
        )
        keyboard.listen(self._handle, self._latched)

    def look(self) -> dict[str, Any]:
        """Return the properties of the screen; None where the system does not report one."""
        rate = getattr(self._handle.screen.get_mode(), "rate", None)
        area = self._placed.area()
        return {
            "screen": self._screen,
            "place_px": area and [area.x, area.y],
            "size_px": [int(side) for side in self._window.size],
            "px_per_unit": self._scale,
            "mm_per_px": self._millimetres_per_pixel(),
            "refresh_hz": float(rate) if rate and 20 < rate < 1000 else None,
            "font": self._font,
        }

    def draw(self, page: elements.Page) -> None:
        for element in page:
            for stimulus in self.stimuli(element):
                stimulus.draw()

    def prepare(self, element: elements.Element) -> None:
        """Build the stimuli of `element` in advance, so that its first frame is not late."""
        self.stimuli(element)

    def stimuli(self, element: elements.Element) -> list[Any]:
        """Return the stimuli that draw `element`, built once: typesetting takes milliseconds."""
        if isinstance(element, elements.Dot):
            return [self._dot(element)]
        if element not in self._drawn:
            if len(self._drawn) > MOST_KEPT:  # a countdown needs a new text each second
                del self._drawn[next(iter(self._drawn))]
            match element:
                case elements.Text():
                    self._drawn[element] = self._text(element)
                case elements.Picture():
                    self._drawn[element] = [self._picture(element)]
                case elements.Outline():
                    self._drawn[element] = [self._outline(element)]
        return self._drawn[element]

    def _picture(self, picture: elements.Picture) -> Any:
        image = visual.ImageStim(
            self._window,
            image=str(Path(self._folder) / picture.name),
            pos=(picture.box.x * self._scale, picture.box.y * self._scale),
        )
        width, height = image.size
        fits = min(picture.box.width / width, picture.box.height / height) * self._scale
        image.size = (width * fits, height * fits)
        return image

    def flip(self) -> float:
        self._window.flip(clearBuffer=True)
        flipped_s = time.monotonic()
        # Not at each frame, because it is a round trip to the X server.
        if flipped_s - self._looked_s > LOOK_FOR_WINDOW_EVERY_S:
            self._looked_s = flipped_s
            self.lost = self.lost or self._placed.lost()
            self.closed = self.closed or not self.is_there()
            # No event tells it on a desktop that keeps minimised windows and only hides them.
            self.state["is_shown"] = self._is_shown()
        return flipped_s

    def inputs(self) -> list[tuple[float, elements.Input]]:
        self._handle.dispatch_events()
        taken, self._inputs = self._inputs, []
        return taken

    def press(self, given: elements.Input) -> None:
        """Put `given` into the window's own queue of events, where a person's keys arrive."""
        put = self._handle.dispatch_event
        match given:
            case elements.Key(name=name):
                put("on_key_press", keyboard.SYMBOLS[name], 0)
            case elements.Typed(text=text):
                put("on_text", text)
            case elements.Pressed(x=x, y=y):
                place = elements.in_window(x, y, self._handle.get_size())
                put("on_mouse_press", *place, mouse.LEFT, 0)
            case elements.Released():
                put("on_mouse_release", 0, 0, mouse.LEFT, 0)

    def close(self) -> None:
        self._window.close()

    def _dot(self, dot: elements.Dot) -> Any:
        # One for all places: a dot moves with each frame, and building one takes too long for that.
        rest = elements.Dot(x=0, y=0, radius=dot.radius, fill=dot.fill)
        if rest not in self._drawn:
            radius = dot.radius * self._scale
            self._drawn[rest] = [
                visual.Circle(
                    self._window, radius=radius, edges=64, fillColor=dot.fill, lineColor=None
                )
            ]
        stimulus = self._drawn[rest][0]
        stimulus.pos = (dot.x * self._scale, dot.y * self._scale)
        return stimulus

    def _outline(self, outline: elements.Outline) -> Any:
        return visual.ShapeStim(
            self._window,
            vertices=[(x * self._scale, y * self._scale) for x, y in outline.points],
            closeShape=len(outline.points) > 2,
            fillColor=outline.fill,
            lineColor=outline.edge,
            lineWidth=outline.width * self._scale,
        )

    def _text(self, text: elements.Text) -> list[Any]:
        lines = elements.wrapped(text.text, text.size, text.box.width)
        step = text.size * elements.LINE_HEIGHT
        top = text.box.y + step * (len(lines) - 1) / 2
        return [
            visual.TextStim(
                self._window,
                text=writing.drawn(line, from_the_right=self._from_the_right),
                font=self._font,
                # Whole pixels, as letters are drawn; `ROUNDING` allows for it.
                height=int(text.size * self._scale),
                color=text.colour,
                pos=(round(text.box.x * self._scale), round((top - number * step) * self._scale)),
                wrapWidth=1e6,
            )
            for number, line in enumerate(lines)
            if line
        ]

    # The other buttons of a mouse decide nothing.

    def _on_press(self, x: int, y: int, button: int, _: int) -> bool:
        return button != mouse.LEFT or self._latched(elements.Pressed(**self._on_canvas(x, y)))

    def _on_drag(self, x: int, y: int, _dx: int, _dy: int, buttons: int, _: int) -> bool:
        return not buttons & mouse.LEFT or self._latched(elements.Dragged(**self._on_canvas(x, y)))

    def _on_release(self, _x: int, _y: int, button: int, _: int) -> bool:
        return button != mouse.LEFT or self._latched(elements.Released())

    def _on_close(self) -> bool:
        # The loop of the server ends, and tells the session before it closes the window.
        self.closed = True
        return True

    def _latched(self, given: elements.Input) -> bool:
        # The time of its arrival here, because pyglet's events have none.
        self._inputs.append((time.monotonic(), given))
        return True

    def _on_canvas(self, x: float, y: float) -> dict[str, float]:
        # By the size in which the pointer is told: on macOS in points, of two pixels each way.
        across, up = elements.on_canvas(x, y, self._handle.get_size())
        return {"x": across, "y": up}

    def is_there(self) -> bool:
        """Ask the X server whether the window exists: no event reports that it was destroyed."""
        attributes = self._attributes()
        return attributes is None or attributes.root != 0

    def _attributes(self) -> Any:
        """Return what the X server knows of the window, all 0 if it is gone; None elsewhere."""
        if not sys.platform.startswith("linux"):
            return None
        from pyglet.libs.x11 import xlib

        attributes = xlib.XWindowAttributes()
        display, window = self._handle._x_display, self._handle._window
        xlib.XGetWindowAttributes(display, window, ctypes.byref(attributes))
        return attributes

    def _has_keys(self) -> bool:
        """Return whether keys reach the window as it opens; later events tell it."""
        if not sys.platform.startswith("linux"):
            return True
        from pyglet.libs.x11 import xlib

        focus = ctypes.c_ulong()
        xlib.XGetInputFocus(
            self._handle._x_display, ctypes.byref(focus), ctypes.byref(ctypes.c_int())
        )
        # Without a window manager keys may go to whatever lies below the pointer.
        return focus.value in {self._handle._window, self._handle._view, _BELOW_POINTER}

    def _is_shown(self) -> bool:
        """Return whether the window is on the screen and not minimised."""
        attributes = self._attributes()
        if attributes is None:
            return self.state["is_shown"]  # as events told
        from pyglet.libs.x11 import xlib

        name = xlib.XInternAtom(self._handle._x_display, b"WM_STATE", True)
        data, length = self._handle.get_single_property(self._handle._window, name, name)
        value = ctypes.cast(data, ctypes.POINTER(ctypes.c_ulong))[0] if length else None
        if data:
            xlib.XFree(data)
        return attributes.map_state == _VIEWABLE and value != _ICONIC

    def _millimetres_per_pixel(self) -> float | None:
        """Return the size that the X server reports; None on other systems."""
        if not sys.platform.startswith("linux"):
            return None
        from pyglet.libs.x11 import xlib

        display = self._handle.screen.display._display
        width_px, width_mm = xlib.XDisplayWidth(display, 0), xlib.XDisplayWidthMM(display, 0)
        return round(width_mm / width_px, 5) if width_mm > 0 else None


def _font(settings: Settings) -> str:
    """Return the first installed font of the language that has every character to be drawn."""
    wording = settings.wording
    installed = filter(pyglet.font.have_font, wording.fonts)
    best = writing.best_font(installed, _has_sign, settings.signs)
    if best is None:
        raise WorkFailed(elements.missing_font(wording.code, wording.fonts, wording.font_package))
    font, lacking = best
    if lacking:
        raise WorkFailed(writing.lacking_font(font, lacking, wording.code))
    return font


def _has_sign(font: str, sign: str) -> bool:
    # Only FreeType's fonts can be asked; other systems take a missing character from another font.
    face = getattr(pyglet.font.load(font), "face", None)
    return face is None or face.get_character_index(sign) != 0


def _wanted(settings: Settings) -> Wanted:
    """Return the screen and size asked for; raises `WorkFailed` if there is no such screen."""
    screens = pyglet.canvas.get_display().get_screens()
    if settings.screen >= len(screens):
        sizes = ", ".join(f"{n} ({s.width}x{s.height})" for n, s in enumerate(screens))
        raise WorkFailed(f"--screen {settings.screen} does not exist; this computer has {sizes}")
    return Wanted(
        number=settings.screen,
        screen=area_of(screens[settings.screen]),
        size=SMALL_WINDOW_PX if settings.windowed else None,
    )


def _window(wanted: Wanted) -> Any:
    return visual.Window(
        size=wanted.size or (wanted.screen.width, wanted.screen.height),
        fullscr=wanted.size is None,
        screen=wanted.number,
        units="pix",
        color=elements.BACKGROUND,
        title="touchbeam",
        allowGUI=True,
        checkTiming=False,
        winType="pyglet",
    )
