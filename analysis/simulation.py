"""Whole cohorts of virtual people without sessions: their answers all at once, tables of scores."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.loading.exclusion_rules import broken_rules
from device.friction.scenes import REFERENCE_SPEED_M_S, Direction
from device.friction.surfaces import GivenSurface, beam_surface, length_of
from device.people import answering as answers
from device.people import person
from device.people.person import People, Population, World
from protocol.plan.plan import arrivals, plan
from protocol.plan.trials import Plan, Trial
from protocol.study.rules import Exclusions
from protocol.study.study import Study
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Mark, mark_of

# The plans of a study's slots as arrays, with each different trial once.


@dataclass(frozen=True, kw_only=True)
class AlikeTrials:
    """What trials that are alike have in common; `expected` as in `answering.meaning`."""

    trial: Trial
    marks: tuple[Mark, ...]

    @property
    def expected(self) -> int | None:
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
    kinds: list[AlikeTrials] = field(default_factory=list)
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
            self.kinds.append(AlikeTrials(trial=trial, marks=marks))
        return self._numbers[known]


Drive = tuple[float, Direction, str]
"""Frequency relative to the resonance, direction of the finger, and the beam that is mounted."""
Parts = tuple[tuple[int, int], IntArray]
"""A kind of trial and one of its touches, and some of the parts of that touch's time."""
Touched = dict[tuple[int, int], FloatArray]
"""Friction by kind of trial and touch, shape (trials of the kind, parts)."""
Trials = dict[int, tuple[IntArray, IntArray]]
"""Who has trials of a kind, and which, by kind."""
_AT_REST = -1
"""Stands for a touch of the beam at rest."""
_NEVER = 9
"""Stands for an expected answer where none is: nobody gives it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Cohort:
    """Virtual people in a session each, and what they answered.

    `slots` tells which plan each has, and `kinds` (people, trials) which kind of trial each is.
    `answered`, of that shape as all that follow, are the trials before somebody leaves; `change` is
    the reported one as in `answering.meaning`, of trials with a question; `score` is on the study's
    scale, NaN where none was asked for; `contrast` is the change of log friction under the finger,
    before noise, or its level where no question is about a change. `force_n` (people, touches) is
    of each touch, in order.
    """

    people: People
    slots: IntArray
    kinds: IntArray
    answered: BoolArray
    change: IntArray
    reaction_s: FloatArray
    score: FloatArray
    score_reaction_s: FloatArray
    contrast: FloatArray
    force_n: FloatArray

    def rows(self, which: slice) -> "Cohort":
        """Return some of the people."""
        own = {name: values[which] for name, values in vars(self).items() if name != "people"}
        return Cohort(people=self.people.rows(np.arange(self.people.size)[which]), **own)


def cohort(
    planned: PlannedTrials, people: People, names: Sequence[str], slots: IntArray, world: World
) -> Cohort:
    """Return what people answer in their sessions.

    `names` are those of their sessions (`person.session_name`), `slots` which plan each has.
    """
    kinds = planned.kinds_of(slots)
    touches = np.array([len(kind.marks) for kind in planned.kinds])[kinds]
    first_touch = np.cumsum(touches, axis=1) - touches
    most = int(touches.sum(axis=1).max())
    u = person.uniforms_of([f"touches/{name}" for name in names], most, answers.TOUCH_NUMBERS)
    force_n = np.full(u.shape[:2], np.nan)
    length_m = length_of(planned.study.surface)
    # Touches with a like drive are felt together.
    asked: dict[Drive, list[tuple[Parts, person.Fingers]]] = defaultdict(list)
    friction: Touched = {}
    found = enumerate(np.nonzero(kinds == number) for number in range(len(planned.kinds)))
    # Without kinds of another session.
    trials: Trials = {number: (who, trial) for number, (who, trial) in found if who.size}
    for number, (who, trial) in trials.items():
        kind, touching = planned.kinds[number], people.rows(who)
        for touch, mark in enumerate(kind.marks):
            at = first_touch[who, trial] + touch
            way = answers.course(touching, u[who, at], mark, length_m)
            force_n[who, at] = way.force_n
            # A person compares the last touch with the first one, and forgets those between: their
            # friction would be computed for nothing.
            if touch in {0, len(kind.marks) - 1}:
                friction[number, touch] = np.empty((len(who), len(answers.fractions(mark))))
                for drive, which, fingers in _fingers(planned.study, kind, touch, way, touching):
                    asked[drive].append((((number, touch), which), fingers))
        if kind.trial.rated:
            # A rating is relative to the beam at rest, at the end of the last touch.
            friction[number, _AT_REST] = np.empty((len(who), 1))
            drive, fingers = _at_rest(planned.study, kind, touching)
            asked[drive].append((((number, _AT_REST), np.array([0])), fingers))
    _feel(asked, friction, world)
    numbers = ("reaction_s", "score", "score_reaction_s")
    if isinstance(world.surface, GivenSurface):
        contrast = _worth(planned, trials, people, world, kinds.shape)
    else:
        contrast = _contrasts(planned.kinds, trials, friction, kinds.shape)
    made = Cohort(
        people=people,
        slots=slots,
        kinds=kinds,
        answered=np.zeros(kinds.shape, dtype=np.bool_),
        change=np.zeros(kinds.shape, dtype=np.int64),
        contrast=contrast,
        force_n=force_n,
        **{name: np.full(kinds.shape, np.nan) for name in numbers},
    )
    _answer(made, planned, names)
    return made


def joined(sessions: Sequence[Cohort]) -> Cohort:
    """Return the sessions of the same people as one, the trials of each after those before."""
    if len(sessions) == 1:
        return sessions[0]
    names = [it.name for it in fields(Cohort) if it.name not in ("people", "slots")]
    beside: dict[str, Any] = {
        name: np.concatenate([getattr(each, name) for each in sessions], axis=1) for name in names
    }
    # Who touches less often in a session than others has no forces at its end.
    in_order = np.argsort(np.isnan(beside["force_n"]), axis=1, kind="stable")
    beside["force_n"] = np.take_along_axis(beside["force_n"], in_order, axis=1)
    return replace(sessions[0], **beside)


def _fingers(
    study: Study, kind: AlikeTrials, number: int, way: answers.Course, people: People
) -> Iterator[tuple[Drive, IntArray, person.Fingers]]:
    """Yield the parts of a touch that have one drive each, and the fingers in them."""
    to_make, parts = kind.trial.touches[number], answers.fractions(kind.marks[number])
    places_m = way.places_m(parts)
    # A touch without a beam of its own is on the one that the study mounts.
    beam = to_make.beam or study.touch.beam
    own_m = beam_surface(study.surface).structure.body_height_m
    height_m = own_m * (beam is None or study.beams[beam] > 0)
    # A finger that stays at its place slides to and fro there.
    sliding_m_s = np.where(way.speed_m_s > 0, way.speed_m_s, REFERENCE_SPEED_M_S)
    voltages_v = to_make.voltage_v + parts * (to_make.end_voltage_v - to_make.voltage_v)
    # Relative to the rig's resonance, also if given in Hz: the model has another one.
    frequencies = to_make.frequency + parts * (to_make.end_frequency - to_make.frequency)
    # One frequency at a time, because the beam is solved once for each.
    for frequency in np.unique(frequencies).tolist():
        which = np.flatnonzero(frequencies == frequency)
        shape = (len(places_m), len(which))
        fingers = person.Fingers(
            place_m=places_m[:, which].ravel(),
            force_n=np.repeat(way.force_n, len(which)),
            speed_m_s=np.repeat(sliding_m_s, len(which)),
            voltage_v=np.broadcast_to(voltages_v[which], shape).ravel(),
            body_height_m=np.full(shape, height_m).ravel(),
            skin=np.repeat(people.skin, len(which)),
            mu0=np.repeat(people.mu0, len(which)),
        )
        yield (frequency, to_make.direction, beam or ""), which, fingers


def _at_rest(study: Study, kind: AlikeTrials, people: People) -> tuple[Drive, person.Fingers]:
    """Return the fingers at the end of the last touch, where nothing is driven."""
    to_make, mark = kind.trial.touches[-1], kind.marks[-1]
    beam = to_make.beam or study.touch.beam
    place_m = np.full(people.size, mark.end_m)
    fingers = person.Fingers(
        place_m=place_m,
        force_n=np.full(people.size, mark.force_n),
        speed_m_s=np.full(people.size, REFERENCE_SPEED_M_S),
        voltage_v=0.0 * place_m,
        body_height_m=0.0 * place_m,
        skin=people.skin,
        mu0=people.mu0,
    )
    return (1.0, to_make.direction, beam or ""), fingers


def _feel(
    asked: Mapping[Drive, list[tuple[Parts, person.Fingers]]], friction: Touched, world: World
) -> None:
    """Put the friction of all fingers into its places, those of one drive at once."""
    for (frequency, direction, beam), own in asked.items():
        parts = [vars(fingers) for _, fingers in own]
        names = parts[0].keys() - {"beam"}
        every = {name: np.concatenate([part[name] for part in parts]) for name in names}
        fingers = person.Fingers(**every, beam=beam)
        found = person.felt_friction(world, fingers, frequency * world.resonance_hz, direction)
        ends = np.cumsum([fingers.place_m.size for _, fingers in own])
        for ((key, which), _), felt in zip(own, np.split(found, ends[:-1]), strict=True):
            friction[key][:, which] = felt.reshape(-1, len(which))


def _contrasts(
    kinds: Sequence[AlikeTrials], trials: Trials, friction: Touched, shape: tuple[int, ...]
) -> FloatArray:
    """Return the change that each trial makes, shape (people, trials)."""
    contrast = np.zeros(shape)
    plain = (it for it in trials if kinds[it].trial.question is None)
    at_rest = [it for it in plain if not kinds[it].trial.rated]
    # What people remember of the beam at rest, if they touched it.
    resting = friction[at_rest[0], len(kinds[at_rest[0]].marks) - 1][:, -1] if at_rest else None
    for number, (who, trial) in trials.items():
        kind = kinds[number]
        if kind.trial.rated:
            last = len(kind.marks) - 1
            touched = answers.Felt(mark=kind.marks[last], friction=friction[number, last])
            levels = answers.felt_level([touched], friction[number, _AT_REST][:, 0])
            contrast[who, trial] = levels[:, 0]
        elif kind.trial.question is not None:
            felt = [
                answers.Felt(mark=kind.marks[touch], friction=friction[number, touch])
                # A trial of one touch has the same first and last; it counts once.
                for touch in dict.fromkeys([0, len(kind.marks) - 1])
            ]
            known = felt[0].friction[:, 0] if resting is None else resting[who]
            contrast[who, trial] = answers.felt_contrast(kind.trial.question, felt, known)
    return contrast


def _worth(
    planned: PlannedTrials, trials: Trials, people: People, world: World, shape: tuple[int, ...]
) -> FloatArray:
    """Return the same on a surface without a model."""
    contrast = np.zeros(shape)
    for number, (who, trial) in trials.items():
        asked = planned.kinds[number].trial
        if asked.question is not None or asked.rated:
            felt = answers.given_change(planned.study, asked, world, people.rows(who))
            contrast[who, trial] = felt
    return contrast


def _answer(made: Cohort, planned: PlannedTrials, names: Sequence[str]) -> None:
    """Add the answers, trial by trial: a person remembers the one before."""
    people, kinds, of = made.people, made.kinds, planned.kinds
    rated = np.array([kind.trial.rated for kind in of])[kinds]
    asks = rated | np.array([kind.trial.question is not None for kind in of])[kinds]
    two_sided = np.array([kind.two_sided for kind in of])[kinds]
    expected = np.array([_NEVER if kind.expected is None else kind.expected for kind in of])[kinds]
    scored = np.array([kind.trial.scored for kind in of])[kinds]
    extra = np.stack([answers.beyond(kind.change, people) for kind in of], axis=1)
    # There the points of an effect are all of it.
    extra *= planned.study.surface.kind != "given"
    rating = planned.study.rating
    most = int(asks.sum(axis=1).max())
    u = person.uniforms_of([f"questions/{name}" for name in names], most, answers.QUESTION_NUMBERS)
    # Random numbers are numbered by questions, so that a trial without one uses none.
    answering, everybody, asked = answers.Answering(people), np.arange(people.size), 0
    for trial in range(kinds.shape[1]):
        if rated[:, trial].all():  # as all conditions are, or none
            score, reaction_s = answering.rate(made.contrast[:, trial], u[:, asked], rating)
            asked += 1
            made.reaction_s[:, trial] = np.where(answering.left, np.nan, reaction_s)
            made.score[:, trial] = np.where(answering.left, np.nan, score)
            made.score_reaction_s[:, trial] = made.reaction_s[:, trial]  # the only answer
        elif asks[:, trial].any():
            change, reaction_s = answering.change(
                made.contrast[:, trial],
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


# Tables of scores of many cohorts at once, after the study's rules on who is left out.


def responses(planned: PlannedTrials, made: Cohort) -> FloatArray:
    """Return the response of each trial, (people, trials): see `analysis.loading.response`."""
    of = [None if it.trial.question is None else it.expected for it in planned.kinds]
    expected = np.array([_NEVER if it is None else it for it in of])[made.kinds]
    lowest = planned.study.rating.minimum
    rated = np.array([it.trial.rated for it in planned.kinds])[made.kinds]
    asked = np.where(made.change == expected, made.score - lowest + 1, 0.0)
    return np.where(rated, made.score, asked)


def mean_table(
    planned: PlannedTrials, made: Cohort, values: FloatArray, trials: slice = slice(None)
) -> FloatArray:
    """Return each person's means of the `values` of trials by condition, (people, conditions).

    Means are of `trials` alone, but the rules judge all of them. These are the rules of
    `analysis.loading.study_data`: trials are judged first, by the time to the first answer, then
    people, by the trials that are left to them. `values` has shape (people, trials), NaN where a
    trial has none.
    """
    conditions = planned.study.conditions
    names = [kind.trial.condition for kind in planned.kinds]
    # No column has the number -1, so that trials without a condition enter none.
    columns = [conditions.index(name) if name in conditions else -1 for name in names]
    condition = np.array(columns)[made.kinds]
    scored, _, out = counted_trials(planned, made)
    given = np.zeros_like(scored)
    given[:, trials] = (scored & ~np.isnan(values))[:, trials]
    table = np.full((made.people.size, len(conditions)), np.nan)
    for column in range(len(conditions)):
        counts = given & (condition == column)
        number = counts.sum(axis=1)
        total = np.where(counts, values, 0.0).sum(axis=1)
        # Where nothing counts the cell stays NaN: missing, not zero.
        np.divide(total, number, out=table[:, column], where=number > 0)
    table[out] = np.nan
    return table


def noticed_counts(planned: PlannedTrials, made: Cohort) -> IntArray:
    """Return reported changes and trials by condition, and of catch trials in the last row.

    Shape (people, conditions + 1, 2). Trials that expect no change are neither, as in the report;
    those whom the rules leave out have none, but for the rule on false alarms, which would choose
    the catch trials by their answers.
    """
    rules = planned.study.exclusions.model_copy(update={"max_false_alarms": None})
    (scored, catch, out), kinds = counted_trials(planned, made, rules), planned.kinds
    of_rows = [
        [it.trial.condition == name and it.expected not in {None, answers.SAME} for it in kinds]
        for name in planned.study.conditions
    ]
    of_rows.append([it.trial.kind == "catch" for it in kinds])
    asked = (scored | catch) & ~out[:, None]
    reported = made.change != answers.SAME
    each = [asked & np.array(row)[made.kinds] for row in of_rows]
    return np.array([[(some & reported).sum(1), some.sum(1)] for some in each]).transpose(2, 0, 1)


def counted_trials(
    planned: PlannedTrials, made: Cohort, rules: Exclusions | None = None
) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return which scored and catch trials count, (people, trials), and whom the rules leave out.

    The trials of those who are left out may be among them. The `rules` are the study's unless they
    are given.
    """
    rules = planned.study.exclusions if rules is None else rules
    kind = np.array([it.trial.kind for it in planned.kinds])[made.kinds]
    scored, catch = kind == "trial", kind == "catch"
    timed = {"reaction_s": np.where(scored | catch, made.reaction_s, np.nan)}
    late = broken_rules(rules, "trial", timed)
    kept = ~np.logical_or.reduce([~made.answered, *late.values()])
    counted = {
        "scored": kept & scored,
        "planned": scored,
        # As a report counts them: a score that nobody asked for is not missing.
        "missing": scored & ~made.answered,
        "catches": kept & catch,
        "alarms": kept & catch & (made.change != answers.SAME),
    }
    numbers = {name: some.sum(axis=1) for name, some in counted.items()}
    broken = broken_rules(rules, "participant", numbers)
    out = np.zeros(made.people.size, dtype=np.bool_)
    return counted["scored"], counted["catches"], np.logical_or.reduce([out, *broken.values()])


class Tables(NamedTuple):
    """What the tests of simulated cohorts take; the row of somebody left out is empty.

    Attributes:
        responses: means, shape (cohorts, people, conditions); NaN where no trial was answered.
        noticed: see `noticed_counts`, shape (cohorts, people, conditions + 1, 2).
        by_session: responses by session, shape (cohorts, people, conditions, sessions).
        groups: positions among the study's groups, shape (cohorts, people); 0 without groups.
    """

    responses: FloatArray
    noticed: IntArray
    by_session: FloatArray
    groups: IntArray


def names_of(participants: int) -> list[str]:
    """Return the pseudonyms of simulated participants."""
    return [f"P{number:02d}" for number in range(1, participants + 1)]


@dataclass(frozen=True, kw_only=True)
class Simulation:
    """A study, the people who take part and the world that they touch.

    The participants are `P01`, `P02` and so on, each in the next slot of the design. With the same
    seed they answer as in the sessions of `touchbeam demo`, one number in thousands aside, which
    was rounded on the way to the device and back. Touches that come again, practice that is
    renewed, and the study's own questions are left out.
    """

    study: Study
    population: Population = person.DEFAULT
    world: World = field(default_factory=World)

    def sessions(self, participants: int, *seeds: int | str) -> list[Cohort]:
        """Return the first sessions of all, their second ones and so on apart.

        Of several seeds the cohorts follow each other. A seed is a number, or any text that is a
        spawn key.
        """
        return self._sessions([one for seed in seeds for one in self._who(participants, seed)])

    def studies(self, participants: int, *seeds: int | str) -> tuple[Tables, Cohort]:
        """Return what the tests of cohorts take, one for each seed, and all their people."""
        return self.tables(participants, self.sessions(participants, *seeds))

    def tables(self, participants: int, sessions: Sequence[Cohort]) -> tuple[Tables, Cohort]:
        """Return the same of cohorts of so many people each, from `sessions` as above."""
        everybody, ends = joined(sessions), np.cumsum([one.kinds.shape[1] for one in sessions])
        trials = (slice(*of_session) for of_session in pairwise([0, *ends.tolist()]))
        means = partial(mean_table, self.planned, everybody)
        answered = responses(self.planned, everybody)
        by_session = [means(answered, some) for some in trials]
        arrays: list[Any] = [
            means(answered) if len(sessions) > 1 else by_session[0],
            noticed_counts(self.planned, everybody),
            np.stack(by_session, axis=-1),
        ]
        of_study, noticed, apart = (
            array.reshape(-1, participants, *array.shape[1:]) for array in arrays
        )
        groups = [self.planned.place(slot)[0] for slot in range(participants)]
        of_people = [self.study.groups.index(group) if group else 0 for group in groups]
        places = np.broadcast_to(of_people, (len(of_study), participants))
        return Tables(of_study, noticed, apart, places), everybody

    @property
    def planned(self) -> PlannedTrials:
        """The trials of the study, drawn once; the kinds of trial are those of all sessions."""
        return self.plans[0]

    @cached_property
    def plans(self) -> list[PlannedTrials]:
        """The trials of each number of the session."""
        first = PlannedTrials(study=self.study)
        later = range(2, self.study.design.sessions + 1)
        return [first, *(replace(first, session=session) for session in later)]

    def _who(self, participants: int, seed: int | str) -> list[tuple[int | str, str, int]]:
        return [(seed, name, slot) for slot, name in enumerate(names_of(participants))]

    def _people(self, who: Sequence[tuple[int | str, str, int]]) -> People:
        """Return the people, each drawn from the population of the own group."""
        names = np.array([person.person_name(seed, name) for seed, name, _ in who])
        groups = [self.planned.place(slot)[0] for *_, slot in who]
        values = np.empty((len(who), len(person.PARAMETERS)))
        for group in set(groups):
            rows = np.array([other == group for other in groups])
            drawn = person.people_of(self.population.of_group(group), names[rows].tolist())
            values[rows] = np.stack([getattr(drawn, name) for name in person.PARAMETERS], axis=-1)
        return People(values)

    def _sessions(self, who: Sequence[tuple[int | str, str, int]]) -> list[Cohort]:
        people, slots = self._people(who), np.array([slot for *_, slot in who], dtype=np.int64)
        made = []
        for planned in self.plans:
            names = [person.session_name(seed, name, planned.session) for seed, name, _ in who]
            made.append(cohort(planned, people, names, slots, self.world))
        return made
