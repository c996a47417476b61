"""What statistics read and tell: the table of scores, intervals, why one is missing, all as JSON.

A number that could not be estimated is `null`, with a `reason` beside it. The reason is called
`<name>_reason` where only one of several numbers is missing.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
FloatArray: TypeAlias = NDArray[np.float64]
Interval: TypeAlias = tuple[float, float]
Json: TypeAlias = dict[str, Any]

LEVEL = 0.05
"""Something is said to differ where p, corrected, is smaller; all else hold with the rest, 95%."""
LOWER, UPPER = ENDS = LEVEL / 2, 1 - LEVEL / 2
"""Quantiles at the ends of an interval."""


@dataclass(frozen=True)
class NotEstimable:
    """The reason why the data do not determine an estimate, returned in its place.

    This is not an error: a study with one participant so far, or with a condition that has no
    score, is valid. Exceptions are for invalid input.
    """

    reason: str

    def __post_init__(self) -> None:
        if not self.reason:
            raise ValueError("the reason for a missing estimate must not be empty, got ''")


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """A value with its 95% interval."""

    value: float
    interval: Interval


def central(values: FloatArray) -> Interval:
    """Return the ends of the central 95% of values."""
    low, high = np.quantile(values, ENDS).tolist()
    return low, high


def plain(value: object) -> Any:
    """Return records, arrays and mappings as JSON values; NaN becomes `null`."""
    if isinstance(value, NotEstimable):
        return {"reason": value.reason}
    if is_dataclass(value):
        return {entry.name: plain(getattr(value, entry.name)) for entry in fields(value)}
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    return None if isinstance(value, float) and math.isnan(value) else value


def or_null(value: object) -> Any:
    """Return a value as JSON, or `None` if it could not be estimated."""
    return None if isinstance(value, NotEstimable) else plain(value)


def why(name: str, value: object) -> Json:
    """Return the reason why `name` is `null`, or nothing if `value` was estimated."""
    return {f"{name}_reason": value.reason} if isinstance(value, NotEstimable) else {}


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


def _check_names(kind: str, names: Sequence[str]) -> None:
    if not names:
        raise ValueError(f"a score table needs at least one {kind}, got 0")
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise ValueError(f"each {kind} must be named once, got {name!r} {count} times")
