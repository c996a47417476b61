"""The tests of many tables at once give the numbers of one table at a time."""

import numpy as np
import pytest
from scipy import stats

from analysis.estimates import FloatArray, NotEstimable
from analysis.statistics.corrections import holm_of_rows
from analysis.statistics.many_tables import omnibus_p, pairwise_of_tables, unnamed_table
from analysis.statistics.omnibus import Friedman, friedman, skillings_mack_p
from analysis.statistics.signed_rank import SignedRank, doubled_midranks, pairwise_signed_ranks


def tables(seed: int, subjects: int, conditions: int, missing: float = 0.0) -> FloatArray:
    """Forty tables of whole scores with ceilings, half points and missing cells."""
    rng = np.random.default_rng([seed, subjects, conditions])
    shape = (40, subjects, conditions)
    scores = np.clip(np.round(rng.normal(7.5, 2.0, shape)), 0, 10)
    scores[10:20] = np.round(2 * rng.normal(5, 1, shape)[10:20]) / 2
    scores[20] = 10.0
    scores[21, :, :2] = 3.0
    scores[22] += 0.1 + 0.2  # sums that are equal but for rounding
    scores[rng.random(shape) < missing] = np.nan
    return scores


SIZES = [(9, 5), (20, 5), (3, 4), (7, 3), (12, 2), (2, 2), (230, 2)]


@pytest.mark.parametrize(("subjects", "conditions"), SIZES)
@pytest.mark.parametrize("missing", [0.0, 0.2])
def test_pairs_are_those_of_each_table(subjects: int, conditions: int, missing: float) -> None:
    scores = tables(1, subjects, conditions, missing)
    found = pairwise_of_tables(scores)
    assert found.p.shape == (40, conditions * (conditions - 1) // 2)
    for number, one in enumerate(scores):
        tests = pairwise_signed_ranks(unnamed_table(one))
        p = [each.test.p if isinstance(each.test, SignedRank) else np.nan for each in tests]
        holm = [np.nan if isinstance(it.p_holm, NotEstimable) else it.p_holm for it in tests]
        np.testing.assert_allclose(found.p[number], p, rtol=1e-12, atol=0)
        np.testing.assert_allclose(found.p_holm[number], holm, rtol=1e-12, atol=0)
        for place, each in enumerate(tests):
            if isinstance(each.test, SignedRank):
                mean = each.test.mean_difference
                assert found.mean[number, place] == pytest.approx(mean, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(("subjects", "conditions"), [(7, 5), (8, 4), (5, 3), (9, 2)])
def test_the_omnibus_p_is_that_of_each_table(subjects: int, conditions: int) -> None:
    scores = tables(2, subjects, conditions)
    if conditions > 3:  # the exact p, which is not compared here, takes a second
        scores = scores[[0, 10, 20, 21, 22]]
    for one, p in zip(scores, omnibus_p(scores), strict=True):
        test = friedman(unnamed_table(one))
        if not isinstance(test, Friedman):
            assert np.isnan(p)
        elif conditions <= 3 and not isinstance(test.p_exact, NotEstimable):
            assert p == pytest.approx(test.p_exact, rel=1e-12)
        else:
            assert p == pytest.approx(test.p, rel=1e-12)


def test_a_table_with_missing_scores_has_the_p_of_skillings_and_mack() -> None:
    scores = tables(3, 9, 5, missing=0.15)
    expected = [skillings_mack_p(unnamed_table(one)) for one in scores if np.isnan(one).any()]
    found = omnibus_p(scores)[np.isnan(scores).any(axis=(1, 2))]
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_ranks_are_midranks() -> None:
    scores = tables(4, 6, 4, missing=0.3)
    expected = stats.rankdata(scores, axis=-1, nan_policy="omit")
    assert (doubled_midranks(scores) == np.nan_to_num(2 * expected)).all()


def test_a_row_without_tests_has_no_correction() -> None:
    assert np.isnan(holm_of_rows(np.full((1, 3), np.nan))).all()
