"""Coverage of ratings over a few simulated studies; the soak test has hundreds of each kind."""

import numpy as np
import pytest

from analysis.estimates import NotEstimable
from tests.analysis.sensitivity.calibration import (
    EVEN,
    MIDDLE,
    UNEVEN,
    Measures,
    drawn,
    measured,
    to_model_scale,
)

STUDIES = 8


def over_studies(name: str, design: str) -> list[Measures]:
    found = [measured(name, design, 1000 + seed) for seed in range(STUDIES)]
    return [one for one in found if not isinstance(one, NotEstimable)]


@pytest.mark.parametrize("name", ["ceiling", "off the line", "uneven use"])
def test_intervals_hold_biases_gains_and_relative_gains(name: str) -> None:
    found = over_studies(name, "9x5x4")
    assert len(found) == STUDIES
    # With a coverage of .95 and studies this unlike each other, .85 is three errors away.
    assert np.mean([one.relative_gain for one in found]) > 0.85
    assert np.mean([one.bias for one in found]) > 0.75
    assert np.mean([one.gain for one in found]) > 0.75
    assert np.mean([one.relative_width for one in found]) < 8.0


def test_a_group_without_gain_seldom_has_one() -> None:
    found = over_studies("no gain", "9x5x4")
    # Of 8 studies 3 or fewer, but for a chance of .0004 at 5%.
    assert sum(one.group_excludes_0 for one in found) <= 3


def test_the_limit_of_the_sd_of_gains_is_above_it() -> None:
    for name in ("middle", "no differences"):
        assert np.mean([one.sd_below for one in over_studies(name, "9x5x4")]) > 0.8


def test_the_truth_is_moved_to_the_scale_of_the_model() -> None:
    assert to_model_scale(drawn("ceiling", "9x5x1", 0), EVEN) == pytest.approx((0.0, 1.0))
    study = drawn("uneven use", "20x5x8", 0)
    zero, unit = to_model_scale(study, UNEVEN)
    values = np.unique(study.ratings.rating)
    assert zero + unit * UNEVEN[int(values[0])] == pytest.approx(values[:2].mean())
    assert zero + unit * UNEVEN[int(values[-2])] == pytest.approx(values[-2:].mean())
    assert MIDDLE.thresholds == EVEN
