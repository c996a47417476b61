"""A study simulated with virtual people: their trials as arrays, and tables of scores."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.loading.study_data import broken_rules
from analysis.simulation.cohort import Cohort, PlannedTrials, cohort, joined
from device.people import person
from device.people.answering import SAME
from device.people.person import DEFAULT, PARAMETERS, People, Population, World
from protocol.study.study import Study

# Tables of scores of many cohorts at once, after the study's rules on who is left out.


def score_tables(planned: PlannedTrials, made: Cohort, trials: slice = slice(None)) -> FloatArray:
    """Return each person's mean score by condition, shape (people, conditions).

    Means are of `trials` alone, but the rules judge all of them. These are the rules of
    `analysis.loading.study_data`: trials are judged first, by the time to the first answer, then
    people, by the trials that are left to them.
    """
    conditions = planned.study.conditions
    names = [kind.trial.condition for kind in planned.kinds]
    # No column has the number -1, so that trials without a condition enter none.
    columns = [conditions.index(name) if name in conditions else -1 for name in names]
    condition = np.array(columns)[made.kinds]
    scored, _, out = counted_trials(planned, made)
    given = np.zeros_like(scored)
    given[:, trials] = (scored & ~np.isnan(made.score))[:, trials]
    table = np.full((made.people.size, len(conditions)), np.nan)
    for column in range(len(conditions)):
        counts = given & (condition == column)
        number = counts.sum(axis=1)
        total = np.where(counts, made.score, 0.0).sum(axis=1)
        # Where nothing counts the cell stays NaN: a missing score, not zero.
        np.divide(total, number, out=table[:, column], where=number > 0)
    table[out] = np.nan
    return table


def noticed_counts(planned: PlannedTrials, made: Cohort) -> IntArray:
    """Return reported changes and trials by condition, and of catch trials in the last row.

    Shape (people, conditions + 1, 2). Trials that expect no change are neither, as in the report;
    those whom the rules leave out have none.
    """
    (scored, catch, out), kinds = counted_trials(planned, made), planned.kinds
    of_rows = [
        [it.trial.condition == name and it.expected not in {None, SAME} for it in kinds]
        for name in planned.study.conditions
    ]
    of_rows.append([it.trial.kind == "catch" for it in kinds])
    asked = (scored | catch) & ~out[:, None]
    reported = made.change != SAME
    each = [asked & np.array(row)[made.kinds] for row in of_rows]
    return np.array([[(some & reported).sum(1), some.sum(1)] for some in each]).transpose(2, 0, 1)


def counted_trials(planned: PlannedTrials, made: Cohort) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return which scored and catch trials count, (people, trials), and whom the rules leave out.

    The trials of those who are left out may be among them.
    """
    kind = np.array([it.trial.kind for it in planned.kinds])[made.kinds]
    scored, catch = kind == "trial", kind == "catch"
    timed = {"reaction_s": np.where(scored | catch, made.reaction_s, np.nan)}
    late = broken_rules(planned.study.exclusions, "trial", timed)
    kept = ~np.logical_or.reduce([~made.answered, *late.values()])
    counted = {
        "scored": kept & scored,
        "missing": kept & scored & np.isnan(made.score),
        "catches": kept & catch,
        "alarms": kept & catch & (made.change != SAME),
    }
    numbers = {name: some.sum(axis=1) for name, some in counted.items()}
    broken = broken_rules(planned.study.exclusions, "participant", numbers)
    out = np.zeros(made.people.size, dtype=np.bool_)
    return counted["scored"], counted["catches"], np.logical_or.reduce([out, *broken.values()])


class Tables(NamedTuple):
    """What the tests of simulated cohorts take; the row of somebody left out is empty.

    Attributes:
        scores: means, shape (cohorts, people, conditions); NaN where no score was given.
        noticed: see `noticed_counts`, shape (cohorts, people, conditions + 1, 2).
        by_session: the means by session, shape (cohorts, people, conditions, sessions).
        groups: positions among the study's groups, shape (cohorts, people); 0 without groups.
    """

    scores: FloatArray
    noticed: IntArray
    by_session: FloatArray
    groups: IntArray


_AT_ONCE = 2_000
"""Sessions that are simulated at once: more would need more memory and save no time."""


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
    population: Population = DEFAULT
    world: World = field(default_factory=World)

    def cohort(self, participants: int, seed: int | str) -> Cohort:
        """Return the sessions of one cohort as arrays; `planned` has the trials.

        The `seed` is a number, or any text that is a spawn key.
        """
        return joined(self.sessions(participants, seed))

    def sessions(self, participants: int, seed: int | str) -> list[Cohort]:
        """Return the same, with the first sessions of all, their second ones and so on apart."""
        return self._sessions(self._who(participants, seed))

    def tables(self, participants: int, seeds: Sequence[int | str]) -> Tables:
        """Return what the tests of cohorts take, a cohort for each seed."""
        who = [one for seed in seeds for one in self._who(participants, seed)]
        found: list[list[Any]] = []
        for begin in range(0, len(who), _AT_ONCE):
            sessions = self._sessions(who[begin : begin + _AT_ONCE])
            made, ends = joined(sessions), np.cumsum([each.kinds.shape[1] for each in sessions])
            each = (slice(*of) for of in pairwise([0, *ends.tolist()]))
            by_session = [score_tables(self.planned, made, of) for of in each]
            of_study = score_tables(self.planned, made) if len(sessions) > 1 else by_session[0]
            counts = noticed_counts(self.planned, made)
            found.append([of_study, counts, np.stack(by_session, axis=-1)])
        shape = (len(seeds), participants)
        scores, noticed, apart = (
            np.concatenate(arrays).reshape(*shape, *arrays[0].shape[1:])
            for arrays in zip(*found, strict=True)
        )
        groups = [self.planned.place(slot)[0] for slot in range(participants)]
        of = [self.study.groups.index(group) if group else 0 for group in groups]
        return Tables(scores, noticed, apart, np.broadcast_to(of, shape))

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
        values = np.empty((len(who), len(PARAMETERS)))
        for group in set(groups):
            rows = np.array([other == group for other in groups])
            drawn = person.people_of(self.population.of_group(group), names[rows].tolist())
            values[rows] = np.stack([getattr(drawn, name) for name in PARAMETERS], axis=-1)
        return People(values)

    def _sessions(self, who: Sequence[tuple[int | str, str, int]]) -> list[Cohort]:
        people, slots = self._people(who), np.array([slot for *_, slot in who], dtype=np.int64)
        made = []
        for planned in self.plans:
            names = [person.session_name(seed, name, planned.session) for seed, name, _ in who]
            made.append(cohort(planned, people, names, slots, self.world))
        return made
