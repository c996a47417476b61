"""Claims about the perception of nine participants (Table 4, Sections 5.2 and 6)."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from analysis.claims.claim import Claims, Finding, finding
from analysis.claims.curves import MU
from analysis.estimates import BoolArray
from device.friction import changes
from device.friction.coefficient import friction_coefficient
from device.friction.contrasts import predicted_contrast
from device.friction.scenes import FingerContact, Scene

CONDITIONS = ("frequency", "structure", "voltage", "direction", "pressure")
SCORES = np.array(
    [
        [10, 8, 10, 10, 5],
        [10, 10, 10, 8, 7],
        [8, 8, 8, 7, 4],
        [10, 10, 10, 10, 8],
        [8, 8, 10, 8, 5],
        [8, 10, 10, 10, 7],
        [7, 10, 9, 8, 7],
        [7, 8, 10, 7, 8],
        [8, 8, 10, 7, 5],
    ],
    dtype=np.float64,
)
"""Table 4: subjects 1 to 9 in rows, `CONDITIONS` in columns."""
MEANS = dict(zip(CONDITIONS, SCORES.mean(axis=0).tolist(), strict=True))
COMPREHENSIVE = SCORES.mean(axis=1)
_LOWEST, _HIGHEST = COMPREHENSIVE.min(), COMPREHENSIVE.max()
TABLE4_CLAIMS = Claims()


def _as_printed(values: Iterable[float], printed: list[float], digits: int) -> BoolArray:
    """Return which values round to the printed ones."""
    return np.abs(np.round(np.array([*values]) + 1e-9, digits) - printed) < 1e-9


@TABLE4_CLAIMS.add(
    place="Table 4",
    claim="the conditions' averages are 8.44, 8.89, 9.67, 8.33, 6.22, of all 8.31",
    check="recomputed from the scores, to two decimals",
    expected="8.44, 8.89, 9.67, 8.33, 6.22; 8.31",
)
def _table4_averages() -> Finding:
    columns, grand = [*MEANS.values()], SCORES.mean()
    parts = _as_printed([*columns, grand], [8.44, 8.89, 9.67, 8.33, 6.22, 8.31], 2)
    return finding(*parts, columns=columns, grand=grand)


@TABLE4_CLAIMS.add(
    place="Table 4",
    claim="the comprehensive scores are 8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6",
    check="row means of the scores, to one decimal",
    expected="the printed column",
)
def _table4_comprehensive() -> Finding:
    printed = [8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6]
    return finding(*_as_printed(COMPREHENSIVE, printed, 1), rows=COMPREHENSIVE)


@TABLE4_CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="the lowest average score is 7.2",
    check="the smallest row mean",
    expected="7.2",
)
def _table4_lowest() -> Finding:
    return finding(abs(_LOWEST - 7.2) < 0.05, lowest=_LOWEST)


@TABLE4_CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="the highest average score is 9.6",
    check="the largest row mean",
    expected="9.6",
)
def _table4_highest() -> Finding:
    return finding(abs(_HIGHEST - 9.6) < 0.05, highest=_HIGHEST)


@TABLE4_CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="comprehensive scores range from 7 to 10",
    check="smallest and largest row mean",
    expected="7 and 10",
)
def _table4_range() -> Finding:
    return finding(
        abs(_LOWEST - 7) < 0.05, abs(_HIGHEST - 10) < 0.05, lowest=_LOWEST, highest=_HIGHEST
    )


@TABLE4_CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="the third subject scores lowest: 4 for pressure, 7 or 8 elsewhere",
    check="the row of subject 3",
    expected="lowest mean; 4; 7 or 8",
)
def _table4_third_subject() -> Finding:
    third = SCORES[2]
    elsewhere = np.isin(third[:4], (7, 8)).all()
    return finding(COMPREHENSIVE.argmin() == 2, third[4] == 4, elsewhere, scores=third)


CLAIMS = Claims()
REFERENCE_SCENE = Scene(touch=FingerContact(finger_load_n=0.5))


@CLAIMS.add(
    place="Section 5.2",
    claim="all nine felt the beam become smoother when the signal came on",
    check="μ' along the path: lower than μ on average, and nowhere higher",
    expected="smoother",
)
def _all_nine_smoother(law: str) -> Finding:
    path = np.linspace(*changes.PATH_M, 711)
    curve = friction_coefficient(REFERENCE_SCENE, law=law, x_m=path)
    mean, rougher = curve.mean(), np.mean(curve > MU * (1 + 1e-9))
    return finding(mean < MU, rougher == 0, mean_mu_along_path=mean, part_of_path_rougher=rougher)


@lru_cache(maxsize=8)
def _contrasts(law: str) -> dict[str, float]:
    """Return the contrast that a law predicts for each condition."""
    return {name: predicted_contrast(changes.CONDITIONS[name], law) for name in CONDITIONS}


def _strongest_first(values: Mapping[str, float]) -> list[str]:
    return sorted(values, key=lambda name: -values[name])


@CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="changing the voltage has the best effect, as μ' is most sensitive to it",
    check="voltage has the highest mean score and the law's largest contrast",
    expected="voltage first",
)
def _voltage_best(law: str) -> Finding:
    contrasts = _contrasts(law)
    first = [_strongest_first(of)[0] for of in (MEANS, contrasts)]
    return finding(*(name == "voltage" for name in first), mean_scores=MEANS, **contrasts)


@CLAIMS.add(
    place="Section 5.2, after Table 4",
    claim="changing the pressure has the weakest effect, as it hardly changes μ'",
    check="pressure alone has the lowest mean score and the law's smallest contrast",
    expected="pressure last",
)
def _pressure_weakest(law: str) -> Finding:
    contrasts = _contrasts(law)
    least = min(abs(value) for value in contrasts.values())
    tied = [name for name, value in contrasts.items() if abs(value) <= least + 1e-12]
    last = _strongest_first(MEANS)[-1]
    return finding(last == "pressure", tied == ["pressure"], mean_scores=MEANS, **contrasts)


@CLAIMS.add(
    place="Section 5.2",
    claim="the model explains how strongly the conditions were felt",
    check="the order of the law's contrasts against that of the mean scores",
    expected="the same order",
    remark="five means: of all 120 orders only the two perfect ones have p < .05, two-sided; a "
    "rank correlation of 0.9 has p = .083 and is no evidence either way",
)
def _ranking_follows_model(law: str) -> Finding:
    from scipy.stats import spearmanr

    contrasts = _contrasts(law)
    rho = spearmanr([*contrasts.values()], [*MEANS.values()]).statistic
    orders = {"law_order": _strongest_first(contrasts), "people_order": _strongest_first(MEANS)}
    # The rank correlation, unlike the two orders, accounts for ties.
    return finding(rho > 1 - 1e-9, **orders, spearman=rho)


@CLAIMS.add(
    place="Abstract, Section 6",
    claim="voltage and ciliary structure regulate the touch most",
    check="the two highest mean scores, and the law's two largest contrasts",
    expected="voltage and structure",
)
def _structure_and_voltage_lead(law: str) -> Finding:
    contrasts = _contrasts(law)
    leading = [set(_strongest_first(of)[:2]) for of in (MEANS, contrasts)]
    return finding(*(names == {"structure", "voltage"} for names in leading), **contrasts)


@CLAIMS.add(
    place="Section 5.2, step on structure",
    claim="the denser the bodies the stronger the change (none, 1.5 mm, 1 mm)",
    check="contrast from no bodies to bodies is positive; 1.5 to 1 mm is not decidable",
    expected="stronger with density",
    remark="no law has a density term, so none predicts a change from 1.5 to 1 mm",
)
def _density_strengthens(law: str) -> Finding:
    contrast = _contrasts(law)["structure"]
    return finding(contrast > 1e-6, None, none_to_bodies=contrast, **{"1.5_to_1_mm": None})


def _contrast_is_positive(name: str, law: str) -> Finding:
    contrast = _contrasts(law)[name]
    return finding(contrast > 1e-6, contrast=contrast)


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
)
def _voltage_felt_at_every_step(law: str) -> Finding:
    drives = (replace(REFERENCE_SCENE.drive, voltage_v=v) for v in (0.0, 50.0, 100.0, 200.0))
    scenes = (replace(REFERENCE_SCENE, drive=drive) for drive in drives)
    values = [float(friction_coefficient(scene, law=law)[0]) for scene in scenes]
    steps = np.diff(values)
    felt = (np.abs(steps) > 0.01).all()
    return finding(felt, (steps < 0).all(), mu_at_0_50_100_200_v=values)


@CLAIMS.add(
    place="Section 5.2, step on pressure",
    claim="at a smooth place it gets smoother as the finger presses harder",
    check="ln(μ' before / after) at 1.5 times the finger's load",
    expected="positive",
)
def _pressure_smoother(law: str) -> Finding:
    return _contrast_is_positive("pressure", law)
