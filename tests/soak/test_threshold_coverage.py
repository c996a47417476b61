"""Coverage of the 95% intervals of thresholds, with lapses of 0 to 5%."""

import numpy as np
import pytest
from scipy.special import ndtr

from analysis.thresholds.answer_curve import Shape
from analysis.thresholds.psychometric import fitted
from protocol.study.track import GUESS_RATE, Task

TRACKS = 500
LEVELS, TRIALS = 7, 20

pytestmark = pytest.mark.soak


@pytest.mark.parametrize("task", GUESS_RATE)
@pytest.mark.parametrize("shape", ["normal", "weibull"])
def test_intervals_of_thresholds_cover_the_truth(task: Task, shape: Shape) -> None:
    """Constant stimuli: midpoints in the middle half of the levels, widths from a third of them."""
    rng = np.random.default_rng(2026)
    covered = np.zeros(TRACKS, dtype=bool)
    for track in range(TRACKS):
        at, scale = rng.uniform(0.25, 0.75), 3.2897 / rng.uniform(0.33, 1.0)
        place = np.linspace(0, 1, LEVELS)
        if shape == "normal":
            levels, threshold, curve = place, at, ndtr(scale * (place - at))
        else:
            levels, threshold = np.exp(place), np.exp(at)
            curve = 1 - 2.0 ** -np.exp(scale * 4.0674 / 3.2897 * (place - at))
        guess = GUESS_RATE[task] or rng.uniform(0, 0.05)
        p = guess + (1 - guess - rng.uniform(0, 0.05)) * curve
        trials = np.full(LEVELS, TRIALS)
        found = fitted(levels, trials, rng.binomial(trials, p), task=task, shape=shape)
        covered[track] = found.threshold_ci[0] <= threshold <= found.threshold_ci[1]
    share = float(covered.mean())
    print(f"{task}, {shape}: {share:.3f}")
    assert 0.93 <= share <= 0.98
