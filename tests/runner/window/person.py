"""A person at a real window on a virtual display: looks at its pixels, uses a pointer or keys.

Nothing tells this person which screen stands there but what can be seen.
"""

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from PIL import Image, ImageGrab

from runner.window.elements import ACCENT, INK, WHITE, pixels_per_unit
from runner.window.response import EARLY_S

Sight = Literal["nothing", "button", "two", "three", "scale"]
Controls = Literal["mouse", "keyboard"]

BUTTON = (-150.0, -215.0)
ANSWERS = ((-190.0, 95.0), (-190.0, 17.0), (-190.0, -61.0))
SCALE_LINE = (-33.0, 50.0)
LOOK_EVERY_S = 0.1


@contextmanager
def virtual_display(
    width: int, height: int, depth: int = 24, second: tuple[int, int] | None = None
) -> Iterator[str]:
    """Start a virtual display, numbered by the server, and end it afterwards.

    With the size of a `second` screen the display has two.
    """
    more = [] if second is None else ["+xinerama", "-screen", "1", f"{second[0]}x{second[1]}x24"]
    reading, writing = os.pipe()
    server = subprocess.Popen(
        [
            "Xvfb",
            "-displayfd",
            str(writing),
            "-screen",
            "0",
            f"{width}x{height}x{depth}",
            "-noreset",
            *more,
        ],
        pass_fds=[writing],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    try:
        with os.fdopen(reading) as answer:
            yield f":{answer.readline().strip()}"
    finally:
        server.terminate()
        server.wait()


@dataclass
class Person:
    """Sees the display and does what the screens ask, with the mouse or the keyboard alone.

    `choices` are the answers to give, as positions; `scores` the scores. One who is `hasty` leaves
    it to somebody who strikes Enter all the time to go on and to confirm. `revived` counts the
    pages whose button worked again after the answer.
    """

    display: str
    control: Controls
    choices: list[int] = field(default_factory=list)
    scores: list[int] = field(default_factory=list)
    hasty: bool = False
    revived: int = 0
    seen: list[Sight] = field(default_factory=list)
    given: list[int] = field(default_factory=list)
    scored: list[int] = field(default_factory=list)

    def look(self) -> Image.Image:
        """Return the pixels on the display."""
        return ImageGrab.grab(xdisplay=self.display)

    def look_later(self) -> None:
        """Let the page change."""
        time.sleep(LOOK_EVERY_S)

    def sight(self) -> Sight:
        """Return the kind of page."""
        image = self.look()
        colours = [_colour(image, point) for point in (BUTTON, *ANSWERS, SCALE_LINE)]
        button, first, second, third, line = colours
        if first in {WHITE, ACCENT} and second in {WHITE, ACCENT}:
            return "three" if third in {WHITE, ACCENT} else "two"
        if line == INK:
            return "scale"
        return "button" if button == ACCENT else "nothing"

    def act(self) -> None:
        """Do what the page asks for, once, and wait for the next page."""
        sight = self.sight()
        if sight == "nothing" or (sight == "button" and self.hasty):
            return self.look_later()
        if not self.seen or self.seen[-1] != sight:
            self.seen.append(sight)
        time.sleep(EARLY_S)  # nobody reacts faster, and what comes faster is not taken
        if sight == "scale":
            self._score(self.scores[len(self.scored)])
        elif sight != "button":
            self._choose(self.choices[len(self.given)])
        return self._confirm_and_wait(sight)

    def _choose(self, position: int) -> None:
        self.given.append(position)
        if self.control == "mouse":
            self.click(*ANSWERS[position])
        else:
            self.key(str(position + 1))

    def _score(self, score: int) -> None:
        self.scored.append(score)
        if self.control == "mouse":
            self.click((score - 5) * 66.0, 50.0)
        else:
            self.key(*str(score))

    def _confirm_and_wait(self, before: Sight) -> None:
        until_s = time.monotonic() + 30.0  # a loaded machine takes its time
        if self.hasty:
            while self.sight() == before and time.monotonic() < until_s:
                self.look_later()
            return
        text, answered = b"", False
        # Alike twice, because a page that is being drawn would be taken for another one later.
        while time.monotonic() < until_s:
            earlier, text = text, _text(image := self.look())
            if _is_live(image) and text == earlier:
                break
            self.look_later()
        self.click(*BUTTON) if self.control == "mouse" else self.key("Return")
        while time.monotonic() < until_s:
            self.look_later()
            is_live = _is_live(image := self.look())
            # Seen twice, because a page that is being drawn differs from itself for a moment.
            if _text(image) != text:
                self.look_later()
                if _text(self.look()) != text:
                    return
            self.revived += is_live and answered
            answered |= not is_live

    @cached_property
    def size(self) -> tuple[int, int]:
        """The display's."""
        return self.look().size

    def click(self, x: float, y: float) -> None:
        """Press and release at a point of the canvas."""
        across, down = _pixel(self.size, (x, y))
        self.xdotool("mousemove", str(across), str(down), "click", "1")

    def key(self, *names: str) -> None:
        """Press and release keys."""
        self.xdotool("key", *names)

    def close_window(self) -> None:
        """Destroy the window and check that it is gone."""
        find = ["xdotool", "search", "--name", "touchbeam"]
        environment = {**os.environ, "DISPLAY": self.display}
        while subprocess.run(find, env=environment, capture_output=True, check=False).stdout:
            subprocess.run([*find, "windowclose"], env=environment, check=False)
            self.look_later()

    def xdotool(self, *arguments: str) -> None:
        """Move the real pointer and keyboard of the display."""
        subprocess.run(
            ["xdotool", *arguments], env={**os.environ, "DISPLAY": self.display}, check=True
        )


def _pixel(size: tuple[int, int], point: tuple[float, float]) -> tuple[int, int]:
    scale = pixels_per_unit(*size)
    return round(size[0] / 2 + point[0] * scale), round(size[1] / 2 - point[1] * scale)


def _is_live(image: Image.Image) -> bool:
    """Return whether the button works."""
    return _colour(image, BUTTON) == ACCENT


def _text(image: Image.Image) -> bytes:
    """Return the upper half of the page: a different text means a different page."""
    return image.crop((0, 0, image.width, image.height // 2)).tobytes()


def _colour(image: Image.Image, point: tuple[float, float]) -> str:
    pixel = image.getpixel(_pixel(image.size, point))
    assert isinstance(pixel, tuple)
    red, green, blue = pixel[:3]
    return f"#{red:02x}{green:02x}{blue:02x}"
