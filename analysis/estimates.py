"""Types of estimates: arrays, intervals, the reason for a missing one, and all of them as JSON.

A number that could not be estimated is `null`, with a `reason` beside it. The reason is called
`<name>_reason` where only one of several numbers is missing.
"""

import math
from collections.abc import Mapping
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
