"""Claims about the perception of nine participants against the laws (Sections 5.2 and 6)."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import combinations

import numpy as np

from analysis.claims.claim import Claims, Finding, human_finding
from analysis.claims.curves import MU, along_path, mu
from analysis.claims.published_scores import (
    ALPHA,
    PUBLISHED,
    SCORES,
    in_words,
    interval_of_all,
    short,
)
from device.friction import changes
from device.friction.contrasts import predicted_contrast
from device.friction.rungs import TOP_RUNG
from device.friction.scenes import Drive, FingerContact, Scene

_ASSUMED = "the law's contrasts assume the scenes of docs/model.md: a finger of 0.5 N and 10 mm"
CLAIMS = Claims()
REFERENCE_SCENE = Scene(touch=FingerContact(finger_load_n=0.5))


@CLAIMS.add(
    place="Section 5.2",
    claim="all nine felt the beam become smoother when the signal came on",
    check="μ' with the signal on is below μ at the smooth place, and along the path: on average, "
    "and nowhere above μ",
    expected="smoother",
    remark="the paper does not say where they touched: at the smooth place alone every law "
    "predicts smoother, along the path only `coulomb` does, at any load; a finger of 0.5 N is "
    "assumed",
)
def _all_nine_smoother(law: str) -> Finding:
    curve = along_path(law, REFERENCE_SCENE, TOP_RUNG)
    place = mu(law, REFERENCE_SCENE, TOP_RUNG)
    mean, rougher = curve.mean(), np.mean(curve > MU * (1 + 1e-9))
    share = interval_of_all(len(SCORES))
    return human_finding(
        f"9 of 9 people, {in_words(share)}",
        [place < MU, mean < MU and rougher == 0],
        mu_at_smooth_place=place,
        mean_mu_along_path=mean,
        part_of_path_rougher=rougher,
        share_of_people_interval=share,
    )


@lru_cache(maxsize=8)
def _contrasts(law: str) -> dict[str, float]:
    """Return the contrast that a law predicts for each condition."""
    return {name: predicted_contrast(changes.CONDITIONS[name], law) for name in PUBLISHED.means}


def _strongest_first(values: Mapping[str, float]) -> list[str]:
    return sorted(values, key=lambda name: -values[name])


def _others(name: str) -> list[str]:
    return [other for other in PUBLISHED.means if other != name]


@CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="changing the voltage has the best effect, as μ' is most sensitive to it",
    check="people score voltage above each other condition (p < .05 after Holm's correction), and "
    "its contrast is the law's largest",
    expected="voltage first",
    remark=f"voltage has the highest mean score, but only pressure is reliably below; {_ASSUMED}",
)
def _voltage_best(law: str) -> Finding:
    contrasts, others = _contrasts(law), _others("voltage")
    return human_finding(
        PUBLISHED.compared("voltage", others),
        [PUBLISHED.above("voltage", other) for other in others],
        _strongest_first(contrasts)[0] == "voltage",
        mean_scores=PUBLISHED.means,
        p_holm=PUBLISHED.p_holm("voltage", others),
        **contrasts,
    )


@CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="changing the pressure has the weakest effect, as it hardly changes μ'",
    check="people score pressure below each other condition (p < .05 after Holm's correction), and "
    "its contrast alone is the law's smallest",
    expected="pressure last",
    remark=f"pressure has the lowest mean score, but only voltage is reliably above; {_ASSUMED}",
)
def _pressure_weakest(law: str) -> Finding:
    contrasts, others = _contrasts(law), _others("pressure")
    least = min(abs(value) for value in contrasts.values())
    tied = [name for name, value in contrasts.items() if abs(value) <= least + 1e-12]
    return human_finding(
        PUBLISHED.compared("pressure", others),
        [PUBLISHED.above(other, "pressure") for other in others],
        tied == ["pressure"],
        mean_scores=PUBLISHED.means,
        p_holm=PUBLISHED.p_holm("pressure", others),
        **contrasts,
    )


@CLAIMS.add(
    place="Section 5.2",
    claim="the model explains how strongly the conditions were felt",
    check="the law's contrasts order those pairs of conditions as people did that people tell "
    "apart (p < .05 after Holm's correction)",
    expected="the same order",
    remark="five means: of all 120 orders only the two perfect ones have p < .05, two-sided; a "
    "rank correlation of 0.9 has p = .083 and is no evidence either way; only one pair of ten "
    "decides",
)
def _ranking_follows_model(law: str) -> Finding:
    from scipy.stats import spearmanr

    contrasts, means = _contrasts(law), PUBLISHED.means
    pairs = [sorted(pair, key=lambda name: -means[name]) for pair in combinations(means, 2)]
    told = {(a, b): PUBLISHED.p_holm(a, [b])[b] for a, b in pairs}
    decided = {pair: p for pair, p in told.items() if p < ALPHA}
    scope = [contrasts[a] > contrasts[b] if (a, b) in decided else None for a, b in pairs]
    return human_finding(
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
    place="Abstract, Section 6",
    claim="voltage and ciliary structure regulate the touch most",
    check="people score both above each other condition (p < .05 after Holm's correction), and the "
    "law's two largest contrasts are theirs",
    expected="voltage and structure",
    remark=f"both have the highest mean scores, but only voltage is reliably above one of the "
    f"others, pressure; {_ASSUMED}",
)
def _structure_and_voltage_lead(law: str) -> Finding:
    contrasts, leading = _contrasts(law), ("voltage", "structure")
    others = [name for name in PUBLISHED.means if name not in leading]
    return human_finding(
        "; ".join(PUBLISHED.compared(name, others) for name in leading),
        [PUBLISHED.above(name, other) for name in leading for other in others],
        set(_strongest_first(contrasts)[:2]) == set(leading),
        p_holm={name: PUBLISHED.p_holm(name, others) for name in leading},
        **contrasts,
    )


@CLAIMS.add(
    place="Section 6",
    claim="all answers of the human factor experiment agreed with the expectations",
    check="every subject has a score in every condition; the law expects all five changes as well",
    expected="45 of 45",
    remark="an answer was scored only if it agreed, and there were no catch trials, so that "
    "agreement with the experimenter and with the beam cannot be told apart",
)
def _all_as_expected(law: str) -> Finding:
    contrasts = _contrasts(law)
    people, answers = interval_of_all(len(SCORES)), interval_of_all(SCORES.size)
    return human_finding(
        f"{(SCORES > 0).sum()} of {SCORES.size} answers; 9 of 9 people, {in_words(people)}",
        (SCORES > 0).all(),
        *(contrast > 1e-6 for contrast in contrasts.values()),
        share_of_people_interval=people,
        share_of_answers_interval_if_independent=answers,
        **contrasts,
    )


def _step(condition: str, *parts: bool | None, **computed: float | None) -> Finding:
    """Return the finding on a step of the experiment, with the people's mean score for it."""
    return human_finding(
        PUBLISHED.mean_in_words(condition),
        parts,
        **computed,
        mean_score=PUBLISHED.means[condition],
        mean_score_interval=PUBLISHED.mean_interval(condition),
    )


def _contrast_is_positive(condition: str, law: str) -> Finding:
    contrast = _contrasts(law)[condition]
    return _step(condition, contrast > 1e-6, contrast=contrast)


@CLAIMS.add(
    place="Section 5.2, step on structure",
    claim="the denser the bodies the stronger the change (none, 1.5 mm, 1 mm)",
    check="contrast from no bodies to bodies is positive; 1.5 to 1 mm is not decidable",
    expected="stronger with density",
    remark="no law has a density term, so none predicts a change from 1.5 to 1 mm; bodies of 1 mm "
    "are assumed",
)
def _density_strengthens(law: str) -> Finding:
    contrast = _contrasts(law)["structure"]
    return _step(
        "structure", contrast > 1e-6, None, none_to_bodies=contrast, **{"1.5_to_1_mm": None}
    )


@CLAIMS.add(
    place="Section 5.2, step on frequency",
    claim="the change is felt more as the drive nears resonance",
    check="growth of the modulation depth along the path from 0.98 to 1 times the resonance",
    expected="positive",
)
def _approach_strengthens(law: str) -> Finding:
    return _contrast_is_positive("frequency", law)


@CLAIMS.add(
    place="Section 5.2, step on voltage",
    claim="at a smooth place it gets smoother from 0 to 200 V",
    check="ln(μ' at 0 V / μ' at 200 V) at the smooth place",
    expected="positive",
)
def _voltage_strengthens(law: str) -> Finding:
    return _contrast_is_positive("voltage", law)


@CLAIMS.add(
    place="Section 6",
    claim="the larger the amplitude the more obvious the change",
    check="μ' at the smooth place at 0, 50, 100, 200 V: steps above 0.01, all downward",
    expected="each step felt",
    remark="a step of 0.01 is assumed to be felt, under a finger of 0.5 N; with the shape of a "
    "single mode the first step of `consistent` is upward, and the claim is partly true",
)
def _voltage_felt_at_every_step(law: str) -> Finding:
    voltages = (0.0, 50.0, 100.0, 200.0)
    scenes = [replace(REFERENCE_SCENE, drive=Drive(voltage_v=v)) for v in voltages]
    values = [mu(law, scene, TOP_RUNG) for scene in scenes]
    steps = np.diff(values)
    return human_finding(
        PUBLISHED.mean_in_words("voltage"),
        steps < -0.01,
        mu_at_0_50_100_200_v=values,
        mu_at_50_v_on_rung_mode=mu(law, scenes[1]),
        mean_score_interval=PUBLISHED.mean_interval("voltage"),
    )


@CLAIMS.add(
    place="Section 5.2, step on pressure",
    claim="at a smooth place it gets smoother as the finger presses harder",
    check="ln(μ' before / after) at 1.5 times the finger's load",
    expected="positive",
)
def _pressure_smoother(law: str) -> Finding:
    return _contrast_is_positive("pressure", law)
