"""What stands before the participant, and what comes back. No screen says what the device does."""

from dataclasses import dataclass

from protocol.questions import Question
from protocol.study import Rating


@dataclass(frozen=True, kw_only=True)
class Notice:
    """A text to read; nothing to answer."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Instruction:
    """The touch to make next; answered with `ready`."""

    text: str


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


@dataclass(frozen=True, kw_only=True)
class AskChange:
    """What changed? Answered with one of the question's answers."""

    question: Question


@dataclass(frozen=True, kw_only=True)
class AskScore:
    """How strong is it? Answered with a number on the scale."""

    rating: Rating


Screen = Notice | Instruction | Pacing | AskChange | AskScore


@dataclass(frozen=True, kw_only=True)
class Response:
    """An answer: `ready`, one of a question's answers, or a score in digits."""

    answer: str
    reaction_time_s: float
