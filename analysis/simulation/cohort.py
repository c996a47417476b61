"""The answers of many virtual people to their trials, all at once."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from device.friction.scenes import REFERENCE_SPEED_M_S, Direction
from device.people import answering as answers
from device.people.person import BODY_HEIGHT_M, Fingers, People, World, felt_friction, uniforms_of
from protocol.plan.blocks import arrivals
from protocol.plan.plan import plan
from protocol.plan.trials import Plan, Trial
from protocol.study.study import Study
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Mark, mark_of

# The plans of a study's slots as arrays, with each different trial once.


@dataclass(frozen=True, kw_only=True)
class TrialKind:
    """What trials that are alike have in common; `expected` as in `answering.meaning`."""

    trial: Trial
    marks: tuple[Mark, ...]

    @property
    def expected(self) -> int | None:
        """The meaning of the expected answer."""
        question = self.trial.question
        return None if question is None else answers.meaning(question, self.trial.expected)

    @property
    def change(self) -> answers.Kind:
        """What the touches are about."""
        question = self.trial.question
        return "other" if question is None else answers.kind_of_change(question, self.marks)

    @property
    def two_sided(self) -> bool:
        """Whether its question knows a contrary answer."""
        question = self.trial.question
        return question is not None and QUESTIONS[question].less is not None


@dataclass(frozen=True, kw_only=True)
class PlannedTrials:
    """The trials of the slots of a study, drawn once each, for one number of the session.

    `replace` with another session shares the `kinds`, so that trials of several can be joined.
    """

    study: Study
    session: int = 1
    kinds: list[TrialKind] = field(default_factory=list)
    _numbers: dict[object, int] = field(default_factory=dict)
    _places: list[tuple[str, int]] = field(default_factory=list, init=False)
    _plans: dict[int, Plan] = field(default_factory=dict, init=False)
    _rows: dict[int, IntArray] = field(default_factory=dict, init=False)

    def place(self, slot: int) -> tuple[str | None, int]:
        """Return the group, and the slot within it, of the participant who arrives at that slot."""
        if not self.study.group:
            return None, slot
        while len(self._places) <= slot:
            self._places.append(next(self._arrivals))
        return self._places[slot]

    @cached_property
    def _arrivals(self) -> Iterator[tuple[str, int]]:
        return arrivals(self.study, "participant")

    def plan(self, slot: int) -> Plan:
        """Return the plan of a slot, counted from 0 over all groups."""
        if slot not in self._plans:
            group, own = self.place(slot)
            self._plans[slot] = plan(self.study.of_group(group), own, self.session)
        return self._plans[slot]

    def kinds_of(self, slots: IntArray) -> IntArray:
        """Return which of `kinds` each trial is, shape (slots, trials)."""
        for slot in slots.tolist():
            if slot not in self._rows:
                row = [self._number(trial) for trial in self.plan(slot).trials]
                self._rows[slot] = np.array(row, dtype=np.int64)
        return np.stack([self._rows[slot] for slot in slots.tolist()])

    def _number(self, trial: Trial) -> int:
        asked = (trial.kind, trial.condition, trial.question, trial.expected, trial.scored)
        # Trials that differ in place and block alone feel the same, and are felt together.
        known = (*asked, tuple(touch.model_dump_json() for touch in trial.touches))
        if known not in self._numbers:
            self._numbers[known] = len(self.kinds)
            marks = tuple(mark_of(touch, self.study.touch) for touch in trial.touches)
            self.kinds.append(TrialKind(trial=trial, marks=marks))
        return self._numbers[known]


Drive = tuple[float, Direction]
"""Frequency relative to the resonance, and the direction of the finger."""
Parts = tuple[tuple[int, int], IntArray]
"""A kind of trial and one of its touches, and some of the parts of that touch's time."""
_NEVER = 9
"""Stands for an expected answer where none is: nobody gives it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cohort:
    """Virtual people in a session each, and what they answered.

    `slots` tells which plan each has, and `kinds` (people, trials) which kind of trial each is.
    `answered`, of that shape as all that follow, are the trials before somebody leaves; `change` is
    the reported one as in `answering.meaning`, of trials with a question; `score` is on the study's
    scale, NaN where none was asked for. `force_n` (people, touches) is of each touch, in order.
    """

    people: People
    slots: IntArray
    kinds: IntArray
    answered: BoolArray
    change: IntArray
    reaction_s: FloatArray
    score: FloatArray
    score_reaction_s: FloatArray
    force_n: FloatArray


def cohort(
    planned: PlannedTrials, people: People, names: Sequence[str], slots: IntArray, world: World
) -> Cohort:
    """Return what people answer in their sessions.

    `names` are those of their sessions (`person.session_name`), `slots` which plan each has.
    """
    kinds = planned.kinds_of(slots)
    table = np.array([len(kind.marks) for kind in planned.kinds])
    touches = table[kinds]
    first_touch = np.cumsum(touches, axis=1) - touches
    most = int(touches.sum(axis=1).max())
    u = uniforms_of([f"touches/{name}" for name in names], most, answers.TOUCH_NUMBERS)
    feeling = _Feeling(planned, people, world)
    force_n = np.full(u.shape[:2], np.nan)
    for number, kind in enumerate(planned.kinds):
        who, trial = np.nonzero(kinds == number)
        if not who.size:  # of another session
            continue
        for touch in range(len(kind.marks)):
            at = first_touch[who, trial] + touch
            force_n[who, at] = feeling.touch(number, touch, who, trial, u[who, at])
    numbers = ("reaction_s", "score", "score_reaction_s")
    made = Cohort(
        people=people,
        slots=slots,
        kinds=kinds,
        answered=np.zeros(kinds.shape, dtype=np.bool_),
        change=np.zeros(kinds.shape, dtype=np.int64),
        force_n=force_n,
        **{name: np.full(kinds.shape, np.nan) for name in numbers},
    )
    _answer(made, planned, names, feeling.contrasts(kinds.shape))
    return made


def joined(sessions: Sequence[Cohort]) -> Cohort:
    """Return the sessions of the same people as one, the trials of each after those before."""
    if len(sessions) == 1:
        return sessions[0]
    names = ("kinds", "answered", "change", "reaction_s", "score", "score_reaction_s", "force_n")
    beside: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in sessions], axis=1) for name in names
    }
    # Who touches less often in a session than others has no forces at its end.
    in_order = np.argsort(np.isnan(beside["force_n"]), axis=1, kind="stable")
    beside["force_n"] = np.take_along_axis(beside["force_n"], in_order, axis=1)
    return replace(sessions[0], **beside)


class _Feeling:
    """Collects touches, so that those with a like drive are felt together."""

    def __init__(self, planned: PlannedTrials, people: People, world: World) -> None:
        self._study = planned.study
        self._kinds = planned.kinds
        self._people = people
        self._world = world
        self._trials: dict[int, tuple[IntArray, IntArray]] = {}
        self._asked: dict[Drive, list[tuple[Parts, Fingers]]] = defaultdict(list)
        self._friction: dict[tuple[int, int], FloatArray] = {}

    def touch(
        self, number: int, touch: int, who: IntArray, trial: IntArray, u: FloatArray
    ) -> FloatArray:
        """Collect a touch of the trials of one kind, and return its forces, N.

        A person compares the last touch with the first one, and forgets those between.
        """
        self._trials[number] = who, trial
        kind = self._kinds[number]
        mark, made = kind.marks[touch], self._people.rows(who)
        way = answers.course(made, u, mark)
        parts = answers.fractions(mark)
        # The friction of touches between would be computed for nothing; their force is recorded.
        if touch not in {0, len(kind.marks) - 1}:
            return way.force_n
        self._friction[number, touch] = np.empty((len(who), len(parts)))
        places_m = way.places_m(parts)
        # Relative to the rig's resonance, also if given in Hz: the model has another one.
        to_make = kind.trial.touches[touch]
        # A touch without a beam of its own is on the one that the study mounts.
        beam = to_make.beam or self._study.touch.beam
        height_m = BODY_HEIGHT_M * (beam is None or self._study.beams[beam] > 0)
        # A finger that stays at its place slides to and fro there.
        sliding_m_s = np.where(way.speed_m_s > 0, way.speed_m_s, REFERENCE_SPEED_M_S)
        voltages_v = to_make.voltage_v + parts * (to_make.end_voltage_v - to_make.voltage_v)
        frequencies = to_make.frequency + parts * (to_make.end_frequency - to_make.frequency)
        # One frequency at a time, because the beam is solved once for each.
        for frequency in np.unique(frequencies).tolist():
            which = np.flatnonzero(frequencies == frequency)
            shape = (len(places_m), len(which))
            fingers = Fingers(
                place_m=places_m[:, which].ravel(),
                force_n=np.repeat(way.force_n, len(which)),
                speed_m_s=np.repeat(sliding_m_s, len(which)),
                voltage_v=np.broadcast_to(voltages_v[which], shape).ravel(),
                body_height_m=np.full(shape, height_m).ravel(),
                skin=np.repeat(made.skin, len(which)),
                mu0=np.repeat(made.mu0, len(which)),
            )
            asked = self._asked[frequency, to_make.direction]
            asked.append((((number, touch), which), fingers))
        return way.force_n

    def contrasts(self, shape: tuple[int, ...]) -> FloatArray:
        """Return the change that each trial makes, shape (people, trials)."""
        for (frequency, direction), asked in self._asked.items():
            parts = [vars(fingers) for _, fingers in asked]
            every = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
            model_hz = frequency * self._world.resonance_hz
            found = felt_friction(self._world, Fingers(**every), model_hz, direction)
            ends = np.cumsum([fingers.place_m.size for _, fingers in asked])
            for ((key, which), _), own in zip(asked, np.split(found, ends[:-1]), strict=True):
                self._friction[key][:, which] = own.reshape(-1, len(which))
        resting = self._resting()
        contrast = np.zeros(shape)
        for number, kind in enumerate(self._kinds):
            if kind.trial.question is not None and number in self._trials:
                who, trial = self._trials[number]
                felt = [
                    answers.Felt(mark=kind.marks[touch], friction=self._friction[number, touch])
                    # A trial of one touch has the same first and last; it counts once.
                    for touch in dict.fromkeys([0, len(kind.marks) - 1])
                ]
                known = felt[0].friction[:, 0] if resting is None else resting[who]
                contrast[who, trial] = answers.felt_contrast(kind.trial.question, felt, known)
        return contrast

    def _resting(self) -> FloatArray | None:
        """Return what people remember of the beam at rest; None if they never touched it."""
        for number, kind in enumerate(self._kinds):
            if kind.trial.question is None and number in self._trials:
                return self._friction[number, len(kind.marks) - 1][:, -1]
        return None


def _answer(
    made: Cohort, planned: PlannedTrials, names: Sequence[str], contrast: FloatArray
) -> None:
    """Add the answers, trial by trial: a person remembers the one before."""
    people, kinds, of = made.people, made.kinds, planned.kinds
    asks = np.array([kind.trial.question is not None for kind in of])[kinds]
    two_sided = np.array([kind.two_sided for kind in of])[kinds]
    expected = np.array([_NEVER if kind.expected is None else kind.expected for kind in of])[kinds]
    scored = np.array([kind.trial.scored for kind in of])[kinds]
    extra = np.stack([answers.beyond(kind.change, people) for kind in of], axis=1)
    rating = planned.study.rating
    most = int(asks.sum(axis=1).max())
    u = uniforms_of([f"questions/{name}" for name in names], most, answers.QUESTION_NUMBERS)
    # Random numbers are numbered by questions, so that a trial without one uses none.
    answering, everybody, asked = answers.Answering(people), np.arange(people.size), 0
    for trial in range(kinds.shape[1]):
        if asks[:, trial].any():
            change, reaction_s = answering.change(
                contrast[:, trial],
                extra[everybody, kinds[:, trial]],
                two_sided[:, trial],
                u[:, asked],
            )
            asked += 1
            wanted = rating.asks_score(
                agrees=change == expected[:, trial], noticed=change != answers.SAME
            )
            # Somebody who has left scores nothing more.
            wanted &= scored[:, trial] & ~answering.left
            score, score_reaction_s = answering.score(wanted)
            on_study = answers.on_scale(score, rating.minimum, rating.maximum)
            made.change[:, trial] = change
            made.reaction_s[:, trial] = np.where(answering.left, np.nan, reaction_s)
            made.score[:, trial] = np.where(wanted, on_study, np.nan)
            made.score_reaction_s[:, trial] = np.where(wanted, score_reaction_s, np.nan)
        made.answered[:, trial] = ~answering.left
