"""Where the direction of a modal motion turns twice within a cell."""

import numpy as np

from device.beam.modal_pattern import _bottoms


def test_a_dip_is_found_whichever_way_the_cell_begins_to_bend() -> None:
    """Against the zeros of the derivative by numpy, of cells that begin to bend either way."""
    random = np.random.default_rng(0)
    c1, c2, c3 = random.normal(size=(3, 20_000))
    c1[:50], c2[:50] = -0.1, 0.0
    for sign in (1.0, -1.0):
        end = c1 + 2 * c2 + 3 * c3
        dips = (sign * c1 < 0) & (sign * end > 0)
        found = _bottoms((c1[dips], c2[dips], c3[dips]), np.full(dips.sum(), sign))
        assert (sign * c2[dips] < 0).sum() > 1000
        slope = c1[dips] + found * (2 * c2[dips] + found * 3 * c3[dips])
        bend = sign * (2 * c2[dips] + 6 * c3[dips] * found)
        assert ((found > 0) & (found < 1)).all()
        assert np.abs(slope).max() < 1e-12
        assert (bend >= 0).all()
