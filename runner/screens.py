"""What stands before the participant, and what comes back. No screen says what the device does."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from device.errors import UNKNOWN
from protocol.journal.records import ReadBack
from protocol.study.questions import Question, Rating
from protocol.study.touch import Touch, TouchDefaults, touch_s

Order = Literal["pause", "stop", "repeat", "emergency stop"]


@dataclass(frozen=True, kw_only=True)
class Notice:
    """A text to read; nothing to answer."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Welcome:
    """The first screen, with the reference of the signed consent; answered with `ready`."""

    consent: str | None = None


@dataclass(frozen=True, kw_only=True)
class FingerPath:
    """The finger's way along the beam; both ends are the same place if it does not slide."""

    start_m: float
    end_m: float
    harder: bool = False
    several: bool = False


@dataclass(frozen=True, kw_only=True)
class Instruction:
    """What to do next, with the touch to make if it is one; answered with `ready`."""

    text: str
    touch: FingerPath | None = None


@dataclass(frozen=True, kw_only=True)
class Pacing:
    """The touch to make now: the finger's way from `start_m` to `end_m` in `duration_s`.

    Both are the same place for a touch that does not slide.
    """

    start_m: float
    end_m: float
    duration_s: float
    force_n: float
    direction: str
    harder: bool = False
    several: bool = False

    @property
    def touch(self) -> FingerPath:
        """The same touch as its instruction showed it."""
        return FingerPath(
            start_m=self.start_m, end_m=self.end_m, harder=self.harder, several=self.several
        )


@dataclass(frozen=True, kw_only=True)
class AskChange:
    """What changed? Answered with one of the question's answers."""

    question: Question


@dataclass(frozen=True, kw_only=True)
class AskScore:
    """How strong is it? Answered with a number on the scale."""

    rating: Rating


Screen = Notice | Welcome | Instruction | Pacing | AskChange | AskScore


@dataclass(frozen=True, kw_only=True)
class Response:
    """An answer: `ready`, one of a question's answers, or a score in digits.

    `trace` says how it came about, where the screen can tell: marks, changes, frames.
    """

    answer: str
    reaction_time_s: float
    trace: Mapping[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class OperatorView:
    """Where the session stands and what the device really does, as it was last read back.

    Without a `device` the output was read back as off, unless it is `unknown` or the session is
    idle: then nobody has asked yet.
    """

    session: str
    kind: str
    state: str
    trial: str
    next_trial: str
    done: int
    total: int
    left_s: float
    device: ReadBack | None
    searching: bool
    watchdog_s: float
    last_answer: str
    warning: str
    unknown: bool = False

    def progress(self) -> str:
        """Return how far the session is, such as `3 of 7 trials, about 2 min left`."""
        return f"{self.done} of {self.total} trials, about {max(self.left_s, 0) / 60:.0f} min left"

    def output(self) -> str:
        """Return what is on the device, in words."""
        if self.unknown:
            return UNKNOWN.removeprefix("output ")
        if self.searching:
            return "ON, 10 V at most, searching"
        if self.device is None and self.state == "idle":
            return "not known yet"
        if self.device is None or not self.device.output:
            return "off"
        device = self.device
        return f"ON {device.voltage_v:.0f} V {device.frequency_hz:.0f} Hz" + (
            "" if device.monitor_v is None else f" (monitor {device.monitor_v:.0f} V)"
        )


def pacing(touch: Touch, finger: TouchDefaults) -> Pacing:
    """Return the cue for `touch`: a place that is held, or a way at the study's sliding speed."""
    start_m = end_m = finger.smooth_place_m
    if touch.place == "path":
        start_m, end_m = finger.path_m if touch.direction == "right" else finger.path_m[::-1]
    return Pacing(
        start_m=start_m,
        end_m=end_m,
        duration_s=touch_s(touch, finger),
        force_n=finger.force_n * touch.press,
        direction=touch.direction,
        harder=touch.press > 1,
        several=touch.coverage == "full",
    )


@dataclass(frozen=True, kw_only=True)
class Note:
    """Something the operator wants written down."""

    text: str
