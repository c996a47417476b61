"""A run in pieces: each simulates and analyses a few studies, anywhere, always with one result."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from threadpoolctl import threadpool_limits

from analysis.power.answered_cohorts import AnsweredCohorts
from analysis.power.designs import Design, designed, simulated
from analysis.power.null_cohorts import kind_named, kinds_of, null_tables
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.study_records import (
    Asked,
    Record,
    Records,
    asked_by,
    record_of_answers,
    record_of_tables,
)
from analysis.power.track_records import track_records
from device.friction.calibration import NOMINAL, Calibration
from device.people.people_file import people_in
from device.people.person import DEFAULT
from protocol.errors import WorkFailed
from protocol.study.study import Study


@dataclass(frozen=True)
class Job:
    """Everything but the task that determines its numbers."""

    study: str
    """Text of the study file."""
    version: str
    """Of touchbeam."""
    seed: int
    models: bool = True
    """Whether the model of the answers is fitted, which takes nearly all the time."""
    rig: Calibration = NOMINAL
    people: str = ""
    """Text of the people file; without one the default population takes part."""
    answered: bool = False
    """Whether the scores of a study of imported ones came with answers."""

    @property
    def simulated(self) -> Study:
        """The study that is simulated."""
        return simulated(self.study, answered=self.answered)


@dataclass(frozen=True)
class Task:
    """The studies `first` to `first + count - 1` of a design, or so many null cohorts.

    `null` is the name of their kind, empty for studies. Null cohorts are tested alone.
    """

    design: Design
    null: str
    first: int
    count: int


def tasks(job: Job, design: Design, studies: int, null_studies: int) -> list[Task]:
    """Return the tasks of a design: some seconds of work each, so that progress is seen.

    There are `null_studies` of each kind.
    """
    # More people at once would need more memory and save no time.
    tested = max(1, min(100, 2_000 // design.participants))
    return [
        Task(design, null, first, min(size, count - first))
        for null, count, size in (
            ("", studies, 4 if job.models else tested),
            *((kind.name, null_studies, tested) for kind in kinds_of(asked(job))),
        )
        for first in range(0, count, size)
    ]


@lru_cache(maxsize=8)
def asked(job: Job) -> Asked:
    """Return what the job's study asks."""
    study, people = job.simulated, people_in(job.people) if job.people else DEFAULT
    alike = bool(study.groups) and people.groups.keys().isdisjoint(study.groups)
    return replace(asked_by(study, job.rig, models=job.models), alike=alike)


@lru_cache(maxsize=8)
def _cohorts(job: Job, design: Design, null: str) -> AnsweredCohorts:
    """Return the simulation of a design, whose plan is drawn once."""
    people = people_in(job.people) if job.people else DEFAULT
    if null:
        people = kind_named(null).population(people)
    return AnsweredCohorts(
        cohorts=PeopleCohorts(
            study=designed(job.simulated, design),
            participants=design.participants,
            population=people,
            rig=job.rig,
        )
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
    drawn = f"{job.seed}/{task.design.key}/{task.null or 'study'}"
    keys = [f"{drawn}/{number}" for number in range(task.first, task.first + task.count)]
    with threadpool_limits(limits=1):
        answered, questions = _cohorts(job, task.design, task.null), asked(job)
        if task.null:
            tables = null_tables(kind_named(task.null), answered.cohorts, keys)
            tested = (record_of_tables(questions, *table) for table in zip(*tables, strict=True))
            return Records.of(questions, [*tested])
        studies = [Record({}, {}) for _ in keys]
        if questions.conditions:
            studies = _of_conditions(questions, answered, keys)
        if questions.tracks:
            of_tracks = track_records(questions, answered.cohorts, keys, task.first)
            studies = [one.beside(other) for one, other in zip(studies, of_tracks, strict=True)]
        return Records.of(questions, studies)


def _of_conditions(
    questions: Asked, answered: AnsweredCohorts, keys: Sequence[str]
) -> list[Record]:
    """Return what the tables of each study tell, and the model of its answers."""
    participants = answered.cohorts.participants
    tables, everybody = answered.cohorts.simulation.studies(participants, *keys)
    studies = [record_of_tables(questions, *table) for table in zip(*tables, strict=True)]
    if not questions.models:
        return studies
    gain = float(answered.population.gain)
    fitted = (record_of_answers(cohort, gain) for cohort in answered.cohorts_of(everybody))
    return [one.beside(other) for one, other in zip(studies, fitted, strict=True)]
