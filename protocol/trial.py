"""The records of a plan: what is asked of one participant in one session, trial by trial."""

from dataclasses import dataclass
from typing import Literal

from protocol.questions import Question
from protocol.touch import Touch

Kind = Literal["baseline", "signal", "practice", "trial", "catch"]


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One trial: touches, then a question unless `question` is None, then a score if `scored`.

    `index` counts from 0 within a session; `block` is 0 before the first block. The touches
    already are what is to be done: `level` says by what the condition's amplitudes were multiplied
    (0 in a catch trial), `opposite` that they come in the opposite order. A break of at least
    `break_s` precedes the trial.
    """

    index: int
    block: int
    kind: Kind
    condition: str | None
    question: Question | None
    expected: str | None
    scored: bool
    touches: tuple[Touch, ...]
    level: float = 1.0
    opposite: bool = False
    break_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The trials of one session, and in which order its conditions come."""

    slot: int
    sequence: tuple[str, ...]
    trials: tuple[Trial, ...]
    session: int = 1
