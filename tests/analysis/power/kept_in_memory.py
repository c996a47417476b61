"""Chunks kept in memory, and the numbers of a job."""

from dataclasses import dataclass, field
from functools import cache

import numpy as np

from analysis.estimates import FloatArray
from analysis.power.engine import completed
from analysis.power.job import Design, Job, Task, tasks
from protocol.study_file.loading import template

DESIGN = Design(participants=4, repeats=1)


@dataclass
class Memory:
    kept: dict[str, bytes] = field(default_factory=dict)
    key: bytes = b"mine"

    def load(self, name: str) -> bytes | None:
        return self.kept.get(name)

    def save(self, name: str, content: bytes) -> None:
        self.kept[name] = content


def job(seed: int = 2) -> Job:
    from importlib.metadata import version

    return Job(study=template("paper"), version=version("touchbeam"), seed=seed)


def wanted(fitted: int = 6, null: int = 20) -> list[Task]:
    return [*tasks(DESIGN, "fitted", fitted), *tasks(DESIGN, "null", null)]


def numbers_by(
    workers: int, scheduler: str | None = None, kept: Memory | None = None
) -> FloatArray:
    """All numbers of the job, in the order of its tasks, in one row."""
    found = dict(completed(job(), wanted(), kept or Memory(), workers, scheduler))
    return np.concatenate([found[task].ravel() for task in wanted()])


@cache
def numbers_alone() -> FloatArray:
    """The same by one worker, in this process."""
    return numbers_by(1)
