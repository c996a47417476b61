"""Tests of conditions as JSON."""

from analysis.estimates import Json, NotEstimable, or_null, plain, why
from analysis.statistics.monte_carlo import MonteCarlo
from analysis.statistics.omnibus import SkillingsMack
from analysis.statistics.signed_rank import PairwiseTest
from analysis.statistics.summary import Reading


def friedman_json(reading: Reading) -> Json:
    """Return Friedman's test, or `null` and the Skillings–Mack test if scores are missing."""
    test = reading.friedman
    if isinstance(test, NotEstimable):
        return {
            **dict.fromkeys(("chi2", "df", "p", "p_exact")),
            "reason": test.reason,
            "skillings_mack": skillings_mack_json(reading.skillings_mack),
        }
    return {
        "chi2": test.chi2,
        "df": test.df,
        "p": test.p,
        "p_exact": or_null(test.p_exact),
        **why("p_exact", test.p_exact),
        **_monte_carlo_json(test.monte_carlo),
    }


def skillings_mack_json(test: SkillingsMack | NotEstimable | None) -> Json | None:
    """Return the Skillings–Mack test, or `None` if no score is missing."""
    if isinstance(test, NotEstimable):
        return {**dict.fromkeys(("statistic", "df", "p")), "reason": test.reason}
    if test is None:
        return None
    known: Json = plain(test)
    del known["monte_carlo"]
    return {**known, **_monte_carlo_json(test.monte_carlo)}


def _monte_carlo_json(found: MonteCarlo | None) -> Json:
    """Return the p of random shufflings, or nothing if there is an exact one."""
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
        nothing = dict.fromkeys(
            (
                *("statistic", "n", "n_zero", "p", "method", "p_holm"),
                *("rank_biserial", "rank_biserial_interval"),
                *("mean_difference", "mean_difference_interval"),
            )
        )
        return {**names, **nothing, "reason": pair.test.reason}
    ends = pair.test.mean_difference_interval
    return {
        **names,
        **plain(pair.test),
        "mean_difference_interval": or_null(ends),
        **why("mean_difference_interval", ends),
        "p_holm": or_null(pair.p_holm),
    }
