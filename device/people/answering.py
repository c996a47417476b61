"""How virtual people touch and answer: finger, what is felt, change, score, times, who leaves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from device.arrays import BoolArray, FloatArray
from device.friction.calibration import Calibration
from device.friction.changes import predicted_contrast, trial_change
from device.friction.surfaces import GivenSurface, length_of
from device.people.person import People, World, normal_quantile
from protocol.plan.trials import Trial
from protocol.study.rules import PAPERS_SCALE, Rating
from protocol.study.study import Condition, Study
from protocol.study.study_question import ANSWERS, QUESTIONS, Question
from protocol.study.touch import Mark, Touch
from protocol.study.track import Find

QUESTION_NUMBERS = 8
"""Random numbers per question on a change, in this order."""
_FELT, _LAPSE, _CHOICE, _SCORE, _END, _TIME, _SCORE_TIME, _LEAVES = range(QUESTION_NUMBERS)
TRACK_NUMBERS = 7
"""Random numbers per question of a track: three touches, then these."""
_TRACK_LAPSE, _TRACK_CHOICE, _TRACK_TIME, _TRACK_LEAVES = range(3, TRACK_NUMBERS)
MORE, LESS, SAME = 1, -1, 0
"""Answers to a question on a change: its first one, the contrary, and no change."""

IntArray = NDArray[np.int64]


def meaning(question: Question, answer: str | None) -> int | None:
    """Return which of `MORE`, `LESS` and `SAME` an answer means; None for no such answer.

    >>> meaning("roughness", "rougher")
    -1
    """
    asked = QUESTIONS[question]
    known = {asked.more: MORE, asked.less: LESS, asked.same: SAME}
    return None if answer is None else known.get(answer)


def answer_of(question: Question, said: int) -> str:
    """Return the answer that means `said`, one of `MORE`, `LESS` and `SAME`.

    >>> answer_of("places", SAME)
    'not swapped'
    """
    return next(answer for answer in ANSWERS[question] if meaning(question, answer) == said)


class Answering:
    """People who answer the questions of their sessions, one after another, all at once.

    They remember how many they answered, and the last change and score. Arrays are of shape
    (people,).
    """

    _pending: FloatArray
    _u: FloatArray
    _tired: FloatArray

    def __init__(self, people: People) -> None:
        self.people = people
        self.left = np.zeros(people.size, dtype=np.bool_)
        """Who has left for good; only what the others answer means something."""
        self._asked = 0
        self._felt = np.zeros(people.size)
        self._score = np.full(people.size, np.nan)

    def change(
        self, contrast: FloatArray, beyond: FloatArray, two_sided: BoolArray, u: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Return the answers, `MORE`, `LESS` or `SAME`, and the reaction times, s.

        Args:
            contrast: the change of log friction under the finger; NaN is answered at random.
            beyond: points that this kind of change is scored beyond its size.
            two_sided: whether the question knows the answer `LESS`.
            u: random numbers for this question, shape (people, QUESTION_NUMBERS).
        """
        who = self.people
        felt, lapses = self._feel(contrast, u)
        less = np.where(two_sided & (felt < -who.criterion_less), LESS, SAME)
        answer = np.where(felt > who.criterion, MORE, less)
        # Two answers or three are equally likely at random.
        thirds = np.where(two_sided, u[:, _CHOICE] * 3, u[:, _CHOICE] * 2)
        answer = np.where(lapses, 1 - thirds.astype(np.int64), answer)
        # Who did not attend felt no change, whatever the answer was.
        size = np.where(lapses, 0.0, who.gain * np.abs(felt) + beyond)
        self._pend(size)
        return answer, self._seconds(_TIME)

    def rate(
        self, level: FloatArray, u: FloatArray, rating: Rating, asked: BoolArray | bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """Return the scores of what is felt, without a question before, and the reaction times, s.

        Scores are whole numbers of the scale of `rating`; a person who uses few of its numbers
        leaves some out.

        Args:
            level: log friction relative to that at rest; where it is NaN nothing is felt.
            u: random numbers for this question, shape (people, QUESTION_NUMBERS).
            rating: the study's scale.
            asked: those who are asked, and who will remember it.
        """
        felt, lapses = self._feel(level, u)
        self._pend(np.where(lapses, 0.0, self.people.gain * felt))
        per_point = rating.span / PAPERS_SCALE.span
        pending, ceiling = (
            rating.minimum + points * per_point for points in (self._pending, self.people.ceiling)
        )
        scores = self._given(pending, rating, np.floor(ceiling), asked)
        return np.asarray(np.round(scores)), self._seconds(_TIME)

    def _feel(self, contrast: FloatArray, u: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return what people feel with their noise, and who does not attend."""
        who, self._u = self.people, u
        self._tired = 1 + who.fatigue * self._asked
        self.left |= u[:, _LEAVES] < who.dropout
        lapses = (u[:, _LAPSE] < who.lapse) | np.isnan(contrast)
        felt = np.nan_to_num(contrast) * np.maximum(1 - who.adaptation * np.abs(self._felt), 0.0)
        self._felt = felt + who.felt_noise * self._tired * normal_quantile(u[:, _FELT])
        return self._felt, lapses

    def _pend(self, size: FloatArray) -> None:
        """Keep the score that is `size` points beyond that of nothing, on the paper's scale."""
        who = self.people
        noise = who.rating_noise * self._tired * normal_quantile(self._u[:, _SCORE])
        self._pending = who.bias + size + who.drift * self._asked + noise
        self._asked += 1

    def track(self, logs: FloatArray, found: Find, u: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the touch that people name, from 0, and the reaction times, s.

        Of one touch they say whether it was so: 1 or 0. Noise of the same size is added to what
        each touch feels like, so that of two touches a share Phi(c / (sqrt(2) felt_noise)) is
        named rightly where they differ by c (Green and Swets 1966).

        Args:
            logs: log friction of each touch, relative to the beam at rest, (people, touches).
            found: what people are asked for.
            u: random numbers for this question, shape (people, TRACK_NUMBERS).
        """
        who, many = self.people, logs.shape[1]
        self._u = u
        self.left |= u[:, _TRACK_LEAVES] < who.dropout
        noise = who.felt_noise * (1 + who.fatigue * self._asked)
        smooth = noise[:, None] * normal_quantile(u[:, :many]) - logs
        self._asked += 1
        if many == 1:
            felt = smooth[:, 0]
            answer = felt > who.criterion
            if found in {"rougher", "different"}:
                less = felt < -who.criterion_less
                answer = less if found == "rougher" else answer | less
        else:
            others = (smooth.sum(axis=1, keepdims=True) - smooth) / (many - 1)
            told = {"rougher": -smooth, "different": np.abs(smooth - others)}
            answer = told.get(found, smooth).argmax(axis=1)
        at_random = (u[:, _TRACK_CHOICE] * max(many, 2)).astype(np.int64)
        named = np.where(u[:, _TRACK_LAPSE] < who.lapse, at_random, answer.astype(np.int64))
        return named, self._seconds(_TRACK_TIME)

    def score(self, asked: BoolArray | bool = True) -> tuple[FloatArray, FloatArray]:
        """Return the scores of the last change on the paper's scale, and the reaction times, s.

        `asked` are those who are asked for it, and who will remember it.
        """
        scores = self._given(self._pending, PAPERS_SCALE, self.people.ceiling, asked)
        return scores, self._seconds(_SCORE_TIME)

    def _given(
        self, pending: FloatArray, scale: Rating, ceiling: FloatArray, asked: BoolArray | bool
    ) -> FloatArray:
        """Return the scores that people give on a scale to whom the `pending` ones seem right."""
        who, low, high = self.people, scale.minimum, scale.maximum
        # The first score has none before it to be drawn towards.
        before = np.where(np.isnan(self._score), pending, self._score)
        wanted = pending + who.serial * (before - pending)
        scores = np.clip(who.number_step * np.round(wanted / who.number_step), low, ceiling)
        averse = self._u[:, _END] < who.end_aversion
        inwards = np.where(scores == high, -1.0, np.where(scores == low, 1.0, 0.0))
        scores = scores + averse * inwards * who.number_step
        # A score that was not asked for is not remembered: the others must not be drawn towards it.
        self._score = np.where(asked, scores, self._score)
        return np.asarray(scores)

    def _seconds(self, column: int) -> FloatArray:
        """Return reaction times, shifted log-normal ones, to the millisecond."""
        who = self.people
        beyond_s = who.reaction_median_s * np.exp(
            who.reaction_spread * normal_quantile(self._u[:, column])
        )
        return np.asarray(np.round(who.reaction_shift_s + beyond_s, 3))


def on_scale(score: FloatArray, lowest: float, highest: float) -> FloatArray:
    """Return scores of the paper's scale as far between the ends of another one."""
    above = (score - PAPERS_SCALE.minimum) * ((highest - lowest) / PAPERS_SCALE.span)
    return np.asarray(np.round(lowest + above))


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
        # Places are compared, and the finger came to them in the opposite order.
        if first.mark.direction != last.mark.direction:
            back = back[:, ::-1]
        return _rms(np.log(first.friction / back))
    if effect == "depth":
        before, after = (_rms(np.log(it.friction / resting[:, None])) for it in (first, last))
        return after - before
    if first.mark.slides != last.mark.slides:
        return _ends(np.log(first.friction), first) - _ends(np.log(last.friction), last)
    if len(touches) > 1:
        return _ends(np.log(first.friction / last.friction), last)
    within = np.log(first.friction[:, 0] / first.friction[:, -1])
    from_rest = _ends(np.log(resting[:, None] / first.friction), first)
    # Within a slide friction varies with the place: its ends say nothing about a change.
    return from_rest if first.mark.slides else np.where(np.abs(within) > _SLIGHT, within, from_rest)


def change_worth(
    points: float, question: Question | None, expected: str | None, people: People
) -> FloatArray:
    """Return the change of log friction that changes people's scores by `points`, shape (people,).

    It is how a change is felt where friction is not known: positive points make the expected answer
    likely, negative ones the opposite. Without a question it is the level of friction.
    """
    towards = LESS if question and meaning(question, expected) == LESS else MORE
    gain = np.where(people.gain == 0, np.inf, people.gain)
    return np.asarray(towards * points / gain)


def given_change(study: Study, trial: Trial, world: World, people: People) -> FloatArray:
    """Return the change of log friction that people feel of a trial on a surface without a model.

    It is what the file of the people says that the condition is to them, else what its touches
    state, and NaN where neither is known; shape (people,).
    """
    points = world.points(trial.condition, trial.kind, trial.level)
    if points is not None:
        return change_worth(points, trial.question, trial.expected, people)
    return people.skin * stated_change(study, trial.question, trial.expected, trial.touches)


def stated_change(
    study: Study, question: Question | None, expected: str | None, touches: Sequence[Touch]
) -> float:
    """Return the change of log friction that touches state, NaN if they do not.

    Positive is smoother, stronger or swapped, whatever is expected; without a question, rougher.
    """
    change = trial_change(study, question, expected, touches)
    rig = Calibration.of(GivenSurface(length_m=length_of(study.surface)))
    size = predicted_contrast(change, rig=rig)
    return -size if change.contrary else size


def is_stated(study: Study) -> bool:
    """Return whether touches state the friction of everything that is asked about."""
    return not any(
        np.isnan(stated_change(study, item.question, item.expected, item.touches))
        for item in (*study.opening, *study.condition)
        if item.question is not None or isinstance(item, Condition)
    )


def felt_level(touches: Sequence[Felt], resting: FloatArray) -> FloatArray:
    """Return the log friction of each touch, relative to the beam at rest, (people, touches)."""
    each = [_ends(np.log(touch.friction / resting[:, None]), touch) for touch in touches]
    return np.stack(each, axis=1)


def _ends(change: FloatArray, touch: Felt) -> FloatArray:
    """Return the mean change along a slide, or that at the end of a touch of one place."""
    return np.asarray(change.mean(axis=1) if touch.mark.slides else change[:, -1])


def _rms(logs: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(logs * logs, axis=1)))


def beyond(kind: Kind, people: People) -> FloatArray:
    """Return the points that people score a kind of change beyond its size, shape (people,)."""
    if kind == "other":
        return np.zeros(people.size)
    return np.asarray(getattr(people, f"beyond_{kind}"))


_SLIDE = np.linspace(0.0, 1.0, 25)
_HOLD = np.array([0.0, 1.0])
TOUCH_NUMBERS = 2
"""Random numbers per touch: for force and speed."""
_LEAST = 0.2
"""Of force and speed, relative to the instructed ones: a finger touches, and moves."""


def fractions(mark: Mark) -> FloatArray:
    """Return the parts of a touch's time at which a finger notes what it feels.

    They are the same however often it is looked at.
    """
    return _SLIDE if mark.slides else _HOLD


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """A touch as people make it: force, speed (m/s, 0 without a slide) and way, shape (people,).

    `speed_factor` is relative to the mark's, `offset_m` how far right of it the finger is,
    `length_m` that of the surface.
    """

    mark: Mark
    force_n: FloatArray
    speed_factor: FloatArray
    offset_m: FloatArray
    length_m: float

    @property
    def speed_m_s(self) -> FloatArray:
        return self.speed_factor * abs(self.mark.end_m - self.mark.start_m) / self.mark.duration_s

    def places_m(self, parts: FloatArray) -> FloatArray:
        """Return where the finger is at parts of the touch's time, shape (people, parts).

        It stops after the length of the mark's way, and at the ends of the surface.
        """
        gone = np.minimum(self.speed_factor[:, None] * parts, 1.0)
        way_m = self.mark.end_m - self.mark.start_m
        places_m = self.mark.start_m + self.offset_m[:, None] + way_m * gone
        return np.asarray(np.clip(places_m, 0.0, self.length_m))


def course(people: People, u: FloatArray, mark: Mark, length_m: float) -> Course:
    """Return how people make a touch of a surface of that length.

    `u` are their random numbers for it, shape (people, TOUCH_NUMBERS).
    """
    force = people.force_factor * (1 + people.force_error * normal_quantile(u[:, 0]))
    speed = people.speed_factor * (1 + people.speed_error * normal_quantile(u[:, 1]))
    return Course(
        mark=mark,
        force_n=mark.force_n * np.maximum(force, _LEAST),
        speed_factor=np.maximum(speed, _LEAST),
        offset_m=people.place_offset_m,
        length_m=length_m,
    )
