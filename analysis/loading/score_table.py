"""The table of scores, subject by condition, that every statistic of the analysis reads."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.estimates import BoolArray, FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreTable:
    """Scores of subjects (rows) under conditions (columns); NaN is a score that was not given.

    Parameters:
        subjects: one name per row, each once.
        conditions: one name per column, each once.
        scores: shape (subjects, conditions), on the study's rating scale (0 to 10 in the paper),
            finite or NaN. The record keeps its own read-only copy.

    Raises:
        ValueError: a name twice, no subject, a shape that does not fit, an infinite score.

    >>> table = ScoreTable(subjects=("1", "2"), conditions=("voltage", "pressure"),
    ...                    scores=np.array([[10, 5], [9, np.nan]]))
    >>> table.missing_count
    1
    """

    subjects: tuple[str, ...]
    conditions: tuple[str, ...]
    scores: FloatArray

    def __post_init__(self) -> None:
        scores = np.array(self.scores, dtype=np.float64)
        # All statistics share one table, so that none of them may change it.
        scores.flags.writeable = False
        # A frozen record sets its own fields in this way alone.
        object.__setattr__(self, "subjects", tuple(self.subjects))
        object.__setattr__(self, "conditions", tuple(self.conditions))
        object.__setattr__(self, "scores", scores)
        _check_names("subject", self.subjects)
        # A study may have tracks alone, which have no conditions.
        if self.conditions:
            _check_names("condition", self.conditions)
        shape = len(self.subjects), len(self.conditions)
        if scores.shape != shape:
            raise ValueError(f"scores must have shape {shape}, got {scores.shape}")
        if np.isinf(scores).any():
            raise ValueError(
                f"a score must be finite or missing, got {scores[np.isinf(scores)][0]}"
            )

    @property
    def given(self) -> BoolArray:
        """Which scores were given, shape (subjects, conditions)."""
        return ~np.isnan(self.scores)

    @property
    def missing_count(self) -> int:
        """How many cells have no score."""
        return int(np.isnan(self.scores).sum())

    @property
    def is_complete(self) -> bool:
        """Whether every cell has a score."""
        return self.missing_count == 0

    def by_subject(self) -> dict[str, dict[str, float | None]]:
        """Return condition → score by subject, None where none was given."""
        scores = self.scores.astype(object)
        # JSON has no NaN.
        scores[~self.given] = None
        rows = [dict(zip(self.conditions, row, strict=True)) for row in scores.tolist()]
        return dict(zip(self.subjects, rows, strict=True))

    @property
    def transposed(self) -> "ScoreTable":
        """The same scores with conditions as rows and subjects as columns."""
        return ScoreTable(
            subjects=self.conditions, conditions=self.subjects, scores=self.scores.T.copy()
        )


def _check_names(kind: str, names: Sequence[str]) -> None:
    if not names:
        raise ValueError(f"a score table needs at least one {kind}, got 0")
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise ValueError(f"each {kind} must be named once, got {name!r} {count} times")
