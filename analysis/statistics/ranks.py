"""Ranks with ties, as integers, so that sums of ranks compare exactly."""

import numpy as np
from numpy.typing import NDArray

from analysis.scores import FloatArray

IntArray = NDArray[np.int64]

# Scores such as 7.3 - 7.2 and 5.1 - 5.0 are meant to be equal and differ in the last bits.
DECIMALS = 9


def doubled_midranks(values: FloatArray) -> IntArray:
    """Return twice the rank of each value along the last axis, ties sharing their mean rank.

    Twice a midrank is an integer. Values that agree to nine decimals are tied; a missing value
    gets rank 0 and counts for nothing.

    >>> doubled_midranks(np.array([10.0, 8.0, 10.0, np.nan]))
    array([5, 2, 5, 0])
    """
    return np.apply_along_axis(_ranks_of_one, -1, np.round(values, DECIMALS))


def _ranks_of_one(rounded: FloatArray) -> IntArray:
    in_order = np.sort(rounded)
    below = np.searchsorted(in_order, rounded, side="left")
    not_above = np.searchsorted(in_order, rounded, side="right")
    return np.where(np.isnan(rounded), 0, below + not_above + 1).astype(np.int64)
