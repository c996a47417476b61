"""A run in pieces: each simulates and analyses a few studies, anywhere, always with one result."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from hashlib import sha256
from itertools import product
from typing import Literal

import numpy as np
from pydantic import ValidationError
from threadpoolctl import threadpool_limits

from analysis.estimates import FloatArray
from analysis.power.diagnosis import Asked, asked_by, estimates_of_cohorts, rows_of_tables
from analysis.power.people_cohorts import PeopleCohorts, without_effect
from analysis.power.track_power import track_rows
from device.friction.scenes import NOMINAL, Calibration
from device.people.people_file import people_in
from device.people.person import DEFAULT
from protocol.errors import BadInput, WorkFailed
from protocol.study.factor import Group
from protocol.study.rules import MOST_REPEATS
from protocol.study.rules import Design as DesignOfStudy
from protocol.study.study import Study
from protocol.study_file.limits import problems
from protocol.study_file.loading import parsed_study, schema_problems

# Designs of a study: how many participants, repeats and levels.

PAPERS_PARTICIPANTS = 9
MOST_PARTICIPANTS = 1_000


@dataclass(frozen=True, kw_only=True, order=True)
class Design:
    """Participants, repeats of a condition per session, and levels; 0 levels are the study's own.

    >>> str(Design(participants=20, repeats=4))
    '20 participants x 4 repeats'
    """

    participants: int
    repeats: int
    levels: int = 0

    def __str__(self) -> str:
        words = [f"{self.participants} participants", f"{self.repeats} repeats"]
        words += [f"{self.levels} levels"] * bool(self.levels)
        return " x ".join(words).replace(" 1 repeats", " 1 repeat").replace(" 1 levels", " 1 level")

    @property
    def key(self) -> str:
        """A name without spaces."""
        return "x".join(map(str, asdict(self).values()))


def designs(
    study: Study, participants: Sequence[int], repeats: Sequence[int], levels: Sequence[int]
) -> list[Design]:
    """Return every combination; where a list is empty, what the study says.

    A study that plans no number of participants has the paper's nine.
    """
    return [
        Design(participants=people, repeats=often, levels=steps)
        for people, often, steps in product(
            participants or [study.design.participants or PAPERS_PARTICIPANTS],
            repeats or [study.design.repeats],
            levels or [0],
        )
    ]


def designed(study: Study, design: Design) -> Study:
    """Return the study with that design; levels are spread evenly up to the whole amplitude.

    Raises:
        BadInput: the study cannot be run so; the message gives the first problem.
    """
    people, refused = design.participants, f"{design} cannot be planned"
    # Every test compares people, and one has nobody to be compared with.
    if not 2 <= people <= MOST_PARTICIPANTS:
        rule = f"participants must lie in [2, {MOST_PARTICIPANTS}], got {people}"
        raise BadInput(f"{rule}; give other numbers with --participants")
    if design.repeats > MOST_REPEATS:
        rule = f"repeats must be at most {MOST_REPEATS}; give fewer with --repeats"
        raise BadInput(f"{refused}: {rule}")
    if design.levels > design.repeats:
        rule = "levels must be at most repeats, so that each comes equally often"
        raise BadInput(f"{refused}: {rule}; give fewer with --levels, or more with --repeats")
    levels = {"levels": tuple(step / design.levels for step in range(1, design.levels + 1))}
    conditions = (it.model_copy(update=levels if design.levels else {}) for it in study.condition)
    # Validated anew, because `model_copy` checks nothing.
    keys = study.design.model_dump() | {"participants": people, "repeats": design.repeats}
    try:
        asked = DesignOfStudy.model_validate(keys)
    except ValidationError as error:
        found = schema_problems(keys, error)[0].located("study.toml")
        raise BadInput(f"{refused}: {found}") from error
    group = _resized(study.group, people)
    changed = {"design": asked, "condition": tuple(conditions), "group": group}
    made = study.model_copy(update=changed)
    if wrong := problems(made):
        raise BadInput(f"{refused}: {wrong[0].located('study.toml')}")
    return made


def _resized(groups: Sequence[Group], participants: int) -> tuple[Group, ...]:
    """Return groups that have so many participants together, in proportion to their sizes.

    Raises:
        BadInput: a group would have nobody.
    """
    if not groups:
        return ()
    ends = np.cumsum([group.size for group in groups])
    shares = [round(participants * end / ends[-1]) for end in ends.tolist()]
    sizes = np.diff([0, *shares]).tolist()
    if 0 in sizes:
        rule = f"{participants} participants are too few for the study's {len(groups)} groups"
        raise BadInput(f"{rule}; give more with --participants")
    pairs = zip(groups, sizes, strict=True)
    return tuple(group.model_copy(update={"size": size}) for group, size in pairs)


FORM = 5
"""Of the numbers in a chunk and of how they are found; chunks of an earlier form are not used."""
AT_ONCE = {"fitted": 4, "tested": 500, "null": 500, "tracks": 100}
"""Studies in a task: a second or two of work, so that little is lost and progress is seen."""

Kind = Literal["fitted", "tested", "null", "tracks"]


@dataclass(frozen=True)
class Task:
    """The studies `first` to `first + count - 1` of a design.

    `fitted` ones are tested and fitted by the sensitivity models, `tested` ones tested alone, and
    so are the `null` ones, in which nothing has an effect. Of `tracks` thresholds are estimated.
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
    size = AT_ONCE[kind]
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
        # `repr` of a record has all its fields, so that none can be forgotten here.
        return sha256(repr((FORM, self)).encode()).hexdigest()


@lru_cache(maxsize=8)
def simulation(job: Job, design: Design) -> PeopleCohorts:
    """Return the simulation of a design, whose plan is drawn once."""
    study = designed(parsed_study(job.study), design)
    return PeopleCohorts(
        study=study,
        participants=design.participants,
        population=people_in(job.people) if job.people else DEFAULT,
        rig=job.rig,
    )


@lru_cache(maxsize=8)
def asked(job: Job) -> Asked:
    """Return what the job's study asks."""
    return asked_by(parsed_study(job.study), job.rig)


def numbers(job: Job, task: Task) -> FloatArray:
    """Return a row of numbers per study of the task, see `analysis.power.diagnosis`.

    Each study is drawn under a key of its own, so that neither the other studies nor who computes
    them matter; sums take one thread, so that their order does not either.

    Raises:
        WorkFailed: this touchbeam is of another version than the one that asks.
    """
    # Asked where the work is done: a cluster may run another version.
    from importlib.metadata import version

    if (own := version("touchbeam")) != job.version:
        said = f"a worker has touchbeam {own}, but {job.version} asks"
        raise WorkFailed(f"{said}; install the same version on all")
    # The kind is not a part of the key beyond this, so that a fitted study is one of the tested
    # ones.
    nature = f"{job.seed}/{task.design.key}/{'null' if task.kind == 'null' else 'study'}"
    keys = [f"{nature}/{number}" for number in range(task.first, task.first + task.count)]
    with threadpool_limits(limits=1):
        simulate = simulation(job, task.design)
        if task.kind == "tracks":
            people = simulate.population, simulate.rig, simulate.participants
            return track_rows(simulate.study, *people, keys)
        if task.kind == "fitted":
            tables, cohorts = simulate.studies(keys)
            return np.column_stack(
                [rows_of_tables(tables, asked(job)), estimates_of_cohorts(cohorts)]
            )
        tables = simulate.tables(keys)
        if task.kind == "null":
            tables = without_effect(tables, map(_stream, keys))
        return rows_of_tables(tables, asked(job))


def _stream(key: str) -> np.random.Generator:
    # A stream of its own, apart from those that drew the study.
    digest = sha256(f"{key}/shuffled".encode()).digest()
    return np.random.default_rng(np.frombuffer(digest, dtype=np.uint32))
