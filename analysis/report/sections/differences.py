"""Differences between conditions: the omnibus test and pairwise comparisons."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from analysis.estimates import LEVEL, Json, NotEstimable, or_null, why
from analysis.loading.score_table import ScoreTable
from analysis.report import blocks
from analysis.report.as_json import friedman_json, pair_json, skillings_mack_json
from analysis.report.figure_data import raincloud, raincloud_figure
from analysis.report.findings import Findings
from analysis.report.wording import beside, number, of_all, omnibus_line
from analysis.statistics.intervals import COVERAGE, DESIGN
from analysis.statistics.omnibus import Friedman
from analysis.statistics.signed_rank import PairwiseTest, SignedRank
from analysis.statistics.summary import Reading


def section(found: Findings) -> blocks.Section:
    """Return the tests of the conditions, and the scores that they compare."""
    main = found.table.main
    return blocks.Section(
        name="tests",
        title="Do the conditions differ?",
        blocks=[
            omnibus_line(main),
            _pairs_line(main.pairwise),
            _pairwise_table(main.pairwise) if main.pairwise else None,
            "Share of 95% intervals that covered the truth in simulations "
            f"({DESIGN}): {', '.join(f'{name} {share:.3f}' for name, share in COVERAGE.items())}."
            if main.pairwise
            else None,
            _scores_figure(found),
        ],
        data=_tests_json(main),
    )


def front(found: Findings) -> list[blocks.Block]:
    """Return what of it stands among the results."""
    return [_scores_figure(found)]


def _pairs_line(pairs: Sequence[PairwiseTest]) -> str:
    """Return which pairs differ, or why none does: with few subjects no scores can show it."""
    differ = [f"{pair.a} and {pair.b}" for pair in pairs if pair.differs]
    tested = [pair.test for pair in pairs if isinstance(pair.test, SignedRank)]
    if not tested:
        return "No pair of conditions can be tested."
    if not differ:
        none = "No pair of conditions differs significantly after Holm's correction."
        # The smallest exact p of n differences is 2 of the 2ⁿ signs; Holm's first step multiplies
        # it by the number of tests.
        least = len(tested) * 2.0 ** (1 - max(test.n for test in tested))
        few = f" So few differences cannot show it: p (Holm) is at least {min(least, 1.0):.2g}."
        return none + (few if least >= LEVEL else "")
    return f"Significant differences after Holm's correction: {', '.join(differ)}."


def _pairwise_table(pairs: Sequence[PairwiseTest]) -> blocks.Table:
    numbers = ("mean difference", "V", "n", "zeros", "rank-biserial r", "p", "p (Holm)")
    return blocks.Table(
        name="pairwise",
        caption="Two-sided Wilcoxon signed-rank test of each pair of conditions. V is the sum of "
        "the ranks of positive differences; zero differences are dropped and counted; p (Holm) is "
        "corrected for the number of pairs that could be tested. In brackets: 95% intervals; a "
        "mean difference has none where all subjects differ by the same.",
        columns=blocks.columns("pair", *numbers, "method"),
        rows=[[f"{pair.a} − {pair.b}", *_pair_cells(pair)] for pair in pairs],
        unbroken=True,
    )


def _pair_cells(pair: PairwiseTest) -> list[str | blocks.Cell]:
    test = pair.test
    if not isinstance(test, SignedRank):
        return [*[number(None)] * 7, test.reason]
    return [
        number(test.mean_difference, 2)
        + (beside(test.mean_difference_interval) or " (no interval)"),
        f"{test.statistic:g}",
        str(test.n),
        str(test.n_zero),
        number(test.rank_biserial, 2) + beside(test.rank_biserial_interval),
        blocks.p_cell(test.p),
        blocks.p_cell(pair.p_holm),
        test.method,
    ]


def _scores_figure(found: Findings) -> blocks.Figure:
    data = raincloud(found)
    drawn = of_all(len(data.lines), len(data.table.subjects), "subjects' lines")
    return blocks.Figure(
        name="scores",
        title="Scores by condition",
        caption="Scores by condition. Lines with circles show subjects, clouds the density of "
        "eight scores or more, bars the interquartile range with the median, and diamonds the "
        f"means.{drawn}",
        draw=partial(raincloud_figure, data),
        keep=found.keep,
        table=_quartile_table(data.table),
        front=True,
    )


def _quartile_table(table: ScoreTable) -> blocks.Table:
    by_condition = zip(table.conditions, table.scores.T, strict=True)
    name, count, *quartiles = blocks.spread_columns("condition")
    mean = blocks.Column("mean", lambda group: group[1].mean() if group[1].size else None, 2)
    return blocks.Table.over(
        [(name, column[~np.isnan(column)]) for name, column in by_condition],
        [name, count, mean, *quartiles],
        name="quartiles",
        caption="Numbers shown in the figure; Table 4 lists the individual scores.",
    )


# A `null` always has its reason beside it.
_COMPLETE = NotEstimable("no score is missing, so Friedman's test applies")


def _tests_json(main: Reading) -> Json:
    test = main.friedman
    w_ends = test.kendall_w_interval if isinstance(test, Friedman) else test
    return {
        "friedman": friedman_json(main),
        "skillings_mack": skillings_mack_json(main.skillings_mack),
        **why("skillings_mack", main.skillings_mack or _COMPLETE),
        "kendall_w": test.kendall_w if isinstance(test, Friedman) else None,
        **why("kendall_w", test),
        "kendall_w_interval": or_null(w_ends),
        **why("kendall_w_interval", w_ends),
        "interval_coverage": {"design": DESIGN, "coverage": dict(COVERAGE)},
        "rank_sums": dict(zip(main.table4.table.conditions, test.rank_sums, strict=True))
        if isinstance(test, Friedman)
        else None,
        **why("rank_sums", test),
        "pairwise": [pair_json(pair) for pair in main.pairwise],
    }
