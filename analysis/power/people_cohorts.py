"""Cohorts of virtual people, and the contrasts that a report would predict of their trials."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import nan
from typing import NamedTuple

import numpy as np

from analysis.estimates import FloatArray, IntArray
from analysis.simulation import AlikeTrials, Cohort, Simulation
from analysis.trials.contrasts import felt_change, planned_change_of
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import Change, predicted_contrast
from device.friction.surfaces import length_of
from device.people.person import DEFAULT, Population, World
from protocol.journal.records import LIFTED_N
from protocol.study.study import Study
from protocol.study.touch import Touch


@dataclass(frozen=True, kw_only=True)
class PeopleCohorts:
    """Simulated cohorts of a study, on its rig as calibrated.

    A key gives the same cohort every time, on every machine.
    """

    study: Study
    participants: int
    population: Population = DEFAULT
    rig: Calibration = NOMINAL

    def contrasts(self, cohort: Cohort, who: IntArray, trial: IntArray) -> FloatArray:
        """Return the contrast of each trial of a person as a report predicts it, (trials,)."""
        resonance_hz, of_kinds = self.study.rig.nominal_resonance_hz, []
        kinds_of_trial = self.simulation.planned.kinds
        for kind in kinds_of_trial:
            plan = kind.trial
            asked = (plan.kind, plan.question, plan.expected)
            change = planned_change_of(self.study, *asked, plan.touches)
            # A contrast is between the first touch and the last; they may be one.
            ends = dict.fromkeys([0, len(kind.marks) - 1])
            of_kinds.append((change, [_touched(kind, number, resonance_hz) for number in ends]))
        kinds, offsets_m = cohort.kinds[who, trial], cohort.people.place_offset_m[who]
        count = np.array([len(kind.marks) for kind in kinds_of_trial])[cohort.kinds]
        first = (np.cumsum(count, axis=1) - count)[who, trial]
        last = first + count[who, trial] - 1
        # The journal keeps a touch's force to a tenth of a millinewton.
        forces_n = zip(
            *(cohort.force_n[who, touch].tolist() for touch in (first, last)), strict=True
        )
        contrasts = np.full(len(who), nan)
        length_m = length_of(self.study.surface)
        trials = zip(kinds.tolist(), offsets_m.tolist(), forces_n, strict=True)
        for row, (number, offset_m, of_ends_n) in enumerate(trials):
            change, planned = of_kinds[number]
            if change is not None:
                touches = [
                    touch._replace(
                        force_n=round(force_n, 4),
                        place_m=touch.place_m + offset_m if force_n > LIFTED_N else nan,
                    )
                    for touch, force_n in zip(planned, of_ends_n, strict=False)
                ]
                felt = felt_change(change, touches, resonance_hz, length_m)
                contrasts[row] = _contrast(felt, self.rig)
        return contrasts

    @cached_property
    def simulation(self) -> Simulation:
        # People feel the rig as calibrated, which the analysis supposes, too.
        world = World(
            damping_ratio=self.rig.damping_ratio,
            gain=self.rig.gain,
            surface=self.rig.surface,
            effect=self.population.effect,
        )
        return Simulation(study=self.study, population=self.population, world=world)


class _Touched(NamedTuple):
    """A simulated touch with the names that a loaded one has in the table of touches."""

    planned: Touch
    force_n: float
    place_m: float
    start_voltage_v: float
    start_frequency_hz: float
    end_voltage_v: float
    end_frequency_hz: float


def _touched(kind: AlikeTrials, number: int, resonance_hz: float) -> _Touched:
    """Return a touch as the rig would have measured it, but for the finger: see `loaded_sessions`.

    Its place is where it is held, NaN if it moves.
    """
    touch, mark = kind.trial.touches[number].at(resonance_hz), kind.marks[number]
    held = touch.place != "path" and not mark.slides
    return _Touched(
        planned=touch,
        force_n=nan,
        place_m=mark.start_m if held else nan,
        start_voltage_v=touch.voltage_v,
        start_frequency_hz=touch.frequency * resonance_hz,
        end_voltage_v=touch.end_voltage_v,
        end_frequency_hz=touch.end_frequency * resonance_hz,
    )


@lru_cache(maxsize=16_384)
def _contrast(change: Change, rig: Calibration) -> float:
    """Return the contrast of a change; measured values come in steps, so again."""
    return predicted_contrast(change, rig=rig)
