"""What stands before the participant, and what comes back. No screen says what the device does."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from protocol.questions import Question
from protocol.study import Rating


@dataclass(frozen=True, kw_only=True)
class Notice:
    """A text to read; nothing to answer."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Welcome:
    """The first screen, with the reference of the signed consent; answered with `ready`."""

    consent: str | None = None


@dataclass(frozen=True, kw_only=True)
class Way:
    """The finger's way along the beam; both ends are the same place if it does not slide."""

    start_m: float
    end_m: float
    harder: bool = False
    several: bool = False


@dataclass(frozen=True, kw_only=True)
class Instruction:
    """What to do next, with the touch to make if it is one; answered with `ready`."""

    text: str
    touch: Way | None = None


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
    def touch(self) -> Way:
        """The same touch as its instruction showed it."""
        return Way(start_m=self.start_m, end_m=self.end_m, harder=self.harder, several=self.several)


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
