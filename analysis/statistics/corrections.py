"""The correction of p over several tests, Holm's: of a list, of tests, of rows of a table."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.estimates import FloatArray, NotEstimable


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values corrected for multiple tests, in the order given (Holm 1979).

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    return list(map(float, holm_of_rows(np.array([p_values], dtype=np.float64))[0]))


def holm_of(tests: Sequence[Any]) -> list[float | NotEstimable]:
    """Return the `p` of tests, corrected, in their order; one that has none counts for nothing."""
    corrected = iter(holm([test.p for test in tests if not isinstance(test, NotEstimable)]))
    return [test if isinstance(test, NotEstimable) else next(corrected) for test in tests]


def holm_of_rows(p: FloatArray) -> FloatArray:
    """Return Holm's correction within each row; NaN is left out of it.

    >>> holm_of_rows(np.array([[0.01, np.nan, 0.04, 0.03]]))
    array([[0.03,  nan, 0.06, 0.06]])
    """
    # (4), mathematics/rank-tests
    order = np.argsort(p, axis=1, kind="stable")  # NaN comes last
    factors = (~np.isnan(p)).sum(axis=1)[:, None] - np.arange(p.shape[1])
    stepped = np.maximum.accumulate(np.take_along_axis(p, order, axis=1) * factors, axis=1)
    corrected = np.empty_like(p)
    np.put_along_axis(corrected, order, np.minimum(stepped, 1.0), axis=1)
    return np.where(np.isnan(p), np.nan, corrected)
