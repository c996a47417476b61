"""A psychometric function fitted with intervals, beside SciPy's search for the best one alone."""

from time import process_time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import minimize
from scipy.special import expit, ndtr

from analysis.estimates import FloatArray
from analysis.thresholds.psychometric import fitted
from benchmarks.compared import compare
from protocol.study.track import GUESS_RATE, Task

ROUNDS = 15
LEVELS, TRIALS = np.arange(1.0, 8.0), np.full(7, 20)
CORRECT = {
    "two intervals": [10, 11, 13, 16, 19, 20, 19],
    "three intervals": [7, 8, 10, 14, 18, 20, 19],
    "yes or no": [1, 0, 4, 11, 18, 20, 19],
}


def _best(correct: FloatArray, task: Task) -> float:
    """Return the threshold of the most probable curve, lapse rate free, without an interval."""

    def loss(values: FloatArray) -> float:
        lapse, false_alarm = 0.5 * expit(values[2:])
        guess = GUESS_RATE[task] or false_alarm
        p = guess + (1 - guess - lapse) * ndtr((LEVELS - values[0]) / np.exp(values[1]))
        likelihood = correct @ np.log(p) + (TRIALS - correct) @ np.log1p(-p)
        return -float(likelihood + 9 * (np.log1p(-lapse) + np.log1p(-guess)))

    begin = np.array([4.0, 0.0, -3.0, -3.0])
    options = {"maxfev": 4000, "xatol": 1e-3, "fatol": 1e-4}
    return float(minimize(loss, begin, method="Nelder-Mead", options=options).x[0])


@pytest.mark.parametrize("task", CORRECT)
def test_fit_of_a_threshold(benchmark: BenchmarkFixture, task: Task) -> None:
    correct = np.array(CORRECT[task], dtype=np.float64)
    ours, theirs = [], []
    for _ in range(ROUNDS):
        start = process_time()
        found = fitted(LEVELS, TRIALS, correct, task=task, shape="normal")
        middle = process_time()
        best = _best(correct, task)
        ours.append(middle - start)
        theirs.append(process_time() - middle)
    benchmark.pedantic(lambda: fitted(LEVELS, TRIALS, correct, task=task), rounds=1)
    work = f"fit a threshold in {task}, with intervals of threshold, slope and lapse rate"
    accuracy = f"thresholds differ by {abs(found.threshold - best):.1g} of a range of 6"
    compare(benchmark, work, "scipy's Nelder-Mead, without intervals", ours, theirs, accuracy)
