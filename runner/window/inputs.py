"""What a hand can do to the window: presses at points of the canvas, and keys by name."""

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Pressed:
    """A mouse button or a fingertip goes down."""

    x: float
    y: float


@dataclass(frozen=True, kw_only=True)
class Dragged:
    """It moves while it is down."""

    x: float
    y: float


@dataclass(frozen=True, kw_only=True)
class Released:
    """It goes up."""


@dataclass(frozen=True, kw_only=True)
class Key:
    """A key goes down: a digit, left, right, up, down, enter, backspace or escape."""

    name: str


Input = Pressed | Dragged | Released | Key
