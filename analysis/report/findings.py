"""The findings of a study: the data, and everything that is computed from them for a report."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

from analysis.loading.missing_scores import notes
from analysis.loading.published import SCALE
from analysis.loading.sessions import TrialRow
from analysis.loading.study_data import Loaded
from analysis.report.as_json import plain
from analysis.statistics.summary import TableStatistics
from analysis.trials.contrasts import TrialContrasts
from analysis.trials.trial_statistics import TrialStatistics
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True)
class Origin:
    """What a report was asked for with, and the digest of the study file.

    `broken_chains` are the sessions whose events are not as they were recorded.
    """

    command: str
    study_sha256: str
    broken_chains: tuple[str, ...] = ()


class Scale(NamedTuple):
    """The lowest and the highest score there can be."""

    lowest: float
    highest: float

    @property
    def span(self) -> float:
        """How far its ends lie apart."""
        return self.highest - self.lowest

    def __str__(self) -> str:
        """The ends alone."""
        return f"{self.lowest:g} to {self.highest:g}"

    @property
    def in_words(self) -> str:
        """The ends, and what they mean."""
        return f"{self.lowest:g} (no effect) to {self.highest:g} (very effective)"


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """What the sections of a report are made from."""

    title: str
    loaded: Loaded
    study: Study
    origin: Origin
    table: TableStatistics
    trials: TrialStatistics

    @cached_property
    def trial_records(self) -> list[dict[str, Any]]:
        """A record per trial that counts, with its predictions."""
        return trial_records(self.loaded.rows, self.trials.contrasts)

    @property
    def table_notes(self) -> list[str]:
        """What stands under Table 4."""
        return notes(self.loaded.table, self.loaded.empty)

    @property
    def rehearsals(self) -> bool:
        """Whether any of the scores come from a rehearsal."""
        return "rehearsal" in self.loaded.kinds

    @property
    def published(self) -> bool:
        """Whether all scores are those of a published table, behind which nothing is known."""
        return self.loaded.kinds == ("published",)

    @property
    def scale(self) -> Scale:
        """The scale of the scores: the study's, or that of published tables if all are of one."""
        rating = self.study.rating
        return Scale(*SCALE) if self.published else Scale(rating.minimum, rating.maximum)


def trial_records(rows: Sequence[TrialRow], contrasts: TrialContrasts) -> list[dict[str, Any]]:
    """Return a record per trial that counts, with the contrast that each law predicts."""
    by_law = {law: values.tolist() for law, values in contrasts.by_law.items()}
    return [
        {
            "subject": row.participant,
            "session": row.session,
            "index": row.index,
            "kind": row.kind,
            "condition": row.condition,
            "level": row.level,
            "opposite": row.opposite,
            "place": row.place,
            "change": row.change,
            "agrees": row.agrees,
            "score": plain(row.score),
            "reaction_s": row.reaction_s,
            "measured": bool(contrasts.measured[number]),
            "predicted": {law: plain(values[number]) for law, values in by_law.items()},
        }
        for number, row in enumerate(rows)
    ]
