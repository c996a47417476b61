"""Records of a plan: its trials, the beams they need, and how long they take."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from protocol.study.questions import Question
from protocol.study.study import Study
from protocol.study.touch import Touch, on_s

TrialKind = Literal["baseline", "signal", "practice", "trial", "catch"]


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
    kind: TrialKind
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


Beams = tuple[str | None, ...]


def beams_of(touches: Iterable[Touch], mounted: str | None) -> Beams:
    """Return the beams that the touches need, in order, without immediate repetition.

    `mounted` is the study's own, taken where a touch names none.
    """
    needed: list[str | None] = []
    for touch in touches:
        beam = touch.beam or mounted
        if not needed or needed[-1] != beam:
            needed.append(beam)
    return tuple(needed)


def swap_count(beams: Iterable[str | None]) -> int:
    """Return how often one beam is taken off for another.

    >>> swap_count(["1 mm", "1 mm", "none", "1 mm"])
    2
    """
    return sum(before != after for before, after in pairwise(beams))


def touches_s(study: Study, touches: Sequence[Touch]) -> float:
    """Return how long the touches of a trial take, instructions and pauses included, s."""
    device_s = sum(on_s(touch, study.touch, study.rig) for touch in touches)
    timing = study.timing
    return (
        device_s + len(touches) * timing.reading_s + (len(touches) - 1) * timing.between_touches_s
    )


def trial_s(study: Study, trial: Trial) -> float:
    """Return the expected duration of a trial with the pause before it, s; beam swaps not in it."""
    timing = study.timing
    asked_s = (timing.answer_s if trial.question else 0.0) + (timing.score_s * trial.scored)
    return trial.break_s + timing.inter_trial_s + touches_s(study, trial.touches) + asked_s


def plan_swaps(study: Study, plan: Plan) -> int:
    """Return how often the operator swaps beams, the study's own one being mounted at first."""
    touches = [touch for trial in plan.trials for touch in trial.touches]
    return swap_count((study.touch.beam, *beams_of(touches, study.touch.beam)))


def session_s(study: Study, plan: Plan) -> float:
    """Return the expected duration of a session, s."""
    swaps_s = plan_swaps(study, plan) * study.timing.beam_swap_s
    return sum(trial_s(study, trial) for trial in plan.trials) + swaps_s
