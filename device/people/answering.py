"""How virtual people answer: the reported change, its score, reaction times, and who leaves."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from device.beam.modes import FloatArray
from device.people.person import People
from protocol.study.questions import ANSWERS, Question
from protocol.study.rating import PAPERS_SCALE

QUESTION_NUMBERS = 8
"""Random numbers per question on a change, in this order."""
_FELT, _LAPSE, _CHOICE, _SCORE, _END, _TIME, _SCORE_TIME, _LEAVES = range(QUESTION_NUMBERS)
MORE, LESS, SAME = 1, -1, 0
"""Answers to a question on a change: its first one, the contrary, and no change."""

IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def meaning(question: Question, answer: str | None) -> int | None:
    """Return which of `MORE`, `LESS` and `SAME` an answer means; None for no such answer.

    >>> meaning("roughness", "rougher")
    -1
    """
    more, *less, same = ANSWERS[question]
    known = {more: MORE, **dict.fromkeys(less, LESS), same: SAME}
    return None if answer is None else known.get(answer)


def answer_of(question: Question, said: int) -> str:
    """Return the answer that means `said`, one of `MORE`, `LESS` and `SAME`.

    >>> answer_of("places", SAME)
    'not swapped'
    """
    return ANSWERS[question][{MORE: 0, LESS: 1, SAME: -1}[said]]


@dataclass
class Answering:
    """People who answer the questions of their sessions, one after another, all at once.

    They remember how many they answered, and the last change and score. Arrays are of shape
    (people,).
    """

    people: People
    left: BoolArray = field(init=False)
    """Who has left for good; only what the others answer means something."""
    _asked: int = field(default=0, init=False)
    _felt: FloatArray = field(init=False)
    _score: FloatArray = field(init=False)
    _pending: FloatArray = field(init=False)
    _u: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        self.left = np.zeros(self.people.size, dtype=np.bool_)
        self._felt = np.zeros(self.people.size)
        self._score = np.full(self.people.size, np.nan)

    def change(
        self, contrast: FloatArray, beyond: FloatArray, two_sided: BoolArray, u: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Return the answers, `MORE`, `LESS` or `SAME`, and the reaction times, s.

        Args:
            contrast: the change of log friction under the finger.
            beyond: points that this kind of change is scored beyond its size.
            two_sided: whether the question knows the answer `LESS`.
            u: random numbers for this question, shape (people, QUESTION_NUMBERS).
        """
        who, self._u = self.people, u
        tired = 1 + who.fatigue * self._asked
        self.left |= u[:, _LEAVES] < who.dropout
        felt = contrast * np.maximum(1 - who.adaptation * np.abs(self._felt), 0.0)
        felt = felt + who.felt_noise * tired * ndtri(u[:, _FELT])
        less = np.where(two_sided & (felt < -who.criterion_less), LESS, SAME)
        answer = np.where(felt > who.criterion, MORE, less)
        lapses = u[:, _LAPSE] < who.lapse
        thirds = np.where(two_sided, u[:, _CHOICE] * 3, u[:, _CHOICE] * 2)
        answer = np.where(lapses, 1 - thirds.astype(np.int64), answer)
        size = np.where(lapses, 0.0, who.gain * np.abs(felt) + beyond)
        noise = who.rating_noise * tired * ndtri(u[:, _SCORE])
        self._pending = who.bias + size + who.drift * self._asked + noise
        self._felt = felt
        self._asked += 1
        return answer, self._seconds(_TIME)

    def score(self, asked: BoolArray | bool = True) -> tuple[FloatArray, FloatArray]:
        """Return the scores of the last change on the paper's scale, and the reaction times, s.

        `asked` are those who are asked for it, and who will remember it.
        """
        who, low, high = self.people, PAPERS_SCALE.minimum, PAPERS_SCALE.maximum
        before = np.where(np.isnan(self._score), self._pending, self._score)
        wanted = self._pending + who.serial * (before - self._pending)
        found = np.clip(who.number_step * np.round(wanted / who.number_step), low, who.ceiling)
        averse = self._u[:, _END] < who.end_aversion
        inwards = np.where(found == high, -1.0, np.where(found == low, 1.0, 0.0))
        found = found + averse * inwards * who.number_step
        self._score = np.where(asked, found, self._score)
        return found, self._seconds(_SCORE_TIME)

    def _seconds(self, column: int) -> FloatArray:
        """Return reaction times, shifted log-normal ones, to the millisecond."""
        who = self.people
        beyond_s = who.reaction_median_s * np.exp(who.reaction_spread * ndtri(self._u[:, column]))
        return np.asarray(np.round(who.reaction_shift_s + beyond_s, 3))


def on_scale(score: FloatArray, lowest: float, highest: float) -> FloatArray:
    """Return scores of the paper's scale as far between the ends of another one."""
    above = (score - PAPERS_SCALE.minimum) * ((highest - lowest) / PAPERS_SCALE.span)
    return np.asarray(np.round(lowest + above))
