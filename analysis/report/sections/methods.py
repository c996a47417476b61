"""Methods and provenance of the report's numbers: versions, seeds and parameters of the model."""

import json
import platform
from collections.abc import Iterator
from hashlib import sha256
from importlib.metadata import version

import numpy as np

from analysis.estimates import NotEstimable
from analysis.loading.exclusion_rules import rules_in_words
from analysis.loading.response import IN_WORDS
from analysis.loading.study_data import StudyData, changed_journal
from analysis.report.blocks import Definitions, Section
from analysis.report.findings import Findings, Origin
from analysis.report.wording import SKIN, count_of, sentence
from analysis.sensitivity.integration import LEAST_EFFECTIVE
from analysis.sensitivity.laplace import LARGE
from analysis.sensitivity.latent_posterior import LARGE_EFFECTIVE
from analysis.statistics.detection import Detection
from analysis.statistics.factorial import Effect
from analysis.statistics.groups import Compared, GroupInteraction, GroupStatistics
from analysis.statistics.omnibus import SEED, Friedman
from analysis.statistics.signed_rank import SignedRank
from analysis.statistics.slope import LevelSlope, Slope
from analysis.statistics.summary import ConditionTests
from analysis.trials.contrasts import FORCE_STEP, PLACE_STEP_M
from device.friction.calibration import Calibration
from device.friction.changes import LAW, RUNG
from device.friction.laws import LAWS
from device.friction.scenes import REFERENCE_SPEED_M_S, REFERENCE_TIP_SPEED_M_S
from device.friction.surfaces import GivenSurface, MeasuredSurface
from protocol.errors import listed
from protocol.study.participant_texts import rating_question
from protocol.study.study import Study
from protocol.study.track import Track


def section(found: Findings) -> Section:
    """Return the methods in three paragraphs, data, tests and models, of what was done alone."""
    scored = found.loaded.table.conditions
    paragraphs = (_data(found) if scored else "", _tracks(found), _tests(found), _model(found))
    return Section(title="Methods", blocks=[each for each in paragraphs if each])


def _data(found: Findings) -> str:
    study, given = found.study, found.trials.response_tests.table.given
    people, conditions = given.any(axis=1).sum(), given.any(axis=0).sum()
    rules = rules_in_words(study.exclusions, older=found.loaded.older_rules)
    origin = (
        "The scores were imported from a table."
        if found.published
        else "In each trial participants touched the vibrating surface and scored what they felt, "
        f"from {found.scale_in_words}, asked “{rating_question(study)}”. Conditions differed in "
        f"{'the factors' if study.factors else 'the touches'}{_voltages(study)}."
        if found.at_once
        else "Each condition changed "
        + (" and ".join(found.study.factors) or "one parameter")
        + " of the vibrating surface. Participants reported "
        "the change that they felt and, "
        + {
            "agrees": "if their answer agreed with the expectation,",
            "noticed": "if they had noticed one,",
            "always": "whatever their answer,",
        }[study.rating.score_when]
        + f" scored the strength of the effect from {found.scale_in_words}."
    )
    response = (
        f"{IN_WORDS}, so that no answered trial is missing. A participant's response to a "
        "condition is the mean over the trials."
        if found.measure == "response"
        else "A participant's score for a condition is the mean over the trials."
    )
    response += _missing(found) + _without_model(found)
    return (
        f"{origin} {_design(found)}{sentence(count_of(people, 'participant'))} and "
        f"{count_of(conditions, 'condition')} were analysed. {response} "
        f"Prespecified exclusion rules: {'; '.join(rules) or 'none'}."
    )


def _voltages(study: Study) -> str:
    """Return the amplitude of each condition; nothing unless each has one of its own."""
    by_name = {
        each.name: {v for touch in each.touches for v in (touch.voltage_v, touch.end_voltage_v)}
        for each in study.condition
    }
    only = {name: f"{min(volts):g} V" for name, volts in by_name.items() if len(volts) == 1}
    if study.factors or len(set(only.values())) < len(by_name):
        return ""
    told = (volts if name == volts else f"{name} {volts}" for name, volts in only.items())
    return f" (amplitudes: {', '.join(told)})"


def _missing(found: Findings) -> str:
    """Return how many scores of an imported table are missing, in a sentence."""
    if not found.published or found.measure != "score":
        return ""
    scores = found.loaded.trials["score"]
    if not (missing := int(scores.isna().sum())):
        return ""
    return f" {missing:,} of {len(scores):,} scores are missing; means are of those given."


def _without_model(found: Findings) -> str:
    """Return how many scores the model of ratings does not take, in a sentence."""
    rating = found.sensitivity.rating
    if isinstance(rating, NotEstimable):
        return ""
    given = int(found.loaded.scored["score"].notna().sum())
    others = given - sum(person.trials for person in rating.subjects)
    if others <= 0:
        return ""
    which = "of other answers" if found.measure == "response" else "without a predicted contrast"
    return f" {sentence(count_of(others, 'score'))} {which} are not in the model of ratings."


def _design(found: Findings) -> str:
    """Return what each participant did, in a sentence; nothing of imported scores."""
    design, study = found.study.design, found.study
    if found.published:
        return ""
    crossed = " × ".join(
        count_of(len(levels), f"{name} level") for name, levels in study.factors.items()
    )
    opposite = f"({count_of(design.opposite_repeats, 'time')} in the opposite order)"
    parts = [
        f"had each condition {count_of(design.repeats, 'time')}",
        *[opposite] * bool(design.opposite_repeats),
        *[f"and {count_of(design.catch_trials, 'catch trial')} at 0 V"] * bool(design.catch_trials),
        *[f"in each of {count_of(design.sessions, 'session')}"] * (design.sessions > 1),
    ]
    factors = f" Conditions crossed {crossed}." * bool(crossed)
    groups = f" Groups: {listed(study.groups)}." * bool(study.groups)
    return f"A participant {' '.join(parts)}.{factors}{groups} "


def _tracks(found: Findings) -> str:
    """Return how thresholds were measured and estimated; nothing without any."""
    if found.thresholds is None:
        return ""
    tracks = "; ".join(map(_track, found.study.track))
    return (
        f"Thresholds were measured in {count_of(len(found.study.track), 'track')}: {tracks}. A "
        "person's threshold is the level at which the share defines it for somebody without "
        "lapses: the median of a posterior of the curve, its slope, lapses and the scatter of "
        "answers, with a 95% credible interval. That of all is the geometric mean, with the t "
        "interval of the logarithms; the mixed model takes all answers at once, with an effect of "
        "each person."
    )


def _track(track: Track) -> str:
    first, *_, last = (*sorted(track.levels.values), max(track.levels.values))
    how = f"{track.method} {track.rule}" if track.rule else track.method
    kinds = {"easy": track.easy, "catch": track.catch}
    beside = "".join(f", {count} {kind}" for kind, count in kinds.items() if count)
    return (
        f"“{track.name}” ({track.task}, {how}, {len(track.values)} levels of {track.axis} from "
        f"{first:g} to {last:g}, at most {count_of(track.trials, 'trial')}"
        f"{beside}, {track.shape} curve, at a share of {track.share:.3g})"
    )


def _tests(found: Findings) -> str:
    return " ".join(said for _, said in tests_in_words(found))


def tests_in_words(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield each analysis that was made with these data, by a name, in a sentence."""
    trials, measure = found.trials, found.measure
    yield from _of_conditions(trials.response_tests, measure)
    if found.is_predicted and isinstance(trials.slope, Slope):
        which = "random orders" if trials.slope.error else "all orders"
        yield (
            "slope",
            f"Whether {measure}s follow the predicted contrasts was tested by their common slope "
            f"over conditions, against {which} of the contrasts over the conditions.",
        )
    if found.is_predicted and isinstance(trials.level_slope, LevelSlope):
        yield (
            "level slope",
            "The common slope within conditions, over their levels, was tested by t with an error "
            "clustered by participant.",
        )
    if found.factors is not None and any(
        isinstance(each.effect, Effect) for each in found.factors.effects
    ):
        yield (
            "factors",
            "Factors were tested within participants by shuffling levels, main effects on ranks "
            "and interactions on means, and by F with Greenhouse and Geisser's correction; the "
            "larger p was taken.",
        )
    if found.groups is not None:
        yield from _of_groups(found.groups)
    if any(isinstance(each.found, Detection) for each in trials.noticed):
        yield (
            "noticed",
            "Reported changes were compared with those on catch trials by exact tests within "
            "participants, with Holm's correction over the conditions.",
        )
    if len(found.questions.p_holm) > 1:
        yield (
            "questions",
            "The p of all questions of the report were corrected by Holm's method.",
        )
    yield from _of_order(found)
    lock = found.loaded.lock
    if lock is not None and lock.registration.earlier:
        yield (
            "registration",
            f"Hypotheses that were registered with touchbeam {lock.registration.earlier} were "
            "tested on scores, as registered, as far as their tests exist.",
        )


def _of_groups(made: GroupStatistics) -> Iterator[tuple[str, str]]:
    compared = [number for number in (made.score, made.gain) if isinstance(number, Compared)]
    if compared:
        is_pair = len(compared[0].pairs) == 1
        test = "Mann and Whitney's" if is_pair else "Kruskal and Wallis'"
        yield (
            "groups",
            f"Groups were compared by the permutation distribution of {test} test, of one number "
            "per participant.",
        )
    if isinstance(made.interaction, GroupInteraction):
        yield (
            "profiles",
            "Groups' profiles over conditions were compared by permuting participants.",
        )


def _of_conditions(tests: ConditionTests, measure: str) -> Iterator[tuple[str, str]]:
    test = tests.omnibus
    if not isinstance(test, NotEstimable):
        name = "Friedman's test" if isinstance(test, Friedman) else "the Skillings–Mack test"
        p = (
            f"{test.monte_carlo.shuffles:,} random permutations within participants, seed fixed"
            if test.monte_carlo is not None
            else "all permutations within participants"
            if isinstance(test, Friedman) and not isinstance(test.p_exact, NotEstimable)
            else "the chi-square distribution"
        )
        yield (
            "friedman" if isinstance(test, Friedman) else "skillings_mack",
            f"Conditions were compared on mean {measure}s with {name}, corrected for ties, with p "
            f"from {p}.",
        )
    if any(isinstance(pair.test, SignedRank) for pair in tests.pairwise):
        yield (
            "pairwise",
            "Pairs of conditions were compared with Wilcoxon's signed-rank test, zero differences "
            "dropped, with Holm's correction; they count only where the conditions differ.",
        )


def _of_order(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield the checks of the order in which scores were given."""
    trials = found.trials
    checks = {
        "order": (trials.order_effect, "An effect of the place in the session"),
        "carry_over": (trials.carry_over, "Carry-over"),
    }
    for name, (test, what) in checks.items():
        if not isinstance(test, NotEstimable):
            yield (
                name,
                f"{what} was tested by an F test within participants, adjusted for condition.",
            )
    if not isinstance(trials.drift, NotEstimable):
        yield (
            "drift",
            "Drift was tested by a t test of the participants' slopes on the place in the session.",
        )


def _model(found: Findings) -> str:
    if not (found.is_predicted and found.loaded.table.conditions):
        return ""
    trials, rig = found.trials, found.origin.rig
    # APA style writes numbers below ten as words.
    count = ("zero", "one", "two", "three", "four", "five", "six")[len(LAWS)]
    has_laws = trials.has_laws
    laws = f" under {count} laws" if has_laws else ""
    calibrated = f", with the rig as calibrated: {rig}" if rig.origin else ""
    # Trials of tracks have no contrast of their own.
    is_rated = trials.data.trials["trial_kind"].isin(["trial", "catch"])
    touched = trials.contrasts.measured[is_rated & trials.data.trials["track"].isna()]
    measured = int(touched.sum())
    touches = (
        f"in {measured} of {len(touched)} trials, measured force or place "
        f"replaced the planned value, in steps of {FORCE_STEP:.0%} and "
        f"{1000 * PLACE_STEP_M:g} mm; the drive was taken as read back, relative to the measured "
        "resonance"
        if measured and not isinstance(rig.surface, GivenSurface)
        else "what was measured of a touch does not change them"
        if measured
        else "touches were not measured, so planned or standard values were used"
    )
    if not np.isfinite(trials.contrasts.by_law[LAW]).any():
        return ""
    models = [said for _, said in models_in_words(found)]
    if found.study.imported:
        return " ".join(["Contrasts are those that the author of the scores states.", *models])
    at_once = f", as the log friction of the last touch relative to {found.rest}"
    return " ".join(
        [
            f"Contrasts were predicted trial by trial from {found.friction_source}{laws}"
            f"{calibrated}{at_once * found.at_once}; {touches}.",
            *models,
            *[SKIN] * (bool(models) and not found.predictor[1]),
        ]
    )


def models_in_words(found: Findings) -> Iterator[tuple[str, str]]:
    """Yield each model of sensitivity that was fitted, by its name, in a sentence or two."""
    law = f" under the law '{LAW}'" if found.trials.has_laws else ""
    noticing, rating = found.sensitivity.noticing, found.sensitivity.rating
    if not isinstance(noticing, NotEstimable):
        yield (
            "noticing",
            f"Whether a change is noticed was modelled{law} from the answers to all trials, by a "
            "Bayesian probit model of the contrast with a d and a criterion of each participant, "
            "effects of the conditions, a lean towards one answer, and 2% of lapses. Intervals of "
            "this and of any other model of people's answers are credible intervals.",
        )
    if isinstance(rating, NotEstimable):
        return
    beside = ["an effect of the condition"]
    beside += ["the mean noise of those who notice such a change"] * (rating.selection is not None)
    beside += ["level and gain of the group"] * bool(rating.groups)
    beside += ["an effect of the session"] * (len(found.loaded.trials["session"].unique()) > 1)
    selected = ", but for what selection adds (normal, an SD of half that of the ratings)"
    # Large studies need fewer of the points that they are integrated with.
    large = len(found.trials.scored.ratings.given.rating) > LARGE
    least = LARGE_EFFECTIVE if large else LEAST_EFFECTIVE
    yield (
        "rating",
        f"Ratings were modelled{law} by a Bayesian ordinal mixed model: level and gain × "
        f"{found.contrast} of each participant, {listed(beside)}, and noise, in thresholds common "
        f"to all. Priors are wide{selected * (rating.selection is not None)}, and equal gains have "
        "a probability of .50. A relative gain is a participant's gain less the mean gain of all. "
        "Posteriors are Laplace approximations, integrated "
        "over the variance parameters instead of fixing these at their best-fitting values; a fit "
        f"with fewer than {least:.0f} effective points of this integration is withheld.",
    )


_KINDS = {"published": "imported"}
"""Of scores, by their name in the journal, where the page has another."""
_LIBRARIES = ("touchbeam", "numpy", "scipy", "matplotlib")


def provenance(found: Findings) -> Section:
    """Return the facts needed to reproduce the report."""
    facts = _facts(found)
    return Section(
        title="Provenance",
        blocks=[
            Definitions(entries={**facts, "scores": _KINDS.get(facts["scores"], facts["scores"])})
        ],
        data={"provenance": facts},
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
        + f"; permutations {SEED}",
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
    if study.imported:
        return {"contrasts": "the author's own, if any"}
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
