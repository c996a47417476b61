"""Each tolerance of the beam's computation is kept."""

import numpy as np
import pytest

from benchmarks.tolerances import BEAMS, case
from device.beam.driven import Fineness
from device.beam.spectral import Mesh
from device.friction.fineness import TOLERANCES, fineness_for

FINER = Fineness(Mesh(16, 3.5), 60, 0.07)


@pytest.mark.parametrize("name", ["the paper's", "clamped twice, slender, one face"])
def test_each_tolerance_is_kept_under_every_law(name: str) -> None:
    """`benchmarks/tolerances.py` finds a tenth of it on more beams and drives."""
    one = case(BEAMS[name], drives=40, seed=list(BEAMS).index(name))
    exact = one.friction(FINER)
    for tolerance in TOLERANCES:
        for law, mu in one.friction(fineness_for(tolerance)).items():
            assert np.abs(mu - exact[law]).max() < tolerance / 3
