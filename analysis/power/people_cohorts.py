"""Cohorts of virtual people, as the report would analyse their sessions."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.estimates import FloatArray
from analysis.loading.study_data import NothingToReport
from analysis.power.cohorts import Cohort
from analysis.sensitivity.ratings import Ratings
from analysis.simulation.simulation import Simulation
from analysis.trials.arrays import scored_trials
from analysis.trials.contrasts import trial_contrasts
from device.friction.calibration import NOMINAL, Calibration
from device.people.person import DEFAULT, Population, World, people_of
from protocol.study.rules import PAPERS_SCALE
from protocol.study.study import Study

_DRAWN_FOR_MEANS = 10_000


@dataclass(frozen=True, kw_only=True)
class PeopleCohorts:
    """Simulated cohorts of a study, analysed as on its rig."""

    study: Study
    participants: int
    population: Population = DEFAULT
    rig: Calibration = NOMINAL

    def tables(self, keys: Sequence[str]) -> FloatArray:
        """Return the tables of scores of the studies of `keys`."""
        return self._simulation.score_tables(self.participants, keys)

    def cohort(self, key: str) -> Cohort:
        """Return the study of `key`.

        A person's true gain is per unit of the predicted contrast, as the estimated one is, so
        that its skin, which changes the contrast, is a part of it.
        """
        try:
            data = self._simulation.data(self.participants, key)
        except NothingToReport:  # the rules of exclusion leave nobody
            return self._of_nobody()
        contrasts = trial_contrasts(self.study, data.trials, data.touches, self.rig)
        truths = [data.virtual[name] for name in data.table.subjects]
        unit = self.study.rating.span / PAPERS_SCALE.span
        zero = self.study.rating.minimum - unit * PAPERS_SCALE.minimum
        return Cohort(
            ratings=scored_trials(data, contrasts).ratings,
            bias=np.array([zero + unit * truth.bias for truth in truths]),
            gain=np.array([unit * truth.gain * truth.skin for truth in truths]),
            population_gain=unit * self._mean_gain,
        )

    def _of_nobody(self) -> Cohort:
        nothing, none = np.zeros(0), np.zeros(0, dtype=np.int64)
        ratings = Ratings(
            subjects=(),
            conditions=self.study.conditions,
            subject=none,
            condition=none,
            contrast=nothing,
            rating=nothing,
        )
        return Cohort(ratings=ratings, bias=nothing, gain=nothing, population_gain=0.0)

    @cached_property
    def _simulation(self) -> Simulation:
        world = World(damping_ratio=self.rig.damping_ratio, gain=self.rig.gain)
        return Simulation(study=self.study, population=self.population, world=world)

    @cached_property
    def _mean_gain(self) -> float:
        names = [f"mean/{number}" for number in range(_DRAWN_FOR_MEANS)]
        people = people_of(self.population, names)
        return float((people.gain * people.skin).mean())
