"""A study simulated with virtual people: its trials as after loading, or only its score tables."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from analysis.estimates import FloatArray
from analysis.loading.study_data import StudyData, study_data
from analysis.simulation.cohort import Cohort, cohort
from analysis.simulation.loaded_sessions import loaded_sessions
from analysis.simulation.planned_trials import PlannedTrials
from analysis.simulation.score_tables import score_tables
from device.people.person import (
    DEFAULT,
    Population,
    World,
    people_of,
    person_name,
    session_name,
)
from protocol.study.study import Study

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

        Args:
            participants: how many take part.
            seed: a number, or any text that is a spawn key.
        """
        names = names_of(participants)
        made = self.cohort(participants, seed)
        found = loaded_sessions(self.planned, made, names, seed, self.world)
        return study_data(found, rehearsals=True, rules=self.study.exclusions)

    def cohort(self, participants: int, seed: int | str) -> Cohort:
        """Return the same sessions as arrays, in a tenth of the time; `planned` has the trials."""
        return self._cohort(
            [(seed, name, slot) for slot, name in enumerate(names_of(participants))]
        )

    def score_tables(self, participants: int, seeds: Sequence[int | str]) -> FloatArray:
        """Return the table of scores of each seed's cohort, NaN where a score is missing.

        Shape (seeds, participants, conditions); the row of a participant whom the study's rules
        leave out is empty.
        """
        names = names_of(participants)
        who = [(seed, name, slot) for seed in seeds for slot, name in enumerate(names)]
        parts = [
            score_tables(self.planned, self._cohort(who[begin : begin + _AT_ONCE]))
            for begin in range(0, len(who), _AT_ONCE)
        ]
        shape = (len(seeds), participants, len(self.study.conditions))
        return np.concatenate(parts).reshape(shape) if parts else np.empty(shape)

    @cached_property
    def planned(self) -> PlannedTrials:
        """The trials of the study, drawn once."""
        return PlannedTrials(study=self.study)

    def _cohort(self, who: Sequence[tuple[int | str, str, int]]) -> Cohort:
        people = people_of(self.population, [person_name(seed, name) for seed, name, _ in who])
        sessions = [session_name(seed, name, 1) for seed, name, _ in who]
        slots = np.array([slot for *_, slot in who], dtype=np.int64)
        return cohort(self.planned, people, sessions, slots, self.world)
