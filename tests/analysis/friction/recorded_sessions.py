"""Sessions whose touches were recorded, and what was true of them."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, NotEstimable
from analysis.felt.measured_statistics import MeasuredTrials, measured_trials
from analysis.loading.study_data import StudyData, load_study_data
from analysis.trials.contrasts import trial_contrasts
from device.friction.changes import LAW
from protocol.journal.events import (
    Event,
    StoredEvent,
    TouchEnded,
    TouchRecorded,
    TouchStarted,
    TrialStarted,
)
from protocol.plan.plan import plan
from protocol.study.study import Study
from tests.analysis.chains import chain
from tests.analysis.friction.simulated_touches import Channel, Sensor, drawn_finger, drawn_rig
from tests.analysis.reports import session_events

Chains = list[list[StoredEvent]]


def recorded_cohort(
    study: Study,
    participants: int,
    *,
    seed: int = 1,
    sensor: Sensor | None = None,
    skipped: int | None = None,
) -> tuple[Chains, Chains]:
    """The sessions of a cohort on one rig, and the same as an ideal sensor would record them.

    In the trial `skipped` nothing is recorded.
    """
    rng = np.random.default_rng([3, seed])
    rig = drawn_rig(rng)
    pairs = [
        _with_recordings(
            session_events(study, slot, np.random.default_rng([seed, slot]), measured=False),
            Channel(sensor=sensor or Sensor(), finger=drawn_finger(rig, rng), study=study, rng=rng),
            slot,
            skipped,
        )
        for slot in range(participants)
    ]
    return [chain(found) for found, _ in pairs], [chain(ideal) for _, ideal in pairs]


def _with_recordings(
    events: list[Event], channel: Channel, slot: int, skipped: int | None
) -> tuple[list[Event], list[Event]]:
    trials = plan(channel.study, slot).trials
    found: list[Event] = []
    ideal: list[Event] = []
    index, touch = 0, 0
    for event in events:
        if isinstance(event, TrialStarted):
            index = event.index
        if isinstance(event, TouchStarted):
            touch = event.touch
        if isinstance(event, TouchEnded) and index != skipped:
            for kept, recording in zip(
                (found, ideal), channel.touched(trials[index], touch), strict=True
            ):
                kept.append(TouchRecorded(touch=touch, **vars(recording)))
        found.append(event)
        ideal.append(event)
    return found, ideal


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredStudy:
    """A study's scored trials: what was true, measured, and predicted; shape (trials,) each."""

    data: StudyData
    found: MeasuredTrials
    true: FloatArray
    predicted: FloatArray
    scored: np.ndarray


def measured_study(
    study: Study, participants: int, *, seed: int, sensor: Sensor | None = None
) -> MeasuredStudy:
    """Return the measured contrasts of a simulated study beside the true ones."""
    found, ideal = (
        load_study_data(chains, rehearsals=False)
        for chains in recorded_cohort(study, participants, seed=seed, sensor=sensor)
    )
    contrasts = trial_contrasts(study, found.trials, found.touches).by_law[LAW]
    return MeasuredStudy(
        data=found,
        found=measured_trials(study, found.trials, found.touches, found.forces),
        true=_true_contrasts(study, ideal),
        predicted=contrasts,
        scored=found.trials["trial_kind"].eq("trial").to_numpy(),
    )


def _true_contrasts(study: Study, ideal: StudyData) -> FloatArray:
    """Return contrasts without noise; of a ramp, what friction really was at its two ends."""
    true = measured_trials(study, ideal.trials, ideal.touches, ideal.forces).value
    for touch, attempt in zip(ideal.touches.index, ideal.touches["attempt_id"], strict=True):
        forces = ideal.forces[touch]
        if ideal.touches["planned"][touch].programme != "hold":
            assert not isinstance(forces, NotEstimable)
            place = ideal.trials.index.get_loc(attempt)
            fell = float(forces.friction[0] - forces.friction[-1])
            true[place] = -fell if ideal.trials["expected"].iloc[place] == "rougher" else fell
    return true
