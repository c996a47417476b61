"""What a virtual person makes of what its finger felt: one signed change per question."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from device.beam.modes import FloatArray
from device.people.person import People
from protocol.study.questions import QUESTIONS, Question
from protocol.study.touch import Mark

Kind = Literal["swing", "strength", "ramp", "swap", "press", "other"]
"""Kinds of change that people may score unlike one another, however large they feel."""
_SLIGHT = 0.01
"""Change of log friction within a touch below which the touch counts as constant."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Felt:
    """Friction coefficients felt during a touch, shape (people, fractions of the mark)."""

    mark: Mark
    friction: FloatArray


def kind_of_change(question: Question, marks: Sequence[Mark]) -> Kind:
    """Return what the touches were about, as somebody who makes them can tell."""
    if question == "places":
        return "swap"
    if question == "strength":
        return "swing" if marks[-1].slides else "strength"
    if len(marks) == 1:
        return "ramp"
    return "press" if marks[-1].harder else "other"


def felt_contrast(question: Question, touches: Sequence[Felt], resting: FloatArray) -> FloatArray:
    """Return the change of log friction that a question asks about, shape (people,).

    The last touch is compared with the first. If there is only one touch, its end is compared with
    its beginning, or, if they feel the same or the finger slid, with the remembered beam at rest.

    Args:
        question: the question.
        touches: those of the trial.
        resting: the remembered friction of the beam at rest, shape (people,).
    """
    first, last = touches[0], touches[-1]
    effect = QUESTIONS[question].effect
    if effect == "places":
        back = last.friction
        if first.mark.direction != last.mark.direction:
            back = back[:, ::-1]
        return _rms(np.log(first.friction / back))
    if effect == "depth":
        return _depth(last, resting) - _depth(first, resting)
    if len(touches) > 1:
        return _ends(np.log(first.friction / last.friction), last)
    within = np.log(first.friction[:, 0] / first.friction[:, -1])
    from_rest = _ends(np.log(resting[:, None] / first.friction), first)
    return from_rest if first.mark.slides else np.where(np.abs(within) > _SLIGHT, within, from_rest)


def _ends(change: FloatArray, touch: Felt) -> FloatArray:
    """Return the mean change along a slide, or that at the end of a touch of one place."""
    return np.asarray(change.mean(axis=1) if touch.mark.slides else change[:, -1])


def _depth(touch: Felt, resting: FloatArray) -> FloatArray:
    """Return the root mean square of the log friction relative to the beam at rest."""
    return _rms(np.log(touch.friction / resting[:, None]))


def _rms(logs: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(logs * logs, axis=1)))


def beyond(kind: Kind, people: People) -> FloatArray:
    """Return the points that people score a kind of change beyond its size, shape (people,)."""
    if kind == "other":
        return np.zeros(people.size)
    return np.asarray(getattr(people, f"beyond_{kind}"))
