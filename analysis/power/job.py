"""A run in pieces: each simulates and analyses a few studies, anywhere, always with one result."""

from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from typing import Literal

import numpy as np
from threadpoolctl import threadpool_limits

from analysis.estimates import FloatArray
from analysis.power.cohorts import Simulate, without_effect
from analysis.power.designs import Design, designed
from analysis.power.diagnosis import rows_of_cohorts, rows_of_tables
from analysis.power.people_cohorts import PeopleCohorts
from device.friction.calibration import NOMINAL, Calibration
from device.people.people_file import people_in
from device.people.person import DEFAULT
from protocol.errors import WorkFailed
from protocol.study_file.loading import parsed_study

FORM = 1
"""Of the numbers in a chunk; a new form makes the kept chunks of earlier ones unused."""
FITTED_AT_ONCE, TESTED_AT_ONCE = 4, 500
"""Studies in a task: a second or two of work, so that little is lost and progress is seen."""

Kind = Literal["fitted", "tested", "null"]


@dataclass(frozen=True)
class Task:
    """The studies `first` to `first + count - 1` of a design.

    `fitted` ones are tested and fitted by the sensitivity models, `tested` ones tested alone, and
    so are the `null` ones, in which nothing has an effect.
    """

    design: Design
    kind: Kind
    first: int
    count: int

    @property
    def name(self) -> str:
        """A name that no other task of a job has."""
        return f"{self.design.key}-{self.kind}-{self.first:06}-{self.count}"


def tasks(design: Design, kind: Kind, studies: int) -> list[Task]:
    """Return the tasks of a number of studies."""
    size = FITTED_AT_ONCE if kind == "fitted" else TESTED_AT_ONCE
    return [
        Task(design, kind, first, min(size, studies - first)) for first in range(0, studies, size)
    ]


@dataclass(frozen=True)
class Job:
    """Everything but the task that determines its numbers."""

    study: str
    """Text of the study file."""
    version: str
    """Of touchbeam."""
    seed: int
    rig: Calibration = NOMINAL
    people: str = ""
    """Text of the people file; without one the default population takes part."""

    @property
    def digest(self) -> str:
        """What tells it from any other job."""
        return sha256(repr((FORM, self)).encode()).hexdigest()


@lru_cache(maxsize=8)
def simulation(job: Job, design: Design) -> Simulate:
    """Return the simulation of a design, whose plan is drawn once."""
    study = designed(parsed_study(job.study), design)
    return PeopleCohorts(
        study=study,
        participants=design.participants,
        population=people_in(job.people) if job.people else DEFAULT,
        rig=job.rig,
    )


def numbers(job: Job, task: Task) -> FloatArray:
    """Return a row of numbers per study of the task, see `analysis.power.diagnosis`.

    Each study is drawn under a key of its own, so that neither the other studies nor who computes
    them matter; sums take one thread, so that their order does not either.

    Raises:
        WorkFailed: this touchbeam is of another version than the one that asks.
    """
    from importlib.metadata import version

    if version("touchbeam") != job.version:
        raise WorkFailed(
            f"a worker has touchbeam {version('touchbeam')}, but {job.version} asks; "
            "install the same version on all"
        )
    nature = "null" if task.kind == "null" else "study"  # fitted or tested, a study is the same
    keys = [
        f"{job.seed}/{task.design.key}/{nature}/{number}"
        for number in range(task.first, task.first + task.count)
    ]
    with threadpool_limits(limits=1):
        simulate = simulation(job, task.design)
        if task.kind == "fitted":
            return rows_of_cohorts([simulate.cohort(key) for key in keys])
        tables = simulate.tables(keys)
        if task.kind == "tested":
            return rows_of_tables(list(tables))
        return rows_of_tables(
            [without_effect(table, _stream(key)) for table, key in zip(tables, keys, strict=True)]
        )


def _stream(key: str) -> np.random.Generator:
    digest = sha256(f"{key}/shuffled".encode()).digest()
    return np.random.default_rng(np.frombuffer(digest, dtype=np.uint32))
