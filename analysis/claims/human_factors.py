"""Claims about the perception of nine participants against the laws (Sections 5.2 and 6)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations

import numpy as np
from scipy.special import chdtri, fdtrc, fdtri, stdtrit

from analysis.claims import published_scores
from analysis.claims.claim import Outcome, PaperClaims, human_outcome
from analysis.claims.coverage import MU, along_path, mu
from analysis.claims.published_scores import PUBLISHED, SCORES, in_words, interval_of_all, short
from analysis.estimates import LEVEL, LOWER, UPPER, FloatArray, Interval
from analysis.sensitivity.lines import SMALL_SPREAD, Ratings
from analysis.sensitivity.ordinal_model import OrdinalSensitivity, ordinal_sensitivity
from device.friction.changes import CONDITIONS, predicted_contrast
from device.friction.rungs import TOP_RUNG
from device.friction.scenes import Drive, FingerContact, Scene
from protocol.errors import page

# Claims about single participants: their scores and the sensitivity of their skin.

_POWER = 0.8
CLAIMS = PaperClaims()


@dataclass(frozen=True, kw_only=True)
class GainSpread:
    """Subjects' gains on one value per condition, and how much they can be said to differ.

    `f` is the F test of equal gains, with `df` and `p`; `sd_interval` the 95% interval of the SD of
    gains between subjects, and `detectable_sd` the SD that the test finds with a power of .8.
    """

    f: float
    df: tuple[int, int]
    p: float
    mean: float
    sd_interval: Interval
    detectable_sd: float

    @property
    def differ(self) -> bool | None:
        """Whether gains differ, None where the scores leave it open.

        They do if the interval of their standard deviation excludes 0, and do not if it excludes
        all but a small part of the mean gain.
        """
        low, high = self.sd_interval
        if low > 0:
            return True
        return False if high < SMALL_SPREAD * abs(self.mean) else None


def gain_spread(scores: FloatArray, x: FloatArray) -> GainSpread:
    """Return the spread of subjects' gains, given effects of subjects and of conditions.

    Let S be the sum of squares of the slopes on x of the residuals of rows and columns, and
    Q = Σ(x - x̄)². With gains of standard deviation τ between subjects and residuals of variance σ²,
    F is (1 + τ²Q/σ²) times a variable of the F distribution, which gives the power. The limits of
    τ² are S(1 - q/F)/(Qc), with q and c the same quantile of F and of chi-square, and 0 below that
    (Williams, Biometrika 49, 1962). Gains and residuals are taken as normal, and everybody's
    residuals to scatter alike.

    `scores` has shape (subjects, conditions), none missing; `x` has shape (conditions,), a
    predicted contrast or an effect, not all equal.
    """
    centred = x - x.mean()
    information = float(centred @ centred)
    # Without effects of subjects and of conditions, slopes are deviations from the common slope.
    residuals = scores - scores.mean(axis=0) - scores.mean(axis=1)[:, None] + scores.mean()
    squares = float(((residuals @ centred) ** 2).sum() / information)
    subjects, conditions = scores.shape
    df = (subjects - 1, (subjects - 1) * (conditions - 2))
    variance = (float((residuals**2).sum()) - squares) / df[1]
    f = squares / df[0] / variance

    def limit(probability: float) -> float:
        part = squares * (1 - float(fdtri(*df, probability)) / f)
        return float(np.sqrt(max(0.0, part / information / chdtri(df[0], 1 - probability))))

    # F needs to exceed its critical value with a probability of .8; solved for τ²Q/σ².
    detectable = float(fdtri(*df, 1 - LEVEL) / fdtri(*df, 1 - _POWER)) - 1
    return GainSpread(
        f=f,
        df=df,
        p=float(fdtrc(*df, f)),
        mean=float(scores.mean(axis=0) @ centred / information),
        sd_interval=(limit(UPPER), limit(LOWER)),
        detectable_sd=float(np.sqrt(detectable * variance / information)),
    )


def _sensitivity_model(contrasts: FloatArray) -> OrdinalSensitivity:
    """Return M2, the report's own model of individual sensitivity, of the published scores."""
    # M2 takes a row per score.
    subject, condition = np.indices(SCORES.shape)
    fit = ordinal_sensitivity(
        Ratings(
            subjects=PUBLISHED.table.subjects,
            conditions=PUBLISHED.table.conditions,
            subject=subject.ravel(),
            condition=condition.ravel(),
            contrast=np.broadcast_to(contrasts, SCORES.shape).ravel(),
            rating=SCORES.ravel(),
        )
    )
    assert isinstance(fit, OrdinalSensitivity)
    return fit


@CLAIMS.add(
    "Section 5.2, after Table 4",
    "people differ in the sensitivity of their skin receptors",
    "a difference",
    check="gains of subjects (score per contrast): true if the 95% interval of their SD excludes "
    "0, false if it excludes all above a quarter of the mean gain",
    remark="Table 4 can tell that people differ in the level of their scores, which may be their "
    "use of the scale; with one score per person and condition it cannot tell whether gains differ "
    "or are alike, nor one person's gain from the others'",
)
def _receptor_sensitivity_differs(law: str) -> Outcome:
    contrasts = np.array([*_contrasts(law).values()])
    found = gain_spread(SCORES, contrasts)
    lines = _sensitivity_model(contrasts).lines
    apart = [
        line.subject
        for line in lines.subjects
        if line.relative_gain_interval[0] > 0 or line.relative_gain_interval[1] < 0
    ]
    subjects, conditions = SCORES.shape
    between = conditions * PUBLISHED.subject_means.var(ddof=1)
    levels_f = float(between / PUBLISHED.effects.residual_sd**2)
    levels_p = float(fdtrc(subjects - 1, (subjects - 1) * (conditions - 1), levels_f))
    # On the conditions' own effects the mean gain is 1, whatever the law.
    free = gain_spread(SCORES, SCORES.mean(axis=0))
    low, high = free.sd_interval
    return human_outcome(
        f"equal gains: F({free.df[0]}, {free.df[1]}) = {free.f:.2f}, p = {short(free.p)}; "
        f"their SD is {100 * low:.0f} to {100 * high:.0f}% of the mean gain (95% CI), and "
        f"{100 * free.detectable_sd:.0f}% is found with a power of {_POWER}",
        found.differ,
        gains=found,
        gains_on_condition_effects=free,
        m2_gain_sd=lines.gain_sd,
        m2_gain_sd_interval=lines.gain_sd_interval,
        m2_equal_gains=lines.equal_gains,
        m2_subjects_with_another_gain=apart,
        levels_f=levels_f,
        levels_p=levels_p,
    )


@CLAIMS.add(
    "Section 5.2, after Table 4",
    "the third subject scores lowest: 4 for pressure, 7 or 8 elsewhere",
    "lowest mean; 4; 7 or 8",
)
def _table4_third_subject() -> Outcome:
    third = SCORES[2]
    elsewhere = np.isin(third[:4], (7, 8)).all()
    lowest = PUBLISHED.subject_means.argmin() == 2
    return published_scores.about_subjects([2], lowest, third[4] == 4, elsewhere, scores=third)


def prediction_interval(others: FloatArray) -> Interval:
    """Return the 95% interval of one more value, as far as the others are normal."""
    # One more value scatters as the others do, and their mean is uncertain, too.
    spread = others.std(ddof=1) * np.sqrt(1 + 1 / others.size)
    half = float(stdtrit(others.size - 1, UPPER) * spread)
    return float(others.mean()) - half, float(others.mean()) + half


@CLAIMS.add(
    "Section 5.2, after Table 4",
    "elsewhere the third subject's 7 or 8 points are about the scores given by others",
    "within",
    remark="the four scores are 0.5 to 1.9 below the others' means; 'about' is taken to be within "
    "the scatter between people",
)
def _third_subject_like_others() -> Outcome:
    """Each of the four scores lies in the 95% prediction interval of the other eight."""
    others = np.delete(SCORES, 2, axis=0)
    own, intervals, inside, outside = SCORES[2][:4], {}, [], []
    for name, score, column in zip(PUBLISHED.means, own, others.T, strict=False):
        low, high = intervals[name] = prediction_interval(column)
        inside.append(low <= score <= high)
        if not inside[-1]:
            outside.append(f"{name} {score:.0f}, others {low:.1f} to {high:.1f}")
    return human_outcome(
        "outside the 95% prediction interval: " + ("; ".join(outside) or "none"),
        inside,
        below_others=others.mean(axis=0)[:4] - own,
        prediction_intervals=intervals,
    )


_ASSUMED = "the law's contrasts assume a finger of 0.5 N and 10 mm, the scenes of " + page(
    "Friction model"
)
REFERENCE_SCENE = Scene(touch=FingerContact(finger_load_n=0.5))


@CLAIMS.add(
    "Section 5.2",
    "all nine felt the beam become smoother when the signal came on",
    "smoother",
    check="μ' with the signal on is below μ at the smooth place, and along the path: on average, "
    "and nowhere above μ",
    remark="the paper does not say where they touched: at the smooth place alone every law "
    "predicts smoother, along the path only `coulomb` does, at any load; a finger of 0.5 N is "
    "assumed",
)
def _all_nine_smoother(law: str) -> Outcome:
    curve = along_path(law, REFERENCE_SCENE, TOP_RUNG)
    place = mu(law, REFERENCE_SCENE, TOP_RUNG)
    mean, rougher = curve.mean(), np.mean(curve > MU * (1 + 1e-9))
    share = interval_of_all(len(SCORES))
    return human_outcome(
        f"9 of 9 people, {in_words(share)}",
        # Where they touched is not told: either reading could be meant.
        [place < MU, mean < MU and rougher == 0],
        mu_at_smooth_place=place,
        mean_mu_along_path=mean,
        part_of_path_rougher=rougher,
        share_of_people_interval=share,
    )


@lru_cache(maxsize=8)
def _contrasts(law: str) -> dict[str, float]:
    return {name: predicted_contrast(CONDITIONS[name], law) for name in PUBLISHED.means}


def _strongest_first(values: Mapping[str, float]) -> list[str]:
    return sorted(values, key=lambda name: -values[name])


def _others(name: str) -> list[str]:
    return [other for other in PUBLISHED.means if other != name]


@CLAIMS.add(
    "Section 5.2, after Table 4",
    "changing the voltage has the best effect, as μ' is most sensitive to it",
    "voltage first",
    check="people score voltage above each other condition (p < .05 after Holm's correction), and "
    "its contrast is the law's largest",
    remark=f"voltage has the highest mean score, but only pressure is reliably below; {_ASSUMED}",
)
def _voltage_best(law: str) -> Outcome:
    contrasts, others = _contrasts(law), _others("voltage")
    return human_outcome(
        PUBLISHED.compared("voltage", others),
        [PUBLISHED.above("voltage", other) for other in others],
        _strongest_first(contrasts)[0] == "voltage",
        mean_scores=PUBLISHED.means,
        p_holm=PUBLISHED.p_holm("voltage", others),
        **contrasts,
    )


@CLAIMS.add(
    "Section 5.2, after Table 4",
    "changing the pressure has the weakest effect, as it hardly changes μ'",
    "pressure last",
    check="people score pressure below each other condition (p < .05 after Holm's correction), and "
    "its contrast alone is the law's smallest",
    remark=f"pressure has the lowest mean score, but only voltage is reliably above; {_ASSUMED}",
)
def _pressure_weakest(law: str) -> Outcome:
    contrasts, others = _contrasts(law), _others("pressure")
    least = min(abs(value) for value in contrasts.values())
    # A law that ties pressure with another condition does not single it out.
    tied = [name for name, value in contrasts.items() if abs(value) <= least + 1e-12]
    return human_outcome(
        PUBLISHED.compared("pressure", others),
        [PUBLISHED.above(other, "pressure") for other in others],
        tied == ["pressure"],
        mean_scores=PUBLISHED.means,
        p_holm=PUBLISHED.p_holm("pressure", others),
        **contrasts,
    )


@CLAIMS.add(
    "Section 5.2",
    "the model explains how strongly the conditions were felt",
    "the same order",
    check="the law's contrasts order those pairs of conditions as people did that people tell "
    "apart (p < .05 after Holm's correction)",
    remark="five means: of all 120 orders only the two perfect ones have p < .05, two-sided; a "
    "rank correlation of 0.9 has p = .083 and is no evidence either way; only one pair of ten "
    "decides",
)
def _ranking_follows_model(law: str) -> Outcome:
    from scipy.stats import spearmanr

    contrasts, means = _contrasts(law), PUBLISHED.means
    # The condition with the higher mean first, so that the law has to put it first as well.
    pairs = [sorted(pair, key=lambda name: -means[name]) for pair in combinations(means, 2)]
    told = {(a, b): PUBLISHED.p_holm(a, [b])[b] for a, b in pairs}
    decided = {pair: p for pair, p in told.items() if p < LEVEL}
    scope = [contrasts[a] > contrasts[b] if (a, b) in decided else None for a, b in pairs]
    return human_outcome(
        "pairs told apart: "
        + ", ".join(f"{a} > {b}, Holm p {short(p)}" for (a, b), p in decided.items()),
        scope,
        law_order=_strongest_first(contrasts),
        people_order=_strongest_first(means),
        # The rank correlation, unlike the two orders, accounts for ties.
        spearman=spearmanr([*contrasts.values()], [*means.values()]).statistic,
        p_holm={f"{a}-{b}": p for (a, b), p in told.items()},
    )


@CLAIMS.add(
    "Abstract, Section 6",
    "voltage and ciliary structure regulate the touch most",
    "voltage and structure",
    check="people score both above each other condition (p < .05 after Holm's correction), and the "
    "law's two largest contrasts are theirs",
    remark=f"both have the highest mean scores, but only voltage is reliably above one of the "
    f"others, pressure; {_ASSUMED}",
)
def _structure_and_voltage_lead(law: str) -> Outcome:
    contrasts, leading = _contrasts(law), ("voltage", "structure")
    others = [name for name in PUBLISHED.means if name not in leading]
    return human_outcome(
        "; ".join(PUBLISHED.compared(name, others) for name in leading),
        [PUBLISHED.above(name, other) for name in leading for other in others],
        set(_strongest_first(contrasts)[:2]) == set(leading),
        p_holm={name: PUBLISHED.p_holm(name, others) for name in leading},
        **contrasts,
    )


@CLAIMS.add(
    "Section 6",
    "all answers of the human factor experiment agreed with the expectations",
    "45 of 45",
    remark="an answer was scored only if it agreed, and there were no catch trials, so that "
    "agreement with the experimenter and with the beam cannot be told apart",
)
def _all_as_expected(law: str) -> Outcome:
    """Every subject has a score in every condition; the law expects all five changes as well."""
    contrasts = _contrasts(law)
    people, answers = interval_of_all(len(SCORES)), interval_of_all(SCORES.size)
    return human_outcome(
        f"{(SCORES > 0).sum()} of {SCORES.size} answers; 9 of 9 people, {in_words(people)}",
        (SCORES > 0).all(),
        # Above rounding error: a law without any change expects none.
        *(contrast > 1e-6 for contrast in contrasts.values()),
        share_of_people_interval=people,
        share_of_answers_interval_if_independent=answers,
        **contrasts,
    )


def _step(condition: str, *parts: bool | None, **computed: float | None) -> Outcome:
    """Return the outcome on a step of the experiment, with the people's mean score for it."""
    return human_outcome(
        PUBLISHED.mean_in_words(condition),
        parts,
        **computed,
        mean_score=PUBLISHED.means[condition],
        mean_score_interval=PUBLISHED.mean_interval(condition),
    )


def _contrast_is_positive(condition: str, law: str) -> Outcome:
    contrast = _contrasts(law)[condition]
    return _step(condition, contrast > 1e-6, contrast=contrast)


@CLAIMS.add(
    "Section 5.2, step on structure",
    "the denser the bodies the stronger the change (none, 1.5 mm, 1 mm)",
    "stronger with density",
    remark="no law has a density term, so none predicts a change from 1.5 to 1 mm; bodies of 1 mm "
    "are assumed",
)
def _density_strengthens(law: str) -> Outcome:
    """Contrast from no bodies to bodies is positive; 1.5 to 1 mm is not decidable."""
    contrast = _contrasts(law)["structure"]
    return _step(
        "structure", contrast > 1e-6, None, none_to_bodies=contrast, **{"1.5_to_1_mm": None}
    )


@CLAIMS.add(
    "Section 5.2, step on frequency",
    "the change is felt more as the drive nears resonance",
    "positive",
)
def _approach_strengthens(law: str) -> Outcome:
    """Growth of the modulation depth along the path from 0.98 to 1 times the resonance."""
    return _contrast_is_positive("frequency", law)


@CLAIMS.add(
    "Section 5.2, step on voltage", "at a smooth place it gets smoother from 0 to 200 V", "positive"
)
def _voltage_strengthens(law: str) -> Outcome:
    """ln(μ' at 0 V / μ' at 200 V) at the smooth place."""
    return _contrast_is_positive("voltage", law)


@CLAIMS.add(
    "Section 6",
    "the larger the amplitude the more obvious the change",
    "each step felt",
    remark="a step of 0.01 is assumed to be felt, under a finger of 0.5 N; with the shape of a "
    "single mode the first step of `consistent` is upward, and the claim is partly true",
)
def _voltage_felt_at_every_step(law: str) -> Outcome:
    """μ' at the smooth place at 0, 50, 100, 200 V: steps above 0.01, all downward."""
    scenes = [replace(REFERENCE_SCENE, drive=Drive(voltage_v=v)) for v in (0.0, 50.0, 100.0, 200.0)]
    values = [mu(law, scene, TOP_RUNG) for scene in scenes]
    steps = np.diff(values)
    return human_outcome(
        PUBLISHED.mean_in_words("voltage"),
        steps < -0.01,
        mu_at_0_50_100_200_v=values,
        mu_at_50_v_on_rung_mode=mu(law, scenes[1]),
        mean_score_interval=PUBLISHED.mean_interval("voltage"),
    )


@CLAIMS.add(
    "Section 5.2, step on pressure",
    "at a smooth place it gets smoother as the finger presses harder",
    "positive",
)
def _pressure_smoother(law: str) -> Outcome:
    """ln(μ' before / after) at 1.5 times the finger's load."""
    return _contrast_is_positive("pressure", law)
