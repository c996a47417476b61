"""Methods behind the numbers of the report."""

from analysis.loading.exclusions import rules_in_words
from analysis.loading.missing_scores import unscored
from analysis.report.blocks import Section
from analysis.report.findings import Findings
from analysis.report.wording import SKIN
from analysis.sensitivity.integration import LEAST_EFFECTIVE
from analysis.trials.contrasts import FORCE_STEP, PLACE_STEP_M
from analysis.trials.trial_statistics import TrialStatistics
from device.friction.calibration import Calibration
from device.friction.contrasts import LAW, RUNG
from device.friction.laws import LAWS


def section(found: Findings) -> Section:
    """Return the methods in three paragraphs: data, tests and models."""
    return Section(
        name="methods",
        title="Methods",
        blocks=[_data(found), _tests(found.trials), _model(found.trials, found.origin.rig)],
    )


def _data(found: Findings) -> str:
    study, given = found.study, found.loaded.table.given
    subjects, conditions = given.any(axis=1).sum(), given.any(axis=0).sum()
    rules = rules_in_words(study.exclusions)
    names = [name for unused in unscored(found.loaded.table) for name in unused]
    without = f"; without scores: {', '.join(names)}" if names else ""
    origin = (
        "The scores are those of a published table."
        if found.published
        else "Each condition changed one parameter of the vibrating beam. Participants reported "
        "the change that they felt and, "
        + (
            "if their answer agreed with the expectation,"
            if study.rating.score_when == "agrees"
            else "whatever their answer,"
        )
        + f" scored the strength of the effect from {found.scale.in_words}."
    )
    return (
        f"{origin} {subjects} {'subject' if subjects == 1 else 'subjects'} and {conditions} "
        f"{'condition' if conditions == 1 else 'conditions'} had scores and were analysed"
        f"{without}. A subject's score for a condition is the mean over the scored trials. A score "
        "that was not given is treated as missing, not as zero, and the subject is kept. "
        f"Prespecified exclusion rules: {'; '.join(rules) or 'none'}."
    )


def _tests(trials: TrialStatistics) -> str:
    unit = "single trials" if trials.has_repeats else "one score per subject and condition"
    return (
        "Conditions were compared with Friedman's test, corrected for ties, with an exact p-value "
        "over all within-subject permutations of the scores where these could be enumerated, and "
        "otherwise a Monte Carlo one over random permutations from a fixed seed (with "
        "the Skillings–Mack test where scores were missing), and pairwise with Wilcoxon "
        "signed-rank tests, exact for up to 200 differences, with zero differences dropped and "
        "p-values corrected by Holm's method. Intraclass correlations and additive effects were "
        "estimated by least squares, with moment estimates of the variances; equality of slopes "
        "(Mandel) was tested by the extra sum of squares. The ordinal mixed model (cumulative "
        "link, random intercept per subject, maximum likelihood) was fitted to "
        f"{unit}{_BESIDE if trials.has_repeats else ''}. Carry-over and order effects were tested "
        "by within-subject F tests adjusted for condition, drift by a t test of the subjects' "
        "slopes on the place in the session, adjusted likewise."
    )


_BESIDE = (
    ", and again with a random intercept of each subject under each condition, whose standard "
    "deviation was tested by the likelihood ratio at the boundary"
)


def _calibrated(rig: Calibration) -> str:
    return f", with the rig as calibrated: {rig}" if rig.origin else ""


def _model(trials: TrialStatistics, rig: Calibration) -> str:
    laws = ("zero", "one", "two", "three", "four", "five", "six")[len(LAWS)]
    measured = int(trials.contrasts.measured.sum())
    touches = (
        f"in {measured} of {len(trials.contrasts.measured)} trials, measured force or place "
        f"replaced the planned value, in steps of {FORCE_STEP:.0%} and "
        f"{1000 * PLACE_STEP_M:g} mm; the drive was taken as read back, relative to the measured "
        "resonance"
        if measured
        else "touches were not measured, so planned or standard values were used"
    )
    return (
        f"Contrasts were predicted trial by trial from the friction model on its rung {RUNG} "
        f"under {laws} laws{_calibrated(rig)}; {touches}. "
        f"Sensitivities were estimated under the law '{LAW}' by "
        "M2, an ordinal mixed model: a latent rating, bias + gain × contrast + an effect of "
        "the condition + noise, is mapped to scores through ordered thresholds common to all "
        "subjects. A relative gain is a subject's gain less the mean gain of the subjects; "
        "the just noticeable difference (JND) is the standard deviation of the noise over the"
        " gain. M1, the simple comparison, is a linear mixed model, rating = bias + gain × "
        "contrast; M3 first models whether a change is noticed, from the answers to all "
        "trials, by a probit model with noise and criterion of each subject, and then, by M2,"
        " how noticed changes are rated. Intervals are integrated over the variance "
        "parameters instead of fixing these at their best-fitting values; a fit with fewer "
        f"than {LEAST_EFFECTIVE:.0f} effective points of this integration is withheld. {SKIN}"
    )
