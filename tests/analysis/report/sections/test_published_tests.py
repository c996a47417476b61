"""The tests of published tables of scores in report.json, against brute force and scipy."""

import csv
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import partial
from itertools import combinations, permutations, product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray
from analysis.report.report import report, report_json
from tests.analysis.reports import ORIGIN, PAPER, imported

PUBLISHED = Path(__file__).parents[3] / "data" / "published_scores.csv"


def published() -> tuple[tuple[str, ...], FloatArray]:
    header, *rows = csv.reader(PUBLISHED.read_text(encoding="utf-8").splitlines())
    return tuple(header[1:]), np.array([row[1:] for row in rows], dtype=float)


def random_table(seed: int) -> tuple[tuple[str, ...], FloatArray]:
    """Whole scores with ties, of up to seven people under three to five conditions."""
    rng = np.random.default_rng(seed)
    people, conditions = int(rng.integers(4, 8)), int(rng.integers(3, 6))
    level = rng.normal(5, 2, (people, 1)) + rng.normal(0, 1.5, conditions)
    scores = np.clip(np.round(level + rng.normal(0, 1.5, (people, conditions))), 0, 10)
    return tuple(f"c{place}" for place in range(conditions)), scores


TABLES: dict[str, Callable[[], tuple[tuple[str, ...], FloatArray]]] = {
    "the paper's": published,
    **{str(seed): partial(random_table, seed) for seed in range(10)},
}


def numbers_of(names: tuple[str, ...], scores: FloatArray) -> dict[str, Any]:
    loaded, origin = imported(scores, names=names), replace(ORIGIN, alone=True)
    return report_json(report("a study", loaded, PAPER, origin, shown=("tests",)))


def exact_p(scores: FloatArray) -> float:
    """The share of all shufflings within people whose rank sums are as unequal.

    People are added one by one, with the number of shufflings of each set of rank sums; the order
    of the sums does not matter, because everybody's ranks come in each order.
    """
    ranks = [[int(2 * rank) for rank in stats.rankdata(row)] for row in scores]
    sums = Counter({(0,) * len(ranks[0]): 1})
    for row in ranks:
        orders = Counter(permutations(row))
        after: Counter[tuple[int, ...]] = Counter()
        for before, ways in sums.items():
            for order, times in orders.items():
                total = sorted(map(sum, zip(before, order, strict=True)))
                after[tuple(total)] += ways * times
        sums = after
    observed = sum(total**2 for total in map(sum, zip(*ranks, strict=True)))
    reached = sum(ways for key, ways in sums.items() if sum(of**2 for of in key) >= observed)
    return float(Fraction(reached, sum(sums.values())))


def signed_rank(differences: FloatArray) -> tuple[float, float]:
    """V, and the share of all signs that put it as far from its middle."""
    ranks = stats.rankdata(np.abs(differences))
    observed, middle = ranks[differences > 0].sum(), ranks.sum() / 2
    values = np.array(list(product((0, 1), repeat=len(ranks)))) @ ranks
    return float(observed), float((np.abs(values - middle) >= abs(observed - middle)).mean())


def holm(p: list[float]) -> list[float]:
    """Step down: the least p times the number of tests, the next times one less, never falling."""
    corrected, highest = [0.0] * len(p), 0.0
    for step, place in enumerate(sorted(range(len(p)), key=lambda at: p[at])):
        highest = max(highest, min(1.0, (len(p) - step) * p[place]))
        corrected[place] = highest
    return corrected


@pytest.mark.parametrize("table", TABLES)
def test_friedmans_test_is_that_of_scipy_and_of_all_shufflings(table: str) -> None:
    names, scores = TABLES[table]()
    people, conditions = scores.shape
    numbers = numbers_of(names, scores)
    friedman, known = numbers["friedman"], stats.friedmanchisquare(*scores.T)
    assert (friedman["of"], numbers["responses"]["of"]) == ("score", "score")
    assert friedman["chi2"] == pytest.approx(known.statistic, rel=1e-10)
    assert friedman["p"] == pytest.approx(known.pvalue, rel=1e-9)
    assert friedman["p_exact"] == pytest.approx(exact_p(scores), rel=1e-12)
    assert friedman["p_used"] == "p_exact"
    assert numbers["responses"]["omnibus"]["p"] == friedman["p_exact"]
    w = known.statistic / (people * (conditions - 1))
    assert numbers["kendall_w"] == pytest.approx(w, rel=1e-10)
    sums = np.array([stats.rankdata(row) for row in scores]).sum(axis=0)
    assert list(numbers["rank_sums"].values()) == pytest.approx(sums.tolist())
    assert numbers["skillings_mack"] is None
    assert numbers["scores"] is None, "beside themselves"


@pytest.mark.parametrize("table", TABLES)
def test_pairs_are_those_of_all_signs_with_holms_correction(table: str) -> None:
    names, scores = TABLES[table]()
    pairs = numbers_of(names, scores)["pairwise"]
    assert [(pair["a"], pair["b"]) for pair in pairs] == list(combinations(names, 2))
    tested, expected = [], []
    for pair, (a, b) in zip(pairs, combinations(range(len(names)), 2), strict=True):
        differences = scores[:, a] - scores[:, b]
        changed = differences[differences != 0]
        if not changed.size:
            assert pair["p"] is None
            continue
        v, p = signed_rank(changed)
        assert (pair["statistic"], pair["n"]) == (v, len(changed))
        assert pair["n_zero"] == len(differences) - len(changed)
        assert pair["p"] == pytest.approx(p, rel=1e-12)
        assert pair["method"] == "exact"
        assert pair["mean_difference"] == pytest.approx(differences.mean())
        tested.append(pair["p_holm"])
        expected.append(p)
    assert tested == pytest.approx(holm(expected), rel=1e-12)


def test_the_papers_numbers_stay() -> None:
    numbers = numbers_of(*published())
    assert numbers["friedman"]["chi2"] == pytest.approx(21.452055, abs=5e-7)
    assert numbers["friedman"]["p_exact"] == pytest.approx(2.7105e-5, rel=2e-5)
    assert numbers["kendall_w"] == pytest.approx(0.595890, abs=5e-7)
    (pair,) = (pair for pair in numbers["pairwise"] if (pair["p_holm"] or 1) < 0.05)
    assert (pair["a"], pair["b"], pair["p_holm"]) == ("voltage", "pressure", 0.0390625)
