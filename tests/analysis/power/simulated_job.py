"""A job of a few studies, and the records of its tasks."""

from functools import cache
from importlib.metadata import version

import numpy as np

from analysis.estimates import FloatArray
from analysis.power.designs import Design
from analysis.power.engine import completed
from analysis.power.job import Job, Task, tasks
from analysis.power.study_records import Records
from protocol.study_file.loading import template

DESIGN = Design(participants=4, repeats=1)


def job(seed: int = 2, *, models: bool = True) -> Job:
    return Job(study=template("paper"), version=version("touchbeam"), seed=seed, models=models)


def wanted(studies: int = 6, null: int = 60) -> list[Task]:
    return tasks(job(), DESIGN, studies, null)


def joined(records: dict[Task, Records]) -> FloatArray:
    """All numbers of the tasks that are wanted, in their order, in one row."""
    return np.concatenate([part.ravel() for task in wanted() for part in records[task]])


def numbers_by(workers: int, scheduler: str | None = None) -> FloatArray:
    return joined(dict(completed(job(), wanted(), workers, scheduler)))


@cache
def numbers_alone() -> FloatArray:
    """The same by one worker, in this process."""
    return numbers_by(1)
