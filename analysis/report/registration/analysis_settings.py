"""The settings of the analysis that a registration fixes beside the study file."""

from analysis.sensitivity.integration import LEAST_EFFECTIVE
from analysis.statistics.monte_carlo import LEAST_SHUFFLES, MOST_SHUFFLES
from analysis.statistics.monte_carlo import SEED as SHUFFLED_BY
from analysis.statistics.signed_rank import LARGEST_EXACT, LEVEL
from analysis.trials.contrasts import FORCE_STEP, FREQUENCY_DIGITS, PLACE_STEP_M


def analysis_settings(least: float = 0) -> dict[str, str | float]:
    """Return what this version's tests and estimates depend on, by name.

    Every value is a text or a number, so that a registration can hold it. `least` is the lowest
    score of the scale; where it is 0 the words stay, since a registration's digest depends on them.
    """
    zero = "as zero" if least == 0 else "as the lowest score of the scale"
    lowest = "as the lowest score" if least == 0 else "as the lowest score given"
    return {
        "significance level": LEVEL,
        "omnibus test": "Friedman, corrected for ties; exact by enumeration, else Monte Carlo; "
        "Skillings–Mack where scores are missing",
        "pairwise test": "Wilcoxon signed rank, two-sided, zeros dropped",
        "correction of pairwise tests": "Holm, over all pairs",
        "differences tested exactly": LARGEST_EXACT,
        "permutations, fewest": LEAST_SHUFFLES,
        "permutations, most": MOST_SHUFFLES,
        "permutations, seed": SHUFFLED_BY,
        "score of a condition": "mean over a participant's scored trials",
        "withheld scores": f"missing; beside it read {zero} and {lowest}",
        "sensitivity model": "M2, ordinal mixed model, integrated over its variances",
        "effective points of the integration, fewest": LEAST_EFFECTIVE,
        "measured force, step relative to the planned one": FORCE_STEP,
        "measured place, step in m": PLACE_STEP_M,
        "measured frequency, digits relative to the resonance": FREQUENCY_DIGITS,
    }
