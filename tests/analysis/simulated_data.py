"""Simulated sessions as the tables that loading makes of a journal."""

from collections.abc import Sequence

import numpy as np

from analysis.estimates import FloatArray
from analysis.loading.course import Rows
from analysis.loading.records import AttemptRow, SessionRow, TouchRow
from analysis.loading.sessions import Sessions, sessions_of
from analysis.loading.study_data import StudyData, study_data
from analysis.simulation import (
    AlikeTrials,
    Cohort,
    PlannedTrials,
    Simulation,
    mean_table,
    names_of,
)
from device.people.answering import answer_of
from device.people.person import World, truth_of


def simulated_data(simulation: Simulation, participants: int, seed: int | str) -> StudyData:
    """What the estimators take: the sessions of one cohort, as they are loaded.

    The `seed` is a number, or any text that is a spawn key.
    """
    names = names_of(participants)
    cohorts = simulation.sessions(participants, seed)
    made = list(zip(simulation.plans, cohorts, strict=True))
    found = loaded_sessions(made, names, seed, simulation.world)
    return study_data(found, rehearsals=True, rules=simulation.study.exclusions)


def score_tables(simulation: Simulation, participants: int, *seeds: int | str) -> FloatArray:
    """The mean scores of a cohort for each seed, (cohorts, people, conditions); NaN without any."""
    _, everybody = simulation.studies(participants, *seeds)
    means = mean_table(simulation.planned, everybody, everybody.score)
    return means.reshape(-1, participants, means.shape[1])


def loaded_sessions(
    made: Sequence[tuple[PlannedTrials, Cohort]], names: list[str], seed: int | str, world: World
) -> Sessions:
    """Return each person's sessions, in order, as if they had been read from a journal."""
    rows = Rows()
    for person, name in enumerate(names):
        for planned, of in made:
            group, slot = planned.place(int(of.slots[person]))
            trials = planned.plan(int(of.slots[person])).trials
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
                    planned_trials=sum(trial.kind == "trial" for trial in trials),
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
    rows: Rows, planned: PlannedTrials, kind: AlikeTrials, number: int, force_n: float
) -> None:
    resonance_hz = planned.study.rig.nominal_resonance_hz
    touch = kind.trial.touches[number].at(resonance_hz)
    rows.touches.append(
        TouchRow(
            planned=touch,
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
