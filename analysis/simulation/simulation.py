"""A study simulated with virtual people: its trials as after loading, or only its score tables."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.loading.course import Rows
from analysis.loading.records import AttemptRow, SessionRow, TouchRow
from analysis.loading.sessions import Sessions, sessions_of
from analysis.loading.study_data import StudyData, broken_rules, study_data
from analysis.simulation.cohort import Cohort, PlannedTrials, TrialKind, cohort, joined
from device.people.answering import SAME, answer_of
from device.people.person import (
    DEFAULT,
    PARAMETERS,
    People,
    Population,
    World,
    people_of,
    person_name,
    session_name,
    truth_of,
)
from protocol.study.study import Study

# Simulated sessions as the tables that loading makes of a journal.


def loaded_sessions(
    made: Sequence[tuple[PlannedTrials, Cohort]], names: list[str], seed: int | str, world: World
) -> Sessions:
    """Return each person's sessions, in order, as if they had been read from a journal."""
    rows = Rows()
    for person, name in enumerate(names):
        for planned, of in made:
            group, slot = planned.place(int(of.slots[person]))
            rows.sessions.append(
                SessionRow(
                    participant=name,
                    session=planned.session,
                    # Virtual answers must never pass for those of people.
                    session_kind="rehearsal",
                    conditions=planned.study.conditions,
                    session_completed=bool(of.answered[person].all()),
                    slot=slot,
                    group=group,
                    seed=seed,
                    virtual=truth_of(of.people[person], world),
                )
            )
            _add_trials(rows, planned, of, person)
    return sessions_of(rows)


def _add_trials(rows: Rows, planned: PlannedTrials, made: Cohort, person: int) -> None:
    """Add the trials of a session up to the one that is left, each with its touches."""
    touch = 0
    for trial in planned.plan(int(made.slots[person])).trials:
        kind = planned.kinds[made.kinds[person, trial.index]]
        answered = bool(made.answered[person, trial.index])
        said = int(made.change[person, trial.index])
        asked = trial.question if answered else None
        change = None if asked is None else answer_of(asked, said)
        rows.attempts.append(
            AttemptRow.begun(
                trial,
                session_id=rows.sessions.last_id,
                attempt=1,
                answered=answered,
                change=change,
                agrees=None if change is None else change == trial.expected,
                score=_given(made.score[person, trial.index]),
                reaction_time_s=_given(made.reaction_s[person, trial.index]),
                score_reaction_time_s=_given(made.score_reaction_s[person, trial.index]),
                resonance_hz=planned.study.rig.nominal_resonance_hz,
            )
        )
        for number, mark in enumerate(kind.marks):
            _add_touch(rows, planned, kind, number, float(made.force_n[person, touch]))
            # One sample is enough, because only the median of a resting finger's place is read.
            if not mark.slides:
                place_m = mark.start_m + float(made.people.place_offset_m[person])
                rows.sampled.append(rows.touches.last_id)
                rows.samples.extend((0.0, float(made.force_n[person, touch]), place_m))
            touch += 1
        if not answered:
            return


def _given(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _add_touch(
    rows: Rows, planned: PlannedTrials, kind: TrialKind, number: int, force_n: float
) -> None:
    resonance_hz = planned.study.rig.nominal_resonance_hz
    touch = kind.trial.touches[number].at(resonance_hz)
    rows.touches.append(
        TouchRow.begun(
            touch,
            attempt_id=rows.attempts.last_id,
            beam=touch.beam or planned.study.touch.beam,
            commanded_voltage_v=touch.voltage_v,
            commanded_frequency_hz=touch.frequency * resonance_hz,
            start_voltage_v=touch.voltage_v,
            end_voltage_v=touch.end_voltage_v,
            start_frequency_hz=touch.frequency * resonance_hz,
            end_frequency_hz=touch.end_frequency * resonance_hz,
            # The journal keeps a touch's force to a tenth of a millinewton.
            force_n=round(force_n, 4),
        )
    )


# Tables of scores of many cohorts at once, after the study's rules on who is left out.


def score_tables(planned: PlannedTrials, made: Cohort, trials: slice = slice(None)) -> FloatArray:
    """Return each person's mean score by condition, shape (people, conditions).

    Means are of `trials` alone, but the rules judge all of them. These are the rules of
    `analysis.loading.study_data`: trials are judged first, by the time to the first answer, then
    people, by the trials that are left to them.
    """
    conditions = planned.study.conditions
    of = planned.kinds
    names = [kind.trial.condition for kind in of]
    # No column has the number -1, so that trials without a condition enter none.
    columns = [conditions.index(name) if name in conditions else -1 for name in names]
    condition = np.array(columns)[made.kinds]
    counted = counted_trials(planned, made)
    among = np.zeros(counted.scored.shape[1], dtype=np.bool_)
    among[trials] = True
    given = counted.scored & among & ~np.isnan(made.score)
    table = np.full((made.people.size, len(conditions)), np.nan)
    for column in range(len(conditions)):
        counts = given & (condition == column)
        number = counts.sum(axis=1)
        total = np.where(counts, made.score, 0.0).sum(axis=1)
        # Where nothing counts the cell stays NaN: a missing score, not zero.
        np.divide(total, number, out=table[:, column], where=number > 0)
    table[counted.out] = np.nan
    return table


def noticed_counts(planned: PlannedTrials, made: Cohort) -> IntArray:
    """Return reported changes and trials by condition, and of catch trials in the last row.

    Shape (people, conditions + 1, 2). Trials that expect no change are neither, as in the report;
    those whom the rules leave out have none.
    """
    names, counted = planned.study.conditions, counted_trials(planned, made)
    row = [
        len(names)
        if kind.trial.kind == "catch"
        else names.index(kind.trial.condition)
        if kind.trial.condition in names and kind.expected not in {None, SAME}
        else -1
        for kind in planned.kinds
    ]
    rows = np.array(row)[made.kinds]
    asked = (counted.scored | counted.catch) & ~counted.out[:, None]
    reported = made.change != SAME
    each = [asked & (rows == number) for number in range(len(names) + 1)]
    return np.array([[(some & reported).sum(1), some.sum(1)] for some in each]).transpose(2, 0, 1)


class Counted(NamedTuple):
    """Which scored and catch trials count, (people, trials), and whom the rules leave out.

    The trials of those who are left out may be among them.
    """

    scored: BoolArray
    catch: BoolArray
    out: BoolArray


def counted_trials(planned: PlannedTrials, made: Cohort) -> Counted:
    """Return which trials count, by the study's rules on who and what is left out."""
    of = planned.kinds
    scored = np.array([kind.trial.kind == "trial" for kind in of])[made.kinds]
    catch = np.array([kind.trial.kind == "catch" for kind in of])[made.kinds]
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
    return Counted(
        scored=counted["scored"],
        catch=counted["catches"],
        out=np.logical_or.reduce([out, *broken.values()]),
    )


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

    def data(self, participants: int, seed: int | str) -> StudyData:
        """Return what the estimators take: the sessions of one cohort, as they are loaded.

        The `seed` is a number, or any text that is a spawn key.
        """
        names = names_of(participants)
        made = list(zip(self._planned, self._sessions(self._who(participants, seed)), strict=True))
        found = loaded_sessions(made, names, seed, self.world)
        return study_data(found, rehearsals=True, rules=self.study.exclusions)

    def cohort(self, participants: int, seed: int | str) -> Cohort:
        """Return the same sessions as arrays, in a tenth of the time; `planned` has the trials."""
        return joined(self._sessions(self._who(participants, seed)))

    def score_tables(self, participants: int, seeds: Sequence[int | str]) -> FloatArray:
        """Return the table of scores of each seed's cohort, see `Tables`."""
        return self.tables(participants, seeds).scores

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
        return self._planned[0]

    @cached_property
    def _planned(self) -> list[PlannedTrials]:
        first = PlannedTrials(study=self.study)
        later = range(2, self.study.design.sessions + 1)
        return [first, *(replace(first, session=session) for session in later)]

    def _who(self, participants: int, seed: int | str) -> list[tuple[int | str, str, int]]:
        return [(seed, name, slot) for slot, name in enumerate(names_of(participants))]

    def _people(self, who: Sequence[tuple[int | str, str, int]]) -> People:
        """Return the people, each drawn from the population of the own group."""
        names = np.array([person_name(seed, name) for seed, name, _ in who])
        groups = [self.planned.place(slot)[0] for *_, slot in who]
        values = np.empty((len(who), len(PARAMETERS)))
        for group in set(groups):
            rows = np.array([other == group for other in groups])
            drawn = people_of(self.population.of_group(group), names[rows].tolist())
            values[rows] = np.stack([getattr(drawn, name) for name in PARAMETERS], axis=-1)
        return People(values)

    def _sessions(self, who: Sequence[tuple[int | str, str, int]]) -> list[Cohort]:
        people = self._people(who)
        slots = np.array([slot for *_, slot in who], dtype=np.int64)
        return [
            cohort(
                planned,
                people,
                [session_name(seed, name, planned.session) for seed, name, _ in who],
                slots,
                self.world,
            )
            for planned in self._planned
        ]
