"""The ratings of a table: as a journal keeps them, and as they stand in its cells."""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

EXPECTED, CONTRARY, SAME = ANSWERS = ("expected", "contrary", "same")
ANSWERS_EXAMPLE = "smoother=expected,rougher=contrary,equal=same"
"""As `--answers` says what words mean."""
Scale = tuple[int, int]


@dataclass(frozen=True, kw_only=True, slots=True)
class Rating:
    """A score, an answer to the question whether something changed as expected, or both."""

    condition: str
    score: float | None
    answer: str | None = None
    contrast: float | None = None

    @property
    def says_nothing(self) -> bool:
        return self.score is None and self.answer is None


@dataclass(frozen=True, kw_only=True)
class Visit:
    """A subject's ratings in one session, in the order of the table."""

    participant: str
    session: int
    group: str | None
    ratings: tuple[Rating, ...]


@dataclass(frozen=True, kw_only=True)
class Imported:
    """The scores of a table.

    - `cells`: what each factor has in a condition, by condition; empty without factors.
    - `scale`: its ends, of scores that nobody described those that hold all (`scale_known`).
    - `lines`: what was understood, for people.
    """

    visits: tuple[Visit, ...]
    conditions: tuple[str, ...]
    scale: Scale
    scale_known: bool
    cells: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    groups: tuple[str, ...] = ()
    lines: tuple[str, ...] = ()

    @cached_property
    def ratings(self) -> list[Rating]:
        return [rating for visit in self.visits for rating in visit.ratings]

    @property
    def contrasts(self) -> dict[str, float]:
        """The contrast of each condition that has a single one."""
        told: dict[str, set[float]] = defaultdict(set)
        for rating in self.ratings:
            if rating.contrast is not None:
                told[rating.condition].add(rating.contrast)
        return {name: values.pop() for name, values in told.items() if len(values) == 1}

    @property
    def is_plain(self) -> bool:
        """Whether each subject has one score a condition, and nothing else."""
        return not (self.groups or self.cells) and all(
            visit.session == 1
            and len({each.condition for each in visit.ratings}) == len(visit.ratings)
            and all(each.answer is None and each.contrast is None for each in visit.ratings)
            for visit in self.visits
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class Entry:
    """A rating as it stands in the table: its row, the texts that say whose it is, and itself."""

    row: int
    subject: str
    session: str
    group: str
    parts: tuple[str, ...]
    score: float | None
    answer: str | None
    contrast: float | None

    @property
    def condition(self) -> str:
        return ", ".join(self.parts)
