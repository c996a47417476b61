"""Simulated sessions as the tables that loading makes of a journal."""

import numpy as np

from analysis.loading.course import Rows
from analysis.loading.records import AttemptRow, SessionRow, TouchRow
from analysis.loading.sessions import Sessions
from analysis.simulation.cohort import Cohort
from analysis.simulation.planned_trials import PlannedTrials, TrialKind
from device.people.answering import answer_of
from device.people.person import World, truth_of


def loaded_sessions(
    planned: PlannedTrials, made: Cohort, names: list[str], seed: int | str, world: World
) -> Sessions:
    """Return the sessions of a cohort as if they had been read from a journal."""
    rows = Rows()
    for person, name in enumerate(names):
        rows.sessions.append(
            SessionRow(
                participant=name,
                session=planned.session,
                session_kind="rehearsal",
                conditions=planned.study.conditions,
                session_completed=bool(made.answered[person].all()),
                slot=int(made.slots[person]),
                seed=seed,
                virtual=truth_of(made.people[person], world),
            )
        )
        _add_trials(rows, planned, made, person)
    sessions = rows.sessions.frame()
    return Sessions(
        sessions=sessions.assign(subject=sessions["participant"]),
        attempts=rows.attempts.frame(),
        touches=rows.touches.frame(),
        answers=rows.answers.frame(),
        traces=rows.traces(),
        forces={},
        incidents=(),
        exclusions=(),
        withdrawn=0,
    )


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
            AttemptRow(
                session_id=rows.sessions.last_id,
                trial_index=trial.index,
                trial_kind=trial.kind,
                condition=trial.condition,
                attempt=1,
                block=trial.block,
                level=trial.level,
                opposite=trial.opposite,
                question=trial.question,
                expected=trial.expected,
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
    touch = kind.trial.touches[number]
    resonance_hz = planned.study.rig.nominal_resonance_hz
    rows.touches.append(
        TouchRow(
            attempt_id=rows.attempts.last_id,
            planned=touch,
            beam=touch.beam or planned.study.touch.beam,
            place=touch.place,
            direction=touch.direction,
            coverage=touch.coverage,
            press=touch.press,
            planned_voltage_v=touch.voltage_v,
            planned_end_voltage_v=touch.end_voltage_v,
            planned_frequency=touch.frequency,
            planned_end_frequency=touch.end_frequency,
            commanded_voltage_v=touch.voltage_v,
            commanded_frequency_hz=touch.frequency * resonance_hz,
            start_voltage_v=touch.voltage_v,
            end_voltage_v=touch.end_voltage_v,
            start_frequency_hz=touch.frequency * resonance_hz,
            end_frequency_hz=touch.end_frequency * resonance_hz,
            force_n=round(force_n, 4),
        )
    )
