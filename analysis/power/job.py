"""A run in pieces: each simulates and analyses a few studies, anywhere, always with one result."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256

import numpy as np
from threadpoolctl import threadpool_limits

from analysis.power.designs import Design, designed
from analysis.power.people_cohorts import PeopleCohorts, without_effect
from analysis.power.study_records import (
    Asked,
    Record,
    Records,
    asked_by,
    record_of_models,
    record_of_tables,
)
from analysis.power.track_records import track_records
from device.friction.calibration import NOMINAL, Calibration
from device.people.people_file import people_in
from device.people.person import DEFAULT
from protocol.errors import WorkFailed
from protocol.study_file.loading import parsed_study


@dataclass(frozen=True)
class Job:
    """Everything but the task that determines its numbers."""

    study: str
    """Text of the study file."""
    version: str
    """Of touchbeam."""
    seed: int
    models: bool = True
    """Whether the sensitivity models are fitted, which takes nearly all the time."""
    rig: Calibration = NOMINAL
    people: str = ""
    """Text of the people file; without one the default population takes part."""


@dataclass(frozen=True)
class Task:
    """The studies `first` to `first + count - 1` of a design, or so many null cohorts.

    In a null cohort nothing has an effect; it is tested alone.
    """

    design: Design
    null: bool
    first: int
    count: int


def tasks(job: Job, design: Design, studies: int, null_studies: int) -> list[Task]:
    """Return the tasks of a design: a second or two of work each, so that progress is seen."""
    # More people at once would need more memory and save no time.
    tested = max(1, min(100, 2_000 // design.participants))
    return [
        Task(design, null, first, min(size, count - first))
        for null, count, size in (
            (False, studies, 4 if job.models else tested),
            (True, null_studies, tested),
        )
        for first in range(0, count, size)
    ]


@lru_cache(maxsize=8)
def asked(job: Job) -> Asked:
    """Return what the job's study asks."""
    return asked_by(parsed_study(job.study), job.rig, models=job.models)


@lru_cache(maxsize=8)
def _cohorts(job: Job, design: Design) -> PeopleCohorts:
    """Return the simulation of a design, whose plan is drawn once."""
    return PeopleCohorts(
        study=designed(parsed_study(job.study), design),
        participants=design.participants,
        population=people_in(job.people) if job.people else DEFAULT,
        rig=job.rig,
    )


def records(job: Job, task: Task) -> Records:
    """Return the records of a task's studies.

    Each study is drawn under a key of its own, so that neither the other studies nor who computes
    them matter; sums take one thread, so that their order does not either.

    Raises:
        WorkFailed: this touchbeam is of another version than the one that asks.
    """
    # Asked where the work is done: a cluster may run another version.
    from importlib.metadata import version

    if (installed := version("touchbeam")) != job.version:
        refusal = f"a worker has touchbeam {installed}, but {job.version} asks"
        raise WorkFailed(f"{refusal}; install the same version on all")
    nature = f"{job.seed}/{task.design.key}/{'null' if task.null else 'study'}"
    keys = [f"{nature}/{number}" for number in range(task.first, task.first + task.count)]
    with threadpool_limits(limits=1):
        cohorts, questions = _cohorts(job, task.design), asked(job)
        studies = [Record({}, {}) for _ in keys]
        if questions.conditions:
            studies = _of_conditions(job, cohorts, keys, null=task.null)
        if questions.tracks and not task.null:
            of_tracks = track_records(questions, cohorts, keys, task.first)
            studies = [one.beside(other) for one, other in zip(studies, of_tracks, strict=True)]
        return Records.of(questions, studies)


def _of_conditions(
    job: Job, cohorts: PeopleCohorts, keys: Sequence[str], *, null: bool
) -> list[Record]:
    """Return what the tables of each study tell and, of studies with an effect, the models."""
    tables, rated = cohorts.studies(keys)
    if null:
        tables = without_effect(tables, map(_shuffling, keys))
    studies = [record_of_tables(asked(job), *table) for table in zip(*tables, strict=True)]
    if null or not job.models:
        return studies
    return [
        one.beside(record_of_models(cohort)) for one, cohort in zip(studies, rated, strict=True)
    ]


def _shuffling(key: str) -> np.random.Generator:
    # A stream of its own, apart from those that drew the study.
    digest = sha256(f"{key}/shuffled".encode()).digest()
    return np.random.default_rng(np.frombuffer(digest, dtype=np.uint32))
