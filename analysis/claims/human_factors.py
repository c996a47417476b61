"""Claims about the perception of nine participants (Table 4, Sections 5.2 and 6)."""

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from analysis.claims.claim import Claims, Finding
from analysis.claims.curves import MU
from device.beam.modes import FloatArray
from device.friction import changes
from device.friction.coefficient import friction_coefficient
from device.friction.contrasts import predicted_contrast
from device.friction.scenes import FingerContact, Scene

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
"""Table 4, subjects 1 to 9 in rows."""
MEANS = SCORES.mean(axis=0)
COMPREHENSIVE = SCORES.mean(axis=1)
_LOWEST, _HIGHEST = float(COMPREHENSIVE.min()), float(COMPREHENSIVE.max())
TABLE4_CLAIMS = Claims()


def _as_printed(values: FloatArray, printed: list[float], digits: int) -> list[bool]:
    """Return which values round to the printed ones."""
    agree: list[bool] = (np.abs(np.round(values + 1e-9, digits) - printed) < 1e-9).tolist()
    return agree


@TABLE4_CLAIMS.without_law(
    id="table4-averages",
    place="Table 4",
    claim="the conditions' averages are 8.44, 8.89, 9.67, 8.33, 6.22, of all 8.31",
    check="recomputed from the scores, to two decimals",
    expected="8.44, 8.89, 9.67, 8.33, 6.22; 8.31",
)
def _averages() -> Finding:
    grand = float(SCORES.mean())
    parts = _as_printed(MEANS, [8.44, 8.89, 9.67, 8.33, 6.22], 2)
    return Finding(
        parts=(*parts, abs(round(grand, 2) - 8.31) < 1e-9),
        computed={"columns": MEANS.tolist(), "grand": grand},
    )


@TABLE4_CLAIMS.without_law(
    id="table4-comprehensive",
    place="Table 4",
    claim="the comprehensive scores are 8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6",
    check="row means of the scores, to one decimal",
    expected="the printed column",
)
def _comprehensive() -> Finding:
    printed = [8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6]
    return Finding(
        parts=tuple(_as_printed(COMPREHENSIVE, printed, 1)),
        computed={"rows": COMPREHENSIVE.tolist()},
    )


@TABLE4_CLAIMS.without_law(
    id="table4-lowest",
    place="Section 5.2, after Table 4",
    claim="the lowest average score is 7.2",
    check="the smallest row mean",
    expected="7.2",
)
def _lowest() -> Finding:
    return Finding(parts=(abs(_LOWEST - 7.2) < 0.05,), computed={"lowest": _LOWEST})


@TABLE4_CLAIMS.without_law(
    id="table4-highest",
    place="Section 5.2, after Table 4",
    claim="the highest average score is 9.6",
    check="the largest row mean",
    expected="9.6",
)
def _highest() -> Finding:
    return Finding(parts=(abs(_HIGHEST - 9.6) < 0.05,), computed={"highest": _HIGHEST})


@TABLE4_CLAIMS.without_law(
    id="table4-range",
    place="Section 5.2, after Table 4",
    claim="comprehensive scores range from 7 to 10",
    check="smallest and largest row mean",
    expected="7 and 10",
)
def _range() -> Finding:
    return Finding(
        parts=(abs(_LOWEST - 7) < 0.05, abs(_HIGHEST - 10) < 0.05),
        computed={"lowest": _LOWEST, "highest": _HIGHEST},
    )


@TABLE4_CLAIMS.without_law(
    id="table4-third-subject",
    place="Section 5.2, after Table 4",
    claim="the third subject scores lowest: 4 for pressure, 7 or 8 elsewhere",
    check="the row of subject 3",
    expected="lowest mean; 4; 7 or 8",
)
def _third_subject() -> Finding:
    third = SCORES[2]
    return Finding(
        parts=(
            bool(COMPREHENSIVE.argmin() == 2),
            bool(third[4] == 4),
            bool(np.isin(third[:4], (7, 8)).all()),
        ),
        computed={"scores": third.tolist()},
    )


CLAIMS = Claims()
REFERENCE_SCENE = Scene(touch=FingerContact(finger_load_n=0.5))


@CLAIMS.under_each_law(
    id="all-nine-smoother",
    place="Section 5.2",
    claim="all nine felt the beam become smoother when the signal came on",
    check="μ' along the path: lower than μ on average, and nowhere higher",
    expected="smoother",
)
def _all_nine_smoother(law: str) -> Finding:
    path = np.linspace(*changes.PATH_M, 711)
    curve = friction_coefficient(REFERENCE_SCENE, law=law, x_m=path)
    rougher = float(np.mean(curve > MU * (1 + 1e-9)))
    return Finding(
        parts=(float(curve.mean()) < MU, rougher == 0),
        computed={"mean_mu_along_path": float(curve.mean()), "part_of_path_rougher": rougher},
    )


CONDITIONS = ("frequency", "structure", "voltage", "direction", "pressure")


@lru_cache(maxsize=8)
def _contrasts(law: str) -> dict[str, float]:
    """Return the contrast that a law predicts for each condition."""
    return {name: predicted_contrast(changes.CONDITIONS[name], law) for name in CONDITIONS}


_MEAN_SCORES = dict(zip(CONDITIONS, MEANS.tolist(), strict=True))


def _strongest_first(values: Mapping[str, float]) -> list[str]:
    return sorted(values, key=lambda name: -values[name])


@CLAIMS.under_each_law(
    id="voltage-best",
    place="Section 5.2, after Table 4",
    claim="changing the voltage has the best effect, as μ' is most sensitive to it",
    check="voltage has the highest mean score and the law's largest contrast",
    expected="voltage first",
)
def _voltage_best(law: str) -> Finding:
    contrasts = _contrasts(law)
    return Finding(
        parts=tuple(_strongest_first(of)[0] == "voltage" for of in (_MEAN_SCORES, contrasts)),
        computed={"mean_scores": _MEAN_SCORES, **contrasts},
    )


@CLAIMS.under_each_law(
    id="pressure-weakest",
    place="Section 5.2, after Table 4",
    claim="changing the pressure has the weakest effect, as it hardly changes μ'",
    check="pressure alone has the lowest mean score and the law's smallest contrast",
    expected="pressure last",
)
def _pressure_weakest(law: str) -> Finding:
    contrasts = _contrasts(law)
    least = min(abs(value) for value in contrasts.values())
    tied = [name for name, value in contrasts.items() if abs(value) <= least + 1e-12]
    return Finding(
        parts=(_strongest_first(_MEAN_SCORES)[-1] == "pressure", tied == ["pressure"]),
        computed={"mean_scores": _MEAN_SCORES, **contrasts},
    )


@CLAIMS.under_each_law(
    id="ranking-follows-model",
    place="Section 5.2",
    claim="the model explains how strongly the conditions were felt",
    check="the order of the law's contrasts against that of the mean scores",
    expected="the same order",
    remark="five means: of all 120 orders only the two perfect ones have p < .05, two-sided; a "
    "rank correlation of 0.9 has p = .083 and is no evidence either way",
)
def _ranking(law: str) -> Finding:
    from scipy.stats import spearmanr

    contrasts = _contrasts(law)
    rho = float(spearmanr(list(contrasts.values()), MEANS).statistic)
    return Finding(
        # The rank correlation, unlike the two orders, accounts for ties.
        parts=(rho > 1 - 1e-9,),
        computed={
            "law_order": _strongest_first(contrasts),
            "people_order": _strongest_first(_MEAN_SCORES),
            "spearman": rho,
        },
    )


@CLAIMS.under_each_law(
    id="structure-and-voltage-lead",
    place="Abstract, Section 6",
    claim="voltage and ciliary structure regulate the touch most",
    check="the two highest mean scores, and the law's two largest contrasts",
    expected="voltage and structure",
)
def _structure_and_voltage_lead(law: str) -> Finding:
    contrasts = _contrasts(law)
    leading = [set(_strongest_first(of)[:2]) for of in (_MEAN_SCORES, contrasts)]
    return Finding(
        parts=tuple(names == {"structure", "voltage"} for names in leading), computed=contrasts
    )


@CLAIMS.under_each_law(
    id="density-strengthens",
    place="Section 5.2, step on structure",
    claim="the denser the bodies the stronger the change (none, 1.5 mm, 1 mm)",
    check="contrast from no bodies to bodies is positive; 1.5 to 1 mm is not decidable",
    expected="stronger with density",
    remark="no law has a density term, so none predicts a change from 1.5 to 1 mm",
)
def _density(law: str) -> Finding:
    contrast = _contrasts(law)["structure"]
    return Finding(
        parts=(contrast > 1e-6, None), computed={"none_to_bodies": contrast, "1.5_to_1_mm": None}
    )


def _contrast_is_positive(name: str, law: str) -> Finding:
    contrast = _contrasts(law)[name]
    return Finding(parts=(contrast > 1e-6,), computed={"contrast": contrast})


@CLAIMS.under_each_law(
    id="approach-strengthens",
    place="Section 5.2, step on frequency",
    claim="the change is felt more as the drive nears resonance",
    check="growth of the modulation depth along the path from 0.98 to 1 times the resonance",
    expected="positive",
)
def _approach_strengthens(law: str) -> Finding:
    return _contrast_is_positive("frequency", law)


@CLAIMS.under_each_law(
    id="voltage-strengthens",
    place="Section 5.2, step on voltage",
    claim="at a smooth place it gets smoother from 0 to 200 V",
    check="ln(μ' at 0 V / μ' at 200 V) at the smooth place",
    expected="positive",
)
def _voltage_strengthens(law: str) -> Finding:
    return _contrast_is_positive("voltage", law)


@CLAIMS.under_each_law(
    id="voltage-felt-at-every-step",
    place="Section 6",
    claim="the larger the amplitude the more obvious the change",
    check="μ' at the smooth place at 0, 50, 100, 200 V: steps above 0.01, all downward",
    expected="each step felt",
)
def _amplitude_is_felt(law: str) -> Finding:
    drives = (replace(REFERENCE_SCENE.drive, voltage_v=v) for v in (0.0, 50.0, 100.0, 200.0))
    scenes = (replace(REFERENCE_SCENE, drive=drive) for drive in drives)
    values = [float(friction_coefficient(scene, law=law)[0]) for scene in scenes]
    steps = np.diff(values)
    return Finding(
        parts=(bool((np.abs(steps) > 0.01).all()), bool((steps < 0).all())),
        computed={"mu_at_0_50_100_200_v": values},
    )


@CLAIMS.under_each_law(
    id="pressure-smoother",
    place="Section 5.2, step on pressure",
    claim="at a smooth place it gets smoother as the finger presses harder",
    check="ln(μ' before / after) at 1.5 times the finger's load",
    expected="positive",
)
def _pressure_smoother(law: str) -> Finding:
    return _contrast_is_positive("pressure", law)
