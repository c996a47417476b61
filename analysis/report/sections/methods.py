"""How the numbers of the report were made."""

from analysis.loading.exclusions import rules_in_words
from analysis.loading.missing_scores import unscored
from analysis.loading.study_data import StudyData
from analysis.report.findings import Findings
from analysis.report.section import Section
from analysis.trials.arrays import LAW
from analysis.trials.contrasts import FORCE_STEP, PLACE_STEP_M
from analysis.trials.trial_statistics import TrialStatistics


def section(found: Findings) -> Section:
    """Return the methods, a paragraph each."""
    return Section(
        name="methods",
        title="Methods",
        blocks=[_data(found), _tests(found.trials), _model(found.trials)],
    )


def _data(found: Findings) -> str:
    loaded, study = found.loaded, found.study
    given = loaded.table.given
    subjects, conditions = int(given.any(axis=1).sum()), int(given.any(axis=0).sum())
    rules = rules_in_words(study.exclusions)
    settled = "; ".join(rules) if rules else "none"
    origin = (
        "The scores are those of a published table."
        if found.published
        else "Each condition was a change of one parameter of the vibrating beam; participants "
        "said what changed and, "
        + (
            "if that agreed with the expectation,"
            if study.rating.score_when == "agrees"
            else "whatever they said,"
        )
        + f" scored the strength of the effect from {found.scale.in_words}."
    )
    return (
        f"{origin} {subjects} {'subject' if subjects == 1 else 'subjects'} and {conditions} "
        f"{'condition' if conditions == 1 else 'conditions'} have scores and are analysed"
        f"{_unscored(loaded)}. A subject's score "
        "for a condition is the mean over the trials that have one. A score that was not given is "
        f"missing: it is no zero and drops no subject. Rules of exclusion settled beforehand: "
        f"{settled}."
    )


def _unscored(loaded: StudyData) -> str:
    subjects, conditions = unscored(loaded.table)
    names = (*subjects, *conditions)
    return f"; without any score: {', '.join(names)}" if names else ""


def _tests(trials: TrialStatistics) -> str:
    unit = "single trials" if trials.has_repeats else "one score per subject and condition"
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


def _model(trials: TrialStatistics) -> str:
    measured = int(trials.contrasts.measured.sum())
    own = (
        f"for {measured} of {len(trials.contrasts.measured)} trials measured force or place was "
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
