"""Methods and provenance of the report's numbers: versions, seeds and parameters of the model."""

import json
import platform
from hashlib import sha256
from importlib.metadata import version

from analysis.loading.study_data import StudyData, changed_journal, rules_in_words, unscored
from analysis.report.blocks import Definitions, Section
from analysis.report.findings import Findings, Origin
from analysis.report.wording import SKIN
from analysis.sensitivity.integration import LEAST_EFFECTIVE
from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.latent_posterior import LARGE_EFFECTIVE
from analysis.sensitivity.predictive_checks import SEED
from analysis.trials.contrasts import FORCE_STEP, PLACE_STEP_M
from analysis.trials.trial_statistics import TrialStatistics
from device.friction.calibration import Calibration
from device.friction.changes import LAW, RUNG
from device.friction.laws import LAWS
from device.friction.scenes import REFERENCE_SPEED_M_S, REFERENCE_TIP_SPEED_M_S
from device.friction.surfaces import BeamSurface, GivenSurface, MeasuredSurface
from protocol.errors import listed
from protocol.study.study import Study


def section(found: Findings) -> Section:
    """Return the methods in three paragraphs: data, tests and models."""
    model = [_model(found)] if found.is_predicted else []
    return Section(title="Methods", blocks=[_data(found), _tests(found.trials), *model])


def _data(found: Findings) -> str:
    study, given = found.study, found.loaded.table.given
    subjects, conditions = given.any(axis=1).sum(), given.any(axis=0).sum()
    rules = rules_in_words(study.exclusions)
    names = [name for unused in unscored(found.loaded.table) for name in unused]
    without = f"; without scores: {listed(names)}" if names else ""
    origin = (
        "The scores are those of a published table."
        if found.published
        else "Each condition changed one parameter of the vibrating surface. Participants reported "
        "the change that they felt and, "
        + {
            "agrees": "if their answer agreed with the expectation,",
            "noticed": "if they had noticed one,",
            "always": "whatever their answer,",
        }[study.rating.score_when]
        + f" scored the strength of the effect from {found.scale_in_words}."
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
        "(Mandel's F) was tested by shuffling scores and residuals within subjects, from a fixed "
        "seed, with subjects weighted by 1 / variance, and the larger p taken. The ordinal mixed "
        "model (cumulative link, random intercept per subject, maximum likelihood) was fitted to "
        f"{unit}{_BESIDE if trials.has_repeats else ''}. Carry-over and order effects were tested "
        "by within-subject F tests adjusted for condition, drift by a t test of the subjects' "
        "slopes on the place in the session, adjusted likewise."
    )


_BESIDE = (
    ", and again with a random intercept of each subject under each condition, whose standard "
    "deviation was tested by the likelihood ratio at the boundary"
)


def _model(found: Findings) -> str:
    trials, rig = found.trials, found.origin.rig
    # APA style writes numbers below ten as words.
    count = ("zero", "one", "two", "three", "four", "five", "six")[len(LAWS)]
    has_laws = isinstance(rig.surface, BeamSurface)
    laws, law = (f" under {count} laws", f" under the law '{LAW}'") if has_laws else ("", "")
    calibrated = f", with the rig as calibrated: {rig}" if rig.origin else ""
    # Trials of tracks have no contrast of their own.
    touched = trials.contrasts.measured[trials.data.trials["track"].isna()]
    measured = int(touched.sum())
    # Large studies need fewer of the points that they are integrated with.
    large = len(trials.scored.ratings.given.rating) > LARGE
    least = LARGE_EFFECTIVE if large else LEAST_EFFECTIVE
    touches = (
        f"in {measured} of {len(touched)} trials, measured force or place "
        f"replaced the planned value, in steps of {FORCE_STEP:.0%} and "
        f"{1000 * PLACE_STEP_M:g} mm; the drive was taken as read back, relative to the measured "
        "resonance"
        if measured
        else "touches were not measured, so planned or standard values were used"
    )
    return (
        f"Contrasts were predicted trial by trial from {found.friction_source}{laws}"
        f"{calibrated}; {touches}. Sensitivities were estimated{law} by "
        "M2, an ordinal mixed model: a latent rating, bias + gain × contrast + an effect of "
        "the condition + noise, is mapped to scores through ordered thresholds common to all "
        "subjects. A relative gain is a subject's gain less the mean gain of the subjects; "
        "the just noticeable difference (JND) is the standard deviation of the noise over the"
        " gain, and no threshold of a psychometric function. M1, the simple comparison, is a "
        "linear mixed model, rating = bias + gain × contrast; "
        "M3 first models whether a change is noticed, from the answers to all "
        "trials, by a probit model with noise and criterion of each subject, and then, by M2,"
        " how noticed changes are rated. Intervals are integrated over the variance "
        "parameters instead of fixing these at their best-fitting values; a fit with fewer "
        f"than {least:.0f} effective points of this integration is withheld. {SKIN}"
    )


_LIBRARIES = ("touchbeam", "numpy", "scipy", "matplotlib")


def provenance(found: Findings) -> Section:
    """Return the facts needed to reproduce the report."""
    facts = _facts(found)
    return Section(
        title="Provenance", blocks=[Definitions(entries=facts)], data={"provenance": facts}
    )


def _facts(found: Findings) -> dict[str, str]:
    origin, study, recording = found.origin, found.study, found.loaded.recording
    # What was analysed rather than the journal, which has notes and times of day as well.
    trials = json.dumps(found.trial_records, ensure_ascii=False)
    design = study.study.seed if found.loaded.lock is None else "by the registration's digest"
    return {
        "command": origin.command,
        **({"journal": changed_journal(origin.broken_chains)} if origin.broken_chains else {}),
        "scores": ", ".join(found.loaded.kinds),
        "input, SHA-256 of all trials that count": sha256(trials.encode()).hexdigest(),
        "study file, SHA-256": origin.study_sha256,
        "sessions recorded under": _recorded_under(origin, found.loaded),
        "imported from": "; ".join(recording.sources) or "nothing imported",
        "versions": ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
        + f", python {platform.python_version()}",
        "versions that recorded": "; ".join(recording.versions) or "none: imported",
        "seeds": f"design {design}; sessions "
        + (", ".join(map(str, recording.seeds)) or "none")
        + f"; permutations and predictive checks {SEED}",
        "model parameters": ", ".join(
            f"{name} {value}" for name, value in _model_parameters(study, origin.rig).items()
        ),
    }


def _recorded_under(origin: Origin, loaded: StudyData) -> str:
    # The study file may have been amended between sessions.
    others = [digest for digest in loaded.recording.studies if digest != origin.study_sha256]
    if not loaded.recording.studies:
        return "no study file: imported"
    if not others:
        return "this study file"
    return "also other versions of the study file, SHA-256 " + ", ".join(others)


def _model_parameters(study: Study, rig: Calibration) -> dict[str, str]:
    finger = study.touch
    return {
        **_of_surface(study, rig),
        "finger force": f"{finger.force_n:g} N",
        "finger contact": f"{finger.contact_m:g} m",
        "sliding speed": f"{finger.sliding_speed_m_s:g} m/s",
        "smooth place": f"{finger.smooth_place_m:g} m",
        "path": f"{finger.path_m[0]:g} to {finger.path_m[1]:g} m",
    }


def _of_surface(study: Study, rig: Calibration) -> dict[str, str]:
    match rig.surface:
        case GivenSurface(length_m=length_m):
            return {"surface": f"given, {length_m:g} m long"}
        case MeasuredSurface(length_m=length_m, table=table):
            file = f"{study.surface.table}, SHA-256 {table.digest}"
            return {"surface": f"measured, {length_m:g} m long", "table of friction": file}
    beam = rig.structure.beam
    return {
        "laws": " / ".join(LAWS),
        "law for sensitivities": LAW,
        "rung": RUNG,
        "mode": str(rig.mode),
        "beam": f"{beam.length_m:g} m x {beam.width_m:g} m x {beam.thickness_m:g} m",
        **({"supports": " / ".join(beam.supports)} if study.surface.is_own_beam else {}),
        "damping ratio": f"{rig.damping_ratio:g}",
        "body height": f"{rig.body_height_m:g} m",
        **({"gain of the drive": f"{rig.gain:g}", "rig": rig.origin} if rig.origin else {}),
        "body mass": f"{rig.structure.body_mass_kg:g} kg/m",
        "friction coefficient, drive off": f"{rig.structure.friction_coefficient:g}",
        "reference tip speed": f"{REFERENCE_TIP_SPEED_M_S:.6g} m/s",
        "reference sliding speed": f"{REFERENCE_SPEED_M_S:.6g} m/s",
    }
