"""Tests of many score tables at once, as a power analysis needs them, against SciPy's."""

from collections.abc import Callable
from itertools import combinations
from time import perf_counter

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.stats import friedmanchisquare, wilcoxon

from analysis.estimates import FloatArray
from analysis.statistics.many_tables import omnibus_p, pairwise_of_tables
from benchmarks.compared import compare

TABLES, SUBJECTS, CONDITIONS = 1000, 9, 5
ROUNDS = 5


def _against(
    benchmark: BenchmarkFixture,
    work: str,
    peer: str,
    ours: Callable[[], FloatArray],
    theirs: Callable[[], FloatArray],
) -> None:
    """Compare two callables that return the same p."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(ROUNDS):
        found = []
        for taken, do in zip(times, (ours, theirs), strict=True):
            start = perf_counter()
            found.append(do())
            taken.append(perf_counter() - start)
    off = float(np.max(np.abs(found[0] - found[1])))
    benchmark.pedantic(ours, rounds=1)
    ratio = compare(benchmark, work, peer, *times, f"p differs by {off:.1g} at most")
    assert off <= 1e-12
    assert ratio < 1


def test_friedmans_test(benchmark: BenchmarkFixture) -> None:
    scores = np.random.default_rng(1).integers(0, 11, (TABLES, SUBJECTS, CONDITIONS)).astype(float)

    def theirs() -> FloatArray:
        return np.array([friedmanchisquare(*table.T).pvalue for table in scores])

    work = "Friedman's test of 1,000 tables of 9 x 5 scores with ties"
    _against(benchmark, work, "scipy.stats.friedmanchisquare", lambda: omnibus_p(scores), theirs)


def test_exact_signed_ranks(benchmark: BenchmarkFixture) -> None:
    """Without ties: SciPy has no exact p of tied ranks but by going through all signs."""
    tables = np.random.default_rng(2).normal(size=(TABLES // 10, SUBJECTS, CONDITIONS))
    pairs = list(combinations(range(CONDITIONS), 2))

    def theirs() -> FloatArray:
        return np.array(
            [[wilcoxon(t[:, a], t[:, b], method="exact").pvalue for a, b in pairs] for t in tables]
        )

    work = "exact signed rank tests of all pairs in 100 tables of 9 x 5 scores"
    _against(benchmark, work, "scipy.stats.wilcoxon", lambda: pairwise_of_tables(tables).p, theirs)
