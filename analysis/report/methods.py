"""The methods paragraph of the report, and what its numbers cannot tell."""

from analysis.estimates import NotEstimable
from analysis.loading.exclusions import rules_in_words
from analysis.loading.missing_scores import unscored
from analysis.loading.study_data import Loaded
from analysis.sensitivity.linear_model import LinearSensitivity
from analysis.trials.arrays import LAW
from analysis.trials.contrasts import FORCE_STEP, PLACE_STEP_M
from analysis.trials.law_comparison import (
    LawLikelihood,
    LawOrder,
    critical_correlation,
    critical_rank_correlation,
    shared_contrasts,
)
from analysis.trials.trial_statistics import TrialStatistics
from protocol.study.study import Study

_CEILING = 0.05


def methods(loaded: Loaded, study: Study, found: TrialStatistics) -> list[str]:
    """Return how the numbers were made, a paragraph each."""
    return [_data(loaded, study), _tests(found), _model(found)]


def _data(loaded: Loaded, study: Study) -> str:
    given = loaded.table.given
    subjects, conditions = int(given.any(axis=1).sum()), int(given.any(axis=0).sum())
    rules = rules_in_words(study.exclusions)
    settled = "; ".join(rules) if rules else "none"
    origin = (
        "The scores are those of a published table."
        if loaded.kinds == ("published",)
        else "Each condition was a change of one parameter of the vibrating beam; participants "
        "said what changed and, "
        + (
            "if that agreed with the expectation,"
            if study.rating.score_when == "agrees"
            else "whatever they said,"
        )
        + " scored the strength of the effect from 0 (no effect) to 10 (very effective)."
    )
    return (
        f"{origin} {subjects} {'subject' if subjects == 1 else 'subjects'} and {conditions} "
        f"{'condition' if conditions == 1 else 'conditions'} have scores and are analysed"
        f"{_unscored(loaded)}. A subject's score "
        "for a condition is the mean over the trials that have one. A score that was not given is "
        f"missing: it is no zero and drops no subject. Rules of exclusion settled beforehand: "
        f"{settled}."
    )


def _unscored(loaded: Loaded) -> str:
    subjects, conditions = unscored(loaded.table)
    names = (*subjects, *conditions)
    return f"; without any score: {', '.join(names)}" if names else ""


def _tests(found: TrialStatistics) -> str:
    unit = "single trials" if found.has_repeats else "one score per subject and condition"
    return (
        "Conditions were compared with Friedman's test corrected for ties, its exact p counting "
        "all rearrangements of each subject's own scores where that can be listed (Skillings and "
        "Mack's test where scores are missing), and pair by pair with Wilcoxon's signed rank test, "
        "exact up to 200 differences, zeros dropped, p-values corrected by Holm. Intraclass "
        "correlations and additive effects are by least squares with moment estimates of "
        "variances; equal slopes (Mandel) were tested by their extra sum of squares. The ordinal "
        "mixed model (cumulative link, random level of each subject, maximum likelihood) was "
        f"fitted to {unit}. Carry-over "
        "and order were tested by F tests within subjects, with condition allowed for."
    )


def _model(found: TrialStatistics) -> str:
    measured = int(found.contrasts.measured.sum())
    own = (
        f"for {measured} of {len(found.contrasts.measured)} trials measured force or place was "
        f"taken in place of the planned one, in steps of {FORCE_STEP:.0%} and "
        f"{1000 * PLACE_STEP_M:g} mm; the drive was taken as read back, relative to the measured "
        "resonance"
        if measured
        else "nothing was measured of the touches, so that planned or standard values were taken"
    )
    return (
        "Contrasts were predicted trial by trial from the friction model under three laws; "
        f"{own}. "
        f"Sensitivities are under the law '{LAW}'. M1 is a linear mixed model, rating = bias + "
        "gain × contrast; M2 puts it behind ordered thresholds that all subjects share, with a "
        "discrepancy of each condition; M3 adds the answers, catch and opposite trials. Intervals "
        "are integrated over the variances and not taken at their best values."
    )


def laws_line(found: TrialStatistics) -> str:
    """Return how far the laws' log-likelihoods can be read, empty where there are none."""
    if not any(isinstance(score.likelihood, LawLikelihood) for score in found.laws):
        return ""
    said = (
        "The gain in log-likelihood is not penalised for the law's three parameters more (slope, "
        "its spread, its correlation with level), so that chance alone makes it positive; beside a "
        "large p it says that any contrasts would do."
    )
    scored = found.scored
    if all(shared_contrasts(scored.ratings, x) for x in scored.contrasts.values()):
        said += (
            " All subjects have the same contrasts here, so that a law cannot say who felt what: "
            "its gain is of the conditions' means, and of subjects who follow them more or less."
        )
    return said


def limits(loaded: Loaded, found: TrialStatistics) -> list[str]:
    """Return what these data cannot tell, a sentence or two each."""
    said = []
    if not found.has_repeats:
        said.append(
            "There is one rating per subject and condition. Whether subjects differ in sensitivity "
            "cannot be told then: a subject's gain is known only by pooling with the others, and "
            "its own share shows how little of it is the subject's. With so few ratings the "
            "intervals of M1 and M2 rest largely on their priors."
        )
    if isinstance(found.m1, LinearSensitivity):
        said.append(
            "M1 takes the predicted contrast for all in which conditions differ. Whatever else "
            "sets them apart is noise to it, of single trials and not of conditions, so that its "
            "intervals are too narrow, the group's most of all; M2 allows for a discrepancy of "
            "each condition."
        )
    rated = [score.order.rated for score in found.laws if isinstance(score.order, LawOrder)]
    if rated:
        said.append(_too_few_means(rated[0]))
    ceiling = _share_at_ceiling(loaded)
    if ceiling > _CEILING:
        said.append(
            f"{ceiling:.0%} of the scores are the highest possible. M1 knows no ceiling and makes "
            "gains too small; M2 is for such ratings."
        )
    if isinstance(found.m3, NotEstimable):
        said.append(
            f"M3, change detection and rating in one model, has no answer: {found.m3.reason}."
        )
    return said


def _too_few_means(count: int) -> str:
    """What so many condition means can say of a law, by either correlation."""
    ranks, moments = critical_rank_correlation(count), critical_correlation(count)
    if isinstance(ranks, NotEstimable):
        reached = "has p < .05 in no order, not even a perfect one"
    elif ranks >= 1:
        reached = "has p < .05 only if it is 1 or −1"
    else:
        reached = f"must reach {ranks:.3f} for p < .05"
    products = (
        ""
        if isinstance(moments, NotEstimable)
        else f" (Pearson's, of the contrasts and means themselves, must exceed {moments:.3f})"
    )
    return (
        f"With {count} condition means and no ties Spearman's rank correlation, the one shown, "
        f"{reached}{products}. Most orders of the conditions are no evidence for or against a law."
    )


def _share_at_ceiling(loaded: Loaded) -> float:
    scores = [row.score for row in loaded.rows if row.is_scored and row.score == row.score]
    return sum(score >= 10 for score in scores) / len(scores) if scores else 0.0
