"""The participant's screens and responses, and the operator's view and orders.

No screen reveals to the participant what the device does.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from device.errors import UNKNOWN
from protocol.journal.records import ReadBack
from protocol.study.questions import Question
from protocol.study.rating import Rating
from protocol.study.touch import Touch, TouchDefaults, touch_s

Order = Literal["pause", "stop", "repeat", "emergency stop"]


@dataclass(frozen=True, kw_only=True)
class Notice:
    """A text that needs no answer."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Welcome:
    """The first screen, with the reference of the signed consent; answered with `ready`."""

    consent: str | None = None


@dataclass(frozen=True, kw_only=True)
class FingerPath:
    """The finger's path along the beam; start and end are equal if it does not slide."""

    start_m: float
    end_m: float
    harder: bool = False
    several: bool = False


@dataclass(frozen=True, kw_only=True)
class Instruction:
    """What to do next, with the finger's path if it is a touch; answered with `ready`."""

    text: str
    touch: FingerPath | None = None


@dataclass(frozen=True, kw_only=True)
class Pacing(FingerPath):
    """The touch to make now: the finger's path, to be followed in `duration_s`."""

    duration_s: float
    force_n: float
    direction: str

    @property
    def touch(self) -> FingerPath:
        """The path that the instruction for this touch showed."""
        return FingerPath(**{entry.name: getattr(self, entry.name) for entry in fields(FingerPath)})


@dataclass(frozen=True, kw_only=True)
class AskChange:
    """The question what changed; answered with one of the question's answers."""

    question: Question


@dataclass(frozen=True, kw_only=True)
class AskScore:
    """The question how strong the change is; answered with a score on the rating scale."""

    rating: Rating


Screen = Notice | Welcome | Instruction | Pacing | AskChange | AskScore


@dataclass(frozen=True, kw_only=True)
class Response:
    """An answer: `ready`, one of a question's answers, or a score in digits.

    `trace` records how it was given (marks, changes, frames) if the screen can measure that.
    """

    answer: str
    reaction_time_s: float
    trace: Mapping[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class OperatorView:
    """The session's progress and the device's last read-back.

    `device` is None if the output has been read back as off, if it is `unknown`, or while the
    session is idle and the device has not been asked yet. `busy` says what the output is on for
    while no participant touches the beam.
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
    busy: str
    watchdog_s: float
    last_answer: str
    warning: str
    unknown: bool = False

    def progress(self) -> str:
        """Return the progress in words, such as `3 of 7 trials, about 2 min left`."""
        return f"{self.done} of {self.total} trials, about {max(self.left_s, 0) / 60:.0f} min left"

    def output(self) -> str:
        """Return the state of the output in words."""
        if self.unknown:
            return UNKNOWN.removeprefix("output ")
        if self.busy:
            return f"ON, {self.busy}"
        if self.device is None and self.state == "idle":
            return "not known yet"
        if self.device is None or not self.device.output:
            return "off"
        device = self.device
        return f"ON {device.voltage_v:.0f} V {device.frequency_hz:.0f} Hz" + (
            "" if device.monitor_v is None else f" (monitor {device.monitor_v:.0f} V)"
        )


def pacing(touch: Touch, finger: TouchDefaults) -> Pacing:
    """Return the cue for `touch`: a place to hold, or a slide at the study's speed."""
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
    """A note by the operator."""

    text: str
