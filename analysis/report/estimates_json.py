"""Tests, fits of the sensitivity models and scores of laws as JSON; `report` puts it together."""

import math
from collections.abc import Sequence

from analysis.estimates import Json, NotEstimable, or_null, plain, why
from analysis.sensitivity.linear_model import LinearSensitivity
from analysis.sensitivity.lines import SMALL_SPREAD, Lines, SubjectLine
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from analysis.statistics.omnibus import Friedman, MonteCarlo, SkillingsMack
from analysis.statistics.signed_rank import PairwiseTest
from analysis.statistics.slope import LevelSlope, Slope
from analysis.statistics.summary import ConditionTests
from analysis.trials.law_likelihood import LawOrder
from analysis.trials.trial_statistics import LawScore


def unknown(found: NotEstimable, *names: str) -> Json:
    """Return `null` for each of the numbers that could not be estimated, and the reason."""
    # Keys stay where values are missing, so that programs find the same form.
    return {**dict.fromkeys(names), "reason": found.reason}


def with_reasons(record: object) -> Json:
    """Return a record whose fields are `null` where they are not known, each with why."""
    found: Json = plain(record)
    missing = {name: getattr(record, name) for name in found}
    for name, value in missing.items():
        found |= {name: None} | why(name, value) if isinstance(value, NotEstimable) else {}
    return found


_COMPLETE = NotEstimable("no cell is empty, so Friedman's test applies")


def tests_json(tests: ConditionTests, measure: str) -> Json:
    """Return the tests of the conditions of a table; `measure` is what is in its cells."""
    test = tests.friedman
    w_ends = test if isinstance(test, NotEstimable) else test.kendall_w_interval
    sums = () if isinstance(test, NotEstimable) else test.rank_sums
    names = tests.table.conditions
    return {
        "friedman": {**friedman_json(tests), "of": measure},
        "skillings_mack": skillings_mack_json(tests.skillings_mack),
        **why("skillings_mack", tests.skillings_mack or _COMPLETE),
        "kendall_w": None if isinstance(test, NotEstimable) else test.kendall_w,
        **why("kendall_w", test),
        "kendall_w_interval": or_null(w_ends),
        **why("kendall_w_interval", w_ends),
        "rank_sums": dict(zip(names, sums, strict=True)) if sums else None,
        **why("rank_sums", test),
        "pairwise": [pair_json(pair) for pair in tests.pairwise],
    }


def slope_json(slope: Slope | LevelSlope | NotEstimable) -> Json:
    """Return the slope of responses on predicted contrasts, with its interval as `ci`."""
    if isinstance(slope, NotEstimable):
        return unknown(slope, "value", "ci", "p")
    found = with_reasons(slope)
    return {name.replace("interval", "ci"): value for name, value in found.items()}


def friedman_json(tests: ConditionTests) -> Json:
    """Return Friedman's test, or `null` and the Skillings–Mack test if cells are empty."""
    test = tests.friedman
    if isinstance(test, NotEstimable):
        instead = skillings_mack_json(tests.skillings_mack)
        return {**unknown(test, "chi2", "df", "p", "p_exact"), "skillings_mack": instead}
    return {
        "chi2": test.chi2,
        "df": test.df,
        "p": test.p,
        "p_exact": or_null(test.p_exact),
        **why("p_exact", test.p_exact),
        **_monte_carlo_json(test.monte_carlo),
        "p_used": _p_used(test),
    }


def skillings_mack_json(test: SkillingsMack | NotEstimable | None) -> Json | None:
    """Return the Skillings–Mack test, or `None` if no cell is empty."""
    if isinstance(test, NotEstimable):
        return unknown(test, "statistic", "df", "p")
    if test is None:
        return None
    known: Json = plain(test)
    # Its numbers stand beside the others, under names that Friedman's test has as well.
    del known["monte_carlo"]
    return {**known, **_monte_carlo_json(test.monte_carlo), "p_used": _p_used(test)}


def _p_used(test: Friedman | SkillingsMack) -> str:
    """Return the name of the p by which the test decides; `p` is that of chi-square."""
    if test.monte_carlo is not None:
        return "p_monte_carlo"
    exact = isinstance(test, Friedman) and not isinstance(test.p_exact, NotEstimable)
    return "p_exact" if exact else "p"


def _monte_carlo_json(found: MonteCarlo | None) -> Json:
    """Return the p of random shufflings, or nothing if another one is better."""
    if found is None:
        return {}
    return {
        "p_monte_carlo": found.p,
        "p_monte_carlo_error": found.error,
        "shuffles": found.shuffles,
    }


def pair_json(pair: PairwiseTest) -> Json:
    """Return the signed-rank test of a pair of conditions."""
    names = {"a": pair.a, "b": pair.b}
    if isinstance(pair.test, NotEstimable):
        tested = ("statistic", "n", "n_zero", "p", "method", "p_holm")
        sizes = ("rank_biserial", "rank_biserial_interval")
        differences = ("mean_difference", "mean_difference_interval")
        return {**names, **unknown(pair.test, *tested, *sizes, *differences)}
    return {**names, **with_reasons(pair.test), "p_holm": or_null(pair.p_holm)}


def fit_json(
    fit: LinearSensitivity | OrdinalSensitivity | TwoStageSensitivity | NotEstimable,
) -> Json:
    """Return the fit with the subjects' and the population's lines beside its other numbers."""
    found: Json = plain(fit)
    if isinstance(fit, TwoStageSensitivity):
        del found["ratings"]
        return {**fit_json(fit.ratings), **found}
    if isinstance(fit, NotEstimable):
        return found
    del found["lines"]
    return {**_lines_json(fit.lines), **found}


def _lines_json(lines: Lines) -> Json:
    population = {name: value for name, value in plain(lines).items() if name != "subjects"}
    subjects = subjects_json(lines.subjects)
    if not lines.group_known:
        reason = "a single subject tells nothing about a population"
        return {"subjects": subjects, "population": None, "population_reason": reason}
    small = {"below_share_of_gain": SMALL_SPREAD, "p": population.pop("small_gain_sd")}
    return {"subjects": subjects, "population": {**_line_json(population), "small_gain_sd": small}}


def subjects_json(lines: Sequence[SubjectLine]) -> list[Json]:
    """Return the subjects' lines, with a reason where one cannot be compared with others."""
    alone = {"relative_gain_reason": "a single subject has no others to compare with"}
    return [_line_json(plain(line)) | ({} if line.relative_gain_known else alone) for line in lines]


def _line_json(line: Json) -> Json:
    """Return a line with short names of intervals, and `null` in place of an unbounded JND."""
    # `_ci` is the name in `report.json`, which programs of others read.
    found = {name.replace("interval", "ci"): value for name, value in line.items()}
    # JSON has no infinity.
    low, high = (None if end == math.inf else end for end in found["jnd_ci"])
    jnd = None if found["jnd"] == math.inf else found["jnd"]
    reason = {} if high else {"jnd_reason": "unbounded, because the gain may be 0"}
    return {**found, "jnd": jnd, "jnd_ci": [low, high], **reason}


def law_json(score: LawScore) -> Json:
    """Return how a law orders the conditions and fits the ratings."""
    return {
        "law": score.law,
        **_order_json(score.order),
        "predicted": plain(score.predicted),
        "who_felt_what": with_reasons(score.likelihood),
    }


def _order_json(order: LawOrder | NotEstimable) -> Json:
    if isinstance(order, NotEstimable):
        names = ("spearman", "p", "rho_needed", "r_needed", "order", "order_tied")
        return {**unknown(order, *names), "order": [], "order_tied": []}
    known: Json = {
        "spearman": or_null(order.spearman),
        "order": list(order.order),
        "order_tied": plain(order.tied),
        "p": or_null(order.p),
        "rho_needed": or_null(order.rank_needed),
        "r_needed": or_null(order.needed),
    }
    if isinstance(order.spearman, NotEstimable):
        known["reason"] = order.spearman.reason
    return {**known, **why("rho_needed", order.rank_needed)}
