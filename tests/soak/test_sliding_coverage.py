"""Coverage of the intervals that a sliding experiment gives, on rigs it does not know."""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np
import pytest

from analysis.estimates import Estimate
from analysis.sliding.comparison import Extreme, turning_places
from analysis.sliding.experiment import SlidingFindings, sliding_findings
from tests.analysis.sliding.rigs import PATH_M, Rig, Setting, default_plan, passes, rig

RIGS = 100
FINE_M = np.arange(PATH_M[0], PATH_M[1], 1e-5).astype(np.float64)
LEAST = 0.9
Found = tuple[str, float, tuple[float, float], float]
"""What it is, its estimate, its interval, and the true value."""

pytestmark = pytest.mark.soak


def true_place_m(own: Rig, one: Extreme, speed_m_s: float) -> float:
    """Return the place at which the rig's own friction turns, nearest to where it is expected."""
    setting = Setting(frequency_hz=one.setting.frequency_hz, speed_m_s=speed_m_s)
    places = turning_places(FINE_M, own.friction(setting, FINE_M), one.kind)
    return float(places[np.abs(places - one.expected_m).argmin()])


def estimates(seed: int, speed_m_s: float) -> Iterator[Found]:
    own = rig(seed)
    made = passes(own, default_plan(own.measured_hz, speed_m_s=speed_m_s), seed)
    findings = sliding_findings(made, own.measured_hz, "slide/1")
    assert isinstance(findings, SlidingFindings)
    for name, found in findings.fit.estimates.items():
        if isinstance(found, Estimate):
            yield name, found.value, found.interval, getattr(own.true, name)
    for one in findings.extremes:
        if isinstance(one.place_m, float) and one.interval_m is not None:
            yield one.kind, one.place_m, one.interval_m, true_place_m(own, one, speed_m_s)


@pytest.mark.parametrize("speed_m_s", [0.005, 0.04])
def test_intervals_of_the_default_plan_cover_the_rigs_own_values(speed_m_s: float) -> None:
    numbers = defaultdict(list)
    for seed in range(RIGS):
        for name, value, (low, high), true in estimates(seed, speed_m_s):
            numbers[name].append((low <= true <= high, (high - low) / 2, value - true))
    print(f"\n{RIGS} rigs, {1e3 * speed_m_s:g} mm/s: coverage, mean half width, mean error ± SD")
    for name, rows in numbers.items():
        inside, half_width, error = np.array(rows).T
        print(
            f"{name:22}{inside.mean():.3f} of {inside.size:4}{half_width.mean():12.3g}"
            f"{error.mean():12.2g} ± {error.std():.2g}"
        )
    for name in ("damping_ratio", "resonance_hz", "trough"):
        assert len(numbers[name]) >= LEAST * RIGS
        assert np.mean([inside for inside, *_ in numbers[name]]) >= LEAST
