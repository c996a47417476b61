"""The one way in which an analysis says that there is no answer, and why."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

BoolArray = NDArray[np.bool_]


IntArray = NDArray[np.int64]


FloatArray: TypeAlias = NDArray[np.float64]


Interval: TypeAlias = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class NotEstimable:
    """What a statistic returns in place of a number when the data determine none.

    Such data are no error: a study with one participant so far, or a condition nobody scored, is
    a study like any other. An error is kept for input that cannot be data at all.
    """

    reason: str

    def __post_init__(self) -> None:
        if not self.reason:
            raise ValueError("the reason for having no answer must not be empty, got ''")
