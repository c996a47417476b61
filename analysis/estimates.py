"""Types of estimates: arrays, intervals, and the reason for an estimate that is missing."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

BoolArray: TypeAlias = NDArray[np.bool_]
IntArray: TypeAlias = NDArray[np.int64]
FloatArray: TypeAlias = NDArray[np.float64]
Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class NotEstimable:
    """The reason why the data do not determine an estimate, returned in its place.

    This is not an error: a study with one participant so far, or with a condition that has no
    score, is valid. Exceptions are for invalid input.
    """

    reason: str

    def __post_init__(self) -> None:
        if not self.reason:
            raise ValueError("the reason for a missing estimate must not be empty, got ''")
