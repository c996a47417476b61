"""Effects of conditions: tests of differences, sizes of effects, and the scores behind them."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from analysis.estimates import LEVEL, Json, NotEstimable, ScoreTable, or_null, plain, why
from analysis.loading.response import IN_WORDS
from analysis.report import blocks, estimates_json, figure_data
from analysis.report.findings import Findings
from analysis.report.results import NO_FINDING
from analysis.report.wording import beside, number, of_all, omnibus_line, p_equals, sentence
from analysis.statistics.intervals import COVERAGE, DESIGN, KENDALLS_W
from analysis.statistics.omnibus import Friedman
from analysis.statistics.signed_rank import PairwiseTest, SignedRank, least_holm_p
from analysis.statistics.slope import Slope
from analysis.statistics.summary import ConditionTests
from protocol.errors import listed
from protocol.registration.registration import OMNIBUS

_ZEROS = " Many responses of 0 were not simulated: how these intervals cover then is not known."


def tests(found: Findings) -> blocks.Section:
    """Return the tests of the conditions, and the scores that they compare."""
    of, slope = found.trials.response_tests, found.trials.slope
    return blocks.Section(
        title="Do the conditions differ?",
        blocks=[
            _COMPARED[found.measure],
            omnibus_line(of),
            _pairs_line(of.pairwise, counts=found.questions.holds(OMNIBUS)),
            _pairwise_table(of.pairwise) if of.pairwise else None,
            _coverage_line(of, found.measure) if of.pairwise else None,
            *([slope_line(slope), _level_line(found)] if found.is_predicted else []),
            scores_figure(found),
            _people_figure(found),
        ],
        data={
            **estimates_json.tests_json(of, found.measure),
            "interval_coverage": {"design": DESIGN, "coverage": dict(COVERAGE)},
            "responses": _responses_json(found),
            **_scores_json(found),
            "questions_p_holm": dict(found.questions.p_holm),
        },
    )


_COMPARED = {
    "response": f"Conditions are compared by each participant's mean response. {IN_WORDS}.",
    "score": "Conditions are compared by each subject's scores.",
}


def _coverage_line(of: ConditionTests, measure: str) -> str:
    """Return how often intervals of the kinds that stand here covered the truth."""
    has_w = isinstance(of.friedman, Friedman) and not isinstance(
        of.friedman.kendall_w_interval, NotEstimable
    )
    shares = [
        f"{name} {share:.3f}" for name, share in COVERAGE.items() if has_w or name != KENDALLS_W
    ]
    return (
        "Share of 95% intervals that covered the truth in simulations, whose design is not this "
        f"study's ({DESIGN}): {', '.join(shares)}.{_ZEROS * (measure == 'response')}"
    )


def slope_line(slope: Slope | NotEstimable) -> str:
    """Return in a sentence whether responses follow the predicted contrasts."""
    if isinstance(slope, NotEstimable):
        return f"The slope on predicted contrasts could not be tested: {slope.reason}."
    ends = (
        f" (no interval: {slope.interval.reason})"
        if isinstance(slope.interval, NotEstimable)
        else f", 95% interval{beside(slope.interval)}"
    )
    error = f" (Monte Carlo standard error {slope.error:.1g})" if slope.error else ""
    few = (
        f" So few conditions cannot show it: p is at least {slope.least_p:.2g}."
        if slope.least_p >= LEVEL
        else ""
    )
    return (
        f"Slope on predicted contrasts: {number(slope.value, 2)} points per unit of contrast"
        f"{ends}; {p_equals(slope.p)}{error}, against {slope.assignments:,} orders of "
        f"the contrasts of {slope.conditions} conditions.{few}"
    )


def _level_line(found: Findings) -> str:
    slope = found.trials.level_slope
    if slope is None:
        return ""
    if isinstance(slope, NotEstimable):
        return f"The slope within conditions, over their levels, is not known: {slope.reason}."
    return (
        f"Within conditions, over their levels: {number(slope.value, 2)} points per unit of "
        f"contrast, 95% interval{beside(slope.interval)}, {p_equals(slope.p)} (one "
        f"slope of {slope.people} participants, t with an error from how theirs depart)."
    )


def _responses_json(found: Findings) -> Json:
    """Return the tests of the responses by question; `factors` are among them."""
    trials, tests = found.trials, found.trials.response_tests
    means = dict(zip(tests.table.conditions, plain(tests.means), strict=True))
    slopes = {"slope": trials.slope, "level_slope": trials.level_slope or _NO_LEVELS}
    if not found.is_predicted:
        slopes = dict.fromkeys(slopes, _NOT_PREDICTED)
    return {
        "of": found.measure,
        "means": means,
        "omnibus": {
            "test": "Friedman" if tests.skillings_mack is None else "Skillings-Mack",
            "p": or_null(tests.omnibus_p),
            **why("p", tests.omnibus_p),
        },
        **{name: estimates_json.slope_json(slope) for name, slope in slopes.items()},
        "factors": [
            {"factors": list(each.factors), "p": or_null(blocks.at(each.effect, "p"))}
            for each in (found.factors.effects if found.factors else ())
        ],
    }


_NO_LEVELS = NotEstimable("no condition has several levels")
_NOT_PREDICTED = NotEstimable("no friction is known of these touches")


def _scores_json(found: Findings) -> Json:
    """Return the tests of scores, of which registrations of 1.x speak; null if one is missing."""
    if found.measure == "response" and found.loaded.table.is_complete:
        return {"scores": estimates_json.tests_json(found.table.score_tests, "score")}
    none = (
        "some scores were not given"
        if found.measure == "response"
        else "scores are the responses, whose tests stand beside this"
    )
    return {"scores": None, **why("scores", NotEstimable(none))}


def _pairs_line(pairs: Sequence[PairwiseTest], *, counts: bool) -> str:
    """Return which pairs differ, or why none does: with few subjects no scores can show it."""
    differ = [f"{pair.a} and {pair.b}" for pair in pairs if pair.differs]
    tested = [pair.test for pair in pairs if isinstance(pair.test, SignedRank)]
    if not tested:
        return "No pair of conditions can be tested."
    if not differ:
        none = "No pair of conditions differs significantly after Holm's correction."
        least = least_holm_p(pairs)
        few = f" So few participants cannot show it: p (Holm) is at least {least:.2g}."
        return none + (few if least >= LEVEL else "")
    if not counts:
        return f"No pair is told, {NO_FINDING}."
    return f"Significant differences after Holm's correction: {listed(differ)}."


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


def scores_figure(found: Findings) -> blocks.Figure:
    """Return the responses, or scores, that are compared; they stand among the results."""
    of, what = found.trials.response_tests, f"{found.measure}s"
    lines = of.table.scores[figure_data.thinned(len(of.table.subjects), figure_data.MOST_LINES)]
    drawn = of_all(len(lines), len(of.table.subjects), "subjects' lines")
    return blocks.Figure(
        name="scores",
        title=f"{what.capitalize()} by condition",
        caption=f"{what.capitalize()} by condition. Lines with circles show subjects, clouds the "
        f"density of eight {what} or more, bars the interquartile range with the median, and "
        f"diamonds the means.{drawn}",
        draw=partial(
            figure_data.raincloud_figure,
            of.table,
            lines,
            of.means,
            found.measure,
            found.response_scale,
        ),
        table=_quartile_table(found, of.table),
        front=True,
    )


def _quartile_table(found: Findings, table: ScoreTable) -> blocks.Table:
    given = (column[~np.isnan(column)] for column in table.scores.T)
    name, count, *quartiles = blocks.spread_columns("condition")
    mean = blocks.Column("mean", lambda group: group[1].mean() if group[1].size else None, 2)
    of = sentence(found.table_name) if found.measure == "score" else "The section Trials"
    return blocks.Table.over(
        zip(table.conditions, given, strict=True),
        [name, count, mean, *quartiles],
        name="quartiles",
        caption=f"Numbers shown in the figure. {of} lists each {found.measure}.",
    )


def _people_figure(found: Findings) -> blocks.Figure:
    scores, table = figure_data.people(found), found.loaded.table
    if not scores:
        return blocks.Figure(name="people")
    some = (
        f" Of {len(table.subjects)} subjects, those with the lowest and the highest means and the "
        "smallest and the largest spread are drawn; the trials of all are listed below."
        if len(scores) < len(table.subjects)
        else ""
    )
    means = found.table.table4.column_means
    return blocks.Figure(
        name="people",
        title="Every subject",
        caption="Scores of each subject's trials by condition (points), and the mean of all "
        f"subjects (grey line).{some}",
        draw=partial(figure_data.people_figure, table.conditions, scores, means, found.scale),
    )
