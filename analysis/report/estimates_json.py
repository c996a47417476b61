"""Tests, what the model of the answers tells and scores of laws as JSON; `report` joins them."""

from analysis.estimates import Estimate, Json, NotEstimable, or_null, plain, why
from analysis.sensitivity.answers_model import GroupLine, Noticed, Rated
from analysis.statistics.omnibus import Friedman, MonteCarlo, SkillingsMack
from analysis.statistics.signed_rank import PairwiseTest
from analysis.statistics.slope import LevelSlope, Slope
from analysis.statistics.summary import ConditionTests
from analysis.trials.law_comparison import LawOrder, LawScore


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


def estimate_json(name: str, found: Estimate | NotEstimable) -> Json:
    """Return an estimate as `name` and `name_ci`, or both as `null` with the reason."""
    if isinstance(found, NotEstimable):
        return {name: None, f"{name}_ci": None, **why(name, found)}
    return {name: found.value, f"{name}_ci": list(found.interval)}


def people_json(rating: Rated | NotEstimable) -> list[Json]:
    """Return the level and the gain of each subject, and whether the gain is told."""
    if isinstance(rating, NotEstimable):
        return []
    names = ("level", "gain", "relative_gain", "bias")
    return [
        {
            "subject": person.subject,
            "trials": person.trials,
            **_estimates_json(person, *names),
            "told": person.told,
            **({} if person.told else {"reason": person.reason}),
        }
        for person in rating.subjects
    ]


def noticing_json(noticing: Noticed | NotEstimable) -> Json:
    """Return d and criterion of the group and of each subject."""
    if isinstance(noticing, NotEstimable):
        return {**unknown(noticing, "group"), "subjects": []}
    return {
        "group": {
            **_estimates_json(noticing, "d", "criterion", "lean"),
            "p": noticing.p,
            "unit": noticing.unit,
            "share": noticing.share,
        },
        "subjects": [
            {"subject": person.subject, **_estimates_json(person, "d", "criterion")}
            for person in noticing.subjects
        ],
    }


def rating_json(rating: Rated | NotEstimable) -> Json:
    """Return what the ratings tell of the group, of groups and of conditions."""
    if isinstance(rating, NotEstimable):
        estimates = ("group_level", "group_gain", "group_bias", "selection")
        numbers = ("contrast", "span", "equal_gains", "gain_sd_below")
        known: Json = {"told": False, "effects": {}, "groups": [], "differences": []}
        ends = (f"{name}_ci" for name in estimates)
        return {**unknown(rating, *estimates, *ends, *numbers), **known}
    of_group = {f"group_{name}": getattr(rating, name) for name in ("level", "gain", "bias")}
    selection = rating.selection or NotEstimable("nothing was selected by the answers")
    found: Json = {}
    for name, estimate in {**of_group, "selection": selection}.items():
        found |= estimate_json(name, estimate)
    return {
        **found,
        "contrast": rating.contrast,
        "span": rating.span,
        "equal_gains": rating.equal_gains,
        "gain_sd_below": rating.gain_sd_upper,
        "told": rating.untold is None,
        **({} if rating.untold is None else {"reason": rating.untold.reason}),
        "effects": {name: plain(of) for name, of in rating.effects.items()},
        "groups": [_line_json(line) for line in rating.groups],
        "differences": [_line_json(line) for line in rating.differences],
    }


def _line_json(line: GroupLine) -> Json:
    return {"name": line.name, **_estimates_json(line, "level", "gain")}


def _estimates_json(record: object, *names: str) -> Json:
    found: Json = {}
    for name in names:
        found |= estimate_json(name, getattr(record, name))
    return found


def law_json(score: LawScore) -> Json:
    """Return how a law orders the conditions and explains the ratings."""
    return {
        "law": score.law,
        **_order_json(score.order),
        "predicted": plain(score.predicted),
        "log_evidence": or_null(score.log_evidence),
        **why("log_evidence", score.log_evidence),
        "ln_bayes_factor": or_null(score.ln_bayes_factor),
        **why("ln_bayes_factor", score.ln_bayes_factor),
    }


def _order_json(order: LawOrder | NotEstimable) -> Json:
    if isinstance(order, NotEstimable):
        return {**unknown(order, "spearman", "p"), "order": [], "order_tied": []}
    known: Json = {
        "spearman": or_null(order.spearman),
        "order": list(order.order),
        "order_tied": plain(order.tied),
        "p": or_null(order.p),
    }
    if isinstance(order.spearman, NotEstimable):
        known["reason"] = order.spearman.reason
    return known
