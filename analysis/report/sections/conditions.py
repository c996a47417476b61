"""Effects of conditions: tests of differences, agreement between subjects, sizes of effects."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import itemgetter
from typing import TypeVar

import numpy as np

from analysis.estimates import LEVEL, Interval, Json, NotEstimable, ScoreTable, or_null, plain, why
from analysis.loading.response import IN_WORDS
from analysis.report import blocks, estimates_json, figure_data
from analysis.report.findings import Findings
from analysis.report.results import NO_FINDING
from analysis.report.wording import beside, number, of_all, omnibus_line, p_equals
from analysis.statistics.intervals import COVERAGE, DESIGN
from analysis.statistics.ordinal import Interaction, OrdinalEffects
from analysis.statistics.signed_rank import PairwiseTest, SignedRank, least_holm_p
from analysis.statistics.slope import Slope
from analysis.statistics.summary import TableStatistics
from analysis.statistics.two_way import IntraclassCorrelation
from analysis.trials.trial_statistics import TrialStatistics
from protocol.errors import listed
from protocol.registration.registration import OMNIBUS

Fit = TypeVar("Fit")


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
            "Share of 95% intervals that covered the truth in simulations "
            f"({DESIGN}): {', '.join(f'{name} {share:.3f}' for name, share in COVERAGE.items())}."
            if of.pairwise
            else None,
            *([slope_line(slope), _level_line(found)] if found.is_predicted else []),
            scores_figure(found),
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
        f"contrast, 95% interval{beside(slope.interval)}, {p_equals(slope.p)} (t test of "
        f"{slope.people} participants' slopes)."
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
        table=_quartile_table(of.table, found.measure),
        front=True,
    )


def _quartile_table(table: ScoreTable, measure: str) -> blocks.Table:
    given = (column[~np.isnan(column)] for column in table.scores.T)
    name, count, *quartiles = blocks.spread_columns("condition")
    mean = blocks.Column("mean", lambda group: group[1].mean() if group[1].size else None, 2)
    of = "Table 4" if measure == "score" else "The section Trials"
    return blocks.Table.over(
        zip(table.conditions, given, strict=True),
        [name, count, mean, *quartiles],
        name="quartiles",
        caption=f"Numbers shown in the figure. {of} lists each {measure}.",
    )


# Agreement between subjects, and effects of conditions and subjects.


def agreement(found: Findings) -> blocks.Section:
    """Return intraclass correlations, additive effects and ordinal effects."""
    return blocks.Section(
        title="Agreement and effects",
        blocks=[
            _icc_table(found.table),
            _additive_line(found.table),
            _ordinal_line(found.trials),
            _condition_table(found),
            _subject_table(found.table),
            _people_figure(found),
        ],
        data={
            "icc": {
                "subjects": _icc_json(found.table.icc_subjects),
                "conditions": _icc_json(found.table.icc_conditions),
            },
            "additive": _additive_json(found.table),
            "gain_heterogeneity": plain(found.table.heterogeneity),
            "ordinal": {link: _ordinal_json(fit) for link, fit in found.trials.ordinal.items()},
        },
    )


def _icc_table(table: TableStatistics) -> blocks.Table:
    targets = {
        "subjects (how reliably one condition's score measures a subject)": table.icc_subjects,
        "conditions (how reliably one subject's score measures a condition)": table.icc_conditions,
    }
    return blocks.Table(
        name="icc",
        caption="Intraclass correlations by target (Shrout and Fleiss): (2,1) absolute agreement "
        "of single scores, (3,1) consistency of single scores, (3,k) consistency of means. In "
        "brackets: 95% intervals.",
        columns=blocks.columns("target", *(f"ICC({kind})" for kind in _ICC)),
        rows=[[target, *_icc_cells(icc)] for target, icc in targets.items()],
    )


_ICC = {"2,1": "agreement_single", "3,1": "consistency_single", "3,k": "consistency_mean"}
"""Shrout and Fleiss' name of each coefficient, and its field."""


def _icc_cells(icc: IntraclassCorrelation | NotEstimable) -> list[str]:
    if isinstance(icc, NotEstimable):
        return [f"not estimable: {icc.reason}", number(None), number(None)]
    ends = {} if isinstance(icc.intervals, NotEstimable) else icc.intervals
    return [
        number(getattr(icc, name)) + (beside(ends[name]) if name in ends else "")
        for name in _ICC.values()
    ]


def _additive_line(table: TableStatistics) -> str:
    effects, gains = table.additive, table.heterogeneity
    if isinstance(effects, NotEstimable):
        return f"Additive effects: not estimable ({effects.reason})."
    slopes = (
        f"not estimable ({gains.reason})"
        if isinstance(gains, NotEstimable)
        else f"Mandel's F({gains.df[0]}, {gains.df[1]}) = {gains.f:.3f}, by shuffling "
        f"{p_equals(gains.p)}, "
        f"standard deviation of the slopes (moment estimate) τ = {number(gains.tau)}"
    )
    return (
        f"Additive model: score = {number(effects.grand_mean)} + condition + subject + residual. "
        f"Residual standard deviation {number(effects.residual_sd)} ({effects.residual_df} df), "
        f"between-subject standard deviation {number(effects.subject_sd)}, shrinkage factor "
        f"{number(effects.shrinkage)}. Gain heterogeneity (differences between subjects in the "
        f"size of condition effects): {slopes}."
    )


def _ordinal_line(trials: TrialStatistics) -> str:
    """Tell how much subjects differ, in their effects as well if they repeated conditions."""
    alone = _by_link(
        trials.ordinal,
        lambda fit: (
            f"between-subject standard deviation {number(fit.subject_sd)}, "
            f"log-likelihood {number(fit.log_likelihood, 4)}"
        ),
    )
    fits = {link: fit for link, fit in trials.ordinal.items() if isinstance(fit, OrdinalEffects)}
    if not (fits and trials.has_repeats):
        return f"Ordinal mixed model, {alone}."
    within = _by_link(
        {link: fit.interaction for link, fit in fits.items()},
        lambda it: (
            f"standard deviation {number(it.sd)}{beside(it.sd_interval)}, "
            f"likelihood ratio {number(it.likelihood_ratio)}, {p_equals(it.p)}"
        ),
    )
    return (
        f"Ordinal mixed model, {alone}. With a random intercept of each subject under each "
        f"condition (subject × condition) beside it, {within}."
    )


def _by_link(fits: Mapping[str, Fit | NotEstimable], told: Callable[[Fit], str]) -> str:
    said = {
        link: f"not estimable ({fit.reason})" if isinstance(fit, NotEstimable) else told(fit)
        for link, fit in fits.items()
    }
    return "; ".join(f"{link}: {words}" for link, words in said.items())


def _condition_table(found: Findings) -> blocks.Table:
    conditions, ordinal = found.loaded.table.conditions, found.trials.ordinal
    effects = found.table.additive
    additive = (
        {}
        if isinstance(effects, NotEstimable)
        else {
            name: number(effect) + _ends(effects.condition_intervals, name)
            for name, effect in effects.conditions.items()
        }
    )
    return blocks.Table(
        name="conditions",
        caption="Effects of conditions: additive, in points relative to the grand mean, "
        "with 95% intervals; and in the ordinal mixed model with a random intercept per subject"
        f"{', and per subject and condition,' if found.trials.has_repeats else ','} on its latent "
        f"scale relative to {conditions[0]}, ± standard error.",
        columns=blocks.columns("condition", "additive", *(f"ordinal, {link}" for link in ordinal)),
        rows=[
            [name, additive.get(name, number(None)), *(_effect(e, name) for e in ordinal.values())]
            for name in conditions
        ],
    )


def _ends(intervals: Mapping[str, Interval], name: str) -> str:
    return beside(intervals[name]) if name in intervals else " (no interval)"


def _effect(effects: OrdinalEffects | NotEstimable, name: str) -> str:
    if isinstance(effects, NotEstimable):
        return number(None)
    if name == effects.reference:
        return "reference"
    within = effects.interaction
    # Without it the errors are too small if subjects differ in their effects (docs/report.md).
    best = effects if isinstance(within, NotEstimable) else within
    return f"{number(best.effects[name])} ± {number(best.standard_errors[name])}"


def _subject_table(table: TableStatistics) -> blocks.Table | None:
    effects, gains = table.additive, table.heterogeneity
    if isinstance(effects, NotEstimable):
        return None
    slopes: Mapping[str, float] = {} if isinstance(gains, NotEstimable) else gains.gains
    return blocks.Table.over(
        effects.subjects.items(),
        [
            blocks.Column("subject", itemgetter(0)),
            blocks.Column(
                "additive", lambda it: number(it[1]) + _ends(effects.subject_intervals, it[0])
            ),
            blocks.Column("shrinkage", lambda it: effects.subject_shrinkage[it[0]], 3),
            blocks.Column("slope", lambda it: slopes.get(it[0]), 3),
        ],
        name="subjects",
        caption="Each subject's additive effect in points with its 95% interval, the "
        "shrinkage factor, and the slope of the subject's scores on the condition "
        "effects (1 on average).",
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


def _icc_json(icc: IntraclassCorrelation | NotEstimable) -> Json:
    if isinstance(icc, NotEstimable):
        return estimates_json.unknown(icc, *_ICC)
    values = {kind: getattr(icc, name) for kind, name in _ICC.items()}
    missing = [value.reason for value in values.values() if isinstance(value, NotEstimable)]
    ends = icc.intervals
    known: Json = {kind: or_null(value) for kind, value in values.items()} | {
        "intervals": None
        if isinstance(ends, NotEstimable)
        else {kind: list(ends[name]) for kind, name in _ICC.items()},
        **why("intervals", ends),
    }
    return {**known, "reason": missing[0]} if missing else known


def _additive_json(table: TableStatistics) -> Json:
    effects = table.additive
    if isinstance(effects, NotEstimable):
        nothing = estimates_json.unknown(effects, "residual_sd", "subject_sd", "shrinkage")
        return {"conditions": {}, "subjects": {}, **nothing}
    return {
        **estimates_json.with_reasons(effects),
        "subject_shrinkage": {name: or_null(s) for name, s in effects.subject_shrinkage.items()},
    }


def _ordinal_json(effects: OrdinalEffects | NotEstimable) -> Json:
    if isinstance(effects, NotEstimable):
        return {"effects": {}, **estimates_json.unknown(effects, "subject_sd", "log_likelihood")}
    found, within = plain(effects), effects.interaction
    if isinstance(within, Interaction):
        found["interaction"] = estimates_json.with_reasons(within)
    return dict(found)
