"""Designs of a study: how many participants, repeats and levels."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import product

from pydantic import ValidationError

from protocol.errors import BadInput
from protocol.study.rules import MOST_REPEATS
from protocol.study.rules import Design as DesignOfStudy
from protocol.study.study import Study
from protocol.study_file.limits import problems
from protocol.study_file.loading import schema_problems

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
    if not 2 <= design.participants <= MOST_PARTICIPANTS:
        raise BadInput(
            f"participants must lie in [2, {MOST_PARTICIPANTS}], got {design.participants}; give "
            "other numbers with --participants"
        )
    if design.repeats > MOST_REPEATS:
        raise BadInput(
            f"{design} cannot be planned: repeats must be at most {MOST_REPEATS}; give fewer with "
            "--repeats"
        )
    if design.levels > design.repeats:
        raise BadInput(
            f"{design} cannot be planned: levels must be at most repeats, so that each comes "
            "equally often; give fewer with --levels, or more with --repeats"
        )
    wanted = {"participants": design.participants, "repeats": design.repeats}
    levels = tuple(step / design.levels for step in range(1, design.levels + 1))
    conditions = [
        entry.model_copy(update={"levels": levels}) if levels else entry
        for entry in study.condition
    ]
    keys = {**study.design.model_dump(), **wanted}
    try:
        asked = DesignOfStudy.model_validate(keys)
    except ValidationError as error:
        found = schema_problems(keys, error)[0].located("study.toml")
        raise BadInput(f"{design} cannot be planned: {found}") from error
    made = study.model_copy(update={"design": asked, "condition": tuple(conditions)})
    if wrong := problems(made):
        raise BadInput(f"{design} cannot be planned: {wrong[0].located('study.toml')}")
    return made
