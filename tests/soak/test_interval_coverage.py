"""Coverage of the 95% intervals of effect sizes, as the report states it."""

from collections.abc import Mapping

import numpy as np
import pytest

from analysis.estimates import FloatArray, ScoreTable
from analysis.statistics.intervals import COVERAGE, concordance_interval
from analysis.statistics.signed_rank import SignedRank, doubled_midranks, signed_rank

STUDIES = 10_000
MEANS = np.array([7.0, 7.5, 8.0, 6.5, 6.0])
SUBJECTS, SUBJECT_SD, RESIDUAL_SD = 9, 0.7, 1.0

pytestmark = pytest.mark.soak


def drawn(rng: np.random.Generator, subjects: int) -> ScoreTable:
    """A table of scores."""
    level = rng.normal(0, SUBJECT_SD, subjects)
    latent = level[:, None] + MEANS + rng.normal(0, RESIDUAL_SD, (subjects, 5))
    scores = np.clip(np.round(latent), 0, 10)
    names = tuple(str(number) for number in range(subjects))
    return ScoreTable(subjects=names, conditions=tuple("abcde"), scores=scores)


def estimates(table: ScoreTable) -> Mapping[str, tuple[FloatArray, FloatArray]]:
    """Each effect size with the ends of its interval, shape (effects, 2)."""
    ranks = doubled_midranks(table.scores) / 2 - 3
    w = (ranks.sum(axis=0) ** 2).sum() / (len(ranks) * (ranks**2).sum())
    pair = signed_rank(table.scores[:, 1] - table.scores[:, 3])
    assert isinstance(pair, SignedRank)

    def of(value: object, ends: object) -> tuple[FloatArray, FloatArray]:
        return np.array(value, dtype=np.float64), np.array(ends, dtype=np.float64)

    return {
        "Kendall's W": of([w], [concordance_interval(ranks)]),
        "rank-biserial r": of([pair.rank_biserial], [pair.rank_biserial_interval]),
        "mean difference": of([pair.mean_difference], [pair.mean_difference_interval]),
    }


def test_the_intervals_cover_the_truth_as_often_as_the_report_says() -> None:
    rng = np.random.default_rng(2026)
    found = [estimates(drawn(rng, SUBJECTS)) for _ in range(STUDIES)]
    large = estimates(drawn(rng, 20_000))
    for name, stated in COVERAGE.items():
        values, ends = (np.array([study[name][part] for study in found]) for part in (0, 1))
        truth = large[name][0]
        if name in {"Kendall's W", "rank-biserial r"}:  # their expectation depends on n
            truth = values.mean(axis=0)
        share = float(((ends[..., 0] <= truth) & (truth <= ends[..., 1])).mean())
        print(f"{name}: {share:.3f}")
        assert share == pytest.approx(stated, abs=0.007)
