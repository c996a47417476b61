"""Cohorts of virtual people, as the report would analyse their sessions."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import nan
from typing import NamedTuple

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.sensitivity.lines import Ratings
from analysis.simulation import (
    AlikeTrials,
    Cohort,
    Simulation,
    Tables,
    counted_trials,
    names_of,
)
from analysis.trials.contrasts import felt_change, planned_change_of
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import LAW, RUNG, Change, predicted_contrast
from device.friction.laws import LAWS
from device.friction.surfaces import length_of
from device.people.person import DEFAULT, Population, World, people_of
from protocol.journal.records import LIFTED_N
from protocol.study.rules import PAPERS_SCALE
from protocol.study.study import Study
from protocol.study.touch import Touch

# A simulated cohort as the estimators take it, and its null: the same without any effect.


@dataclass(frozen=True, kw_only=True, eq=False)
class RatedCohort:
    """The scored trials of a simulated study that its exclusions leave, and the truth.

    `bias` and `gain` are the subjects' true ones, shape (subjects,), in points of the study's
    scale and per unit of contrast; `population_gain` is the mean of those they were drawn from.
    """

    ratings: Ratings
    bias: FloatArray
    gain: FloatArray
    population_gain: float


def without_effect(tables: Tables, streams: Iterable[np.random.Generator]) -> Tables:
    """Return tables without any effect, with a stream for each cohort.

    Each subject's responses are shuffled over the conditions, and over the sessions of a condition;
    scores alike. How people answer stays; the conditions mean nothing any more, so that every
    difference, and every difference between gains, is 0. Subjects are shuffled between groups, and
    each one's reported changes are drawn anew over all trials, so that with a signal they are no
    more than without.
    """
    cohorts = []
    for responses, scores, noticed, by_session, groups, rng in zip(*tables, streams, strict=True):
        # Each row on its own, so that a person's level stays and only the conditions lose their
        # meaning.
        order = rng.permuted(np.tile(np.arange(scores.shape[1]), (len(scores), 1)), axis=1)
        answered, scored = (np.take_along_axis(each, order, axis=1) for each in (responses, scores))
        reported = _unnoticed(noticed, rng)
        apart = rng.permuted(np.take_along_axis(by_session, order[..., None], axis=1), axis=2)
        cohorts.append((answered, scored, reported, apart, rng.permutation(groups)))
    return Tables(*(np.stack(table) for table in zip(*cohorts, strict=True)))


def _unnoticed(noticed: IntArray, rng: np.random.Generator) -> IntArray:
    reported, trials = noticed[..., 0], noticed[..., 1]
    drawn = [
        # `marginals` takes as long for a thousand trials as for ten.
        rng.multivariate_hypergeometric(of_person, int(reports), method="marginals")
        for of_person, reports in zip(trials, reported.sum(axis=1), strict=True)
    ]
    return np.stack([np.array(drawn), trials], axis=-1)


# The mean of gain times skin has no closed form for every population; so many make it known far
# better than a study could estimate it.
_DRAWN_FOR_MEANS = 10_000


@dataclass(frozen=True, kw_only=True)
class PeopleCohorts:
    """Simulated cohorts of a study, analysed as on its rig.

    A key gives the same study every time, on every machine.
    """

    study: Study
    participants: int
    population: Population = DEFAULT
    rig: Calibration = NOMINAL

    def studies(self, keys: Sequence[str]) -> tuple[Tables, Iterator[RatedCohort]]:
        """Return what the tests take of the studies of `keys`, and each as the estimators take it.

        A person's true gain is per unit of the predicted contrast, as the estimated one is, so
        that its skin, which changes the contrast, is a part of it.
        """
        size = self.participants
        tables, everybody = self._simulation.studies(size, *keys)
        cohorts = (
            everybody.rows(slice(first, first + size)) for first in range(0, size * len(keys), size)
        )
        return tables, map(self._rated, cohorts)

    def _rated(self, cohort: Cohort) -> RatedCohort:
        names = names_of(self.participants)
        counted, _, out = counted_trials(self._simulation.planned, cohort)
        # Who left before the first answer breaks no rule, because there is nothing to judge.
        kept = np.flatnonzero(~(out & cohort.answered.any(axis=1)))
        # People are described on the paper's scale and answer on the study's.
        unit = self.study.rating.span / PAPERS_SCALE.span
        zero = self.study.rating.minimum - unit * PAPERS_SCALE.minimum
        people = cohort.people.rows(kept)
        return RatedCohort(
            ratings=self._ratings(cohort, counted, kept, tuple(names[who] for who in kept)),
            bias=zero + unit * people.bias,
            gain=unit * people.gain * people.skin,
            population_gain=unit * self._mean_gain if kept.size else 0.0,
        )

    def _ratings(
        self, cohort: Cohort, counted: BoolArray, kept: IntArray, names: tuple[str, ...]
    ) -> Ratings:
        """Return the trials of those who are `kept`, with contrasts as a report has them."""
        who, trial = np.nonzero(counted[kept])
        contrasts = self._contrasts(cohort, kept[who], trial)
        # As in a report: trials that only some laws predict are left out of all.
        predicted = np.isfinite(contrasts).all(axis=1)
        conditions = self.study.conditions
        of_kinds = [kind.trial.condition for kind in self._simulation.planned.kinds]
        positions = [conditions.index(name) if name in conditions else -1 for name in of_kinds]
        return Ratings(
            subjects=names,
            conditions=conditions,
            subject=who[predicted],
            condition=np.array(positions)[cohort.kinds[kept[who], trial]][predicted],
            contrast=contrasts[predicted, list(LAWS).index(LAW)],
            rating=cohort.score[kept[who], trial][predicted],
        )

    def _contrasts(self, cohort: Cohort, who: IntArray, trial: IntArray) -> FloatArray:
        """Return the contrast of each trial of a person under each law, shape (trials, laws)."""
        resonance_hz, of_kinds = self.study.rig.nominal_resonance_hz, []
        kinds_of_trial = self._simulation.planned.kinds
        for kind in kinds_of_trial:
            plan = kind.trial
            change = planned_change_of(self.study, plan.question, plan.expected, plan.touches)
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
        contrasts = np.full((len(who), len(LAWS)), np.nan)
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
                contrasts[row] = _by_law(felt, self.rig)
        return contrasts

    @cached_property
    def _simulation(self) -> Simulation:
        # People feel the rig as calibrated, which the analysis supposes, too.
        world = World(
            damping_ratio=self.rig.damping_ratio,
            gain=self.rig.gain,
            surface=self.rig.surface,
            effect=self.population.effect,
        )
        return Simulation(study=self.study, population=self.population, world=world)

    @cached_property
    def _mean_gain(self) -> float:
        names = [f"mean/{number}" for number in range(_DRAWN_FOR_MEANS)]
        sizes = {group.name: group.size for group in self.study.group} or {"": 1}
        drawn = [people_of(self.population.of_group(group), names) for group in sizes]
        means = [float((people.gain * people.skin).mean()) for people in drawn]
        return float(np.average(means, weights=list(sizes.values())))


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
def _by_law(change: Change, rig: Calibration) -> tuple[float, ...]:
    """Return the contrast of a change under each law; measured values come in steps, so again."""
    return tuple(predicted_contrast(change, law, RUNG, rig) for law in LAWS)
