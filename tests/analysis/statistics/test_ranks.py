import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from analysis.scores import FloatArray
from analysis.statistics.ranks import doubled_midranks

SHAPES = st.tuples(st.integers(1, 5), st.integers(1, 6))
CELLS = st.integers(0, 4).map(float) | st.just(np.nan)


@given(SHAPES.flatmap(lambda shape: arrays(np.float64, shape, elements=CELLS)))
def test_ranks_agree_with_scipy(scores: FloatArray) -> None:
    expected = 2 * stats.rankdata(scores, axis=1, nan_policy="omit")
    assert np.array_equal(doubled_midranks(scores), np.nan_to_num(expected))
