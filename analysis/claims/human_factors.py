"""Claims about what nine people felt and why (Section 5.2, Section 6)."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from analysis.claims.claim import Claim, Finding, without_law
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


COMPREHENSIVE = np.array([8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6])


AVERAGES = np.array([8.44, 8.89, 9.67, 8.33, 6.22])


GRAND_AVERAGE = 8.31


def _rounded(values: FloatArray, printed: FloatArray, digits: int) -> FloatArray:
    """How far values are from what is printed to so many digits."""
    return np.abs(np.round(values + 1e-9, digits) - printed)


def _averages() -> Finding:
    columns, grand = SCORES.mean(axis=0), float(SCORES.mean())
    parts = (_rounded(columns, AVERAGES, 2) < 1e-9).tolist()
    return Finding(
        parts=(*parts, abs(round(grand, 2) - GRAND_AVERAGE) < 1e-9),
        computed={"columns": columns.tolist(), "grand": grand},
    )


def _comprehensive() -> Finding:
    rows = SCORES.mean(axis=1)
    off = _rounded(rows, COMPREHENSIVE, 1)
    return Finding(parts=tuple((off < 1e-9).tolist()), computed={"rows": rows.tolist()})


def _lowest() -> Finding:
    lowest = float(SCORES.mean(axis=1).min())
    return Finding(parts=(abs(lowest - 7.2) < 0.05,), computed={"lowest": lowest})


def _highest() -> Finding:
    highest = float(SCORES.mean(axis=1).max())
    return Finding(parts=(abs(highest - 9.6) < 0.05,), computed={"highest": highest})


def _range() -> Finding:
    rows = SCORES.mean(axis=1)
    low, high = float(rows.min()), float(rows.max())
    return Finding(
        parts=(abs(low - 7) < 0.05, abs(high - 10) < 0.05),
        computed={"lowest": low, "highest": high},
    )


def _third_subject() -> Finding:
    third = SCORES[2]
    return Finding(
        parts=(
            bool(SCORES.mean(axis=1).argmin() == 2),
            bool(third[4] == 4),
            bool(np.isin(third[:4], (7, 8)).all()),
        ),
        computed={"scores": third.tolist()},
    )


TABLE4_CLAIMS = (
    Claim(
        id="table4-averages",
        place="Table 4",
        claim="the conditions' averages are 8.44, 8.89, 9.67, 8.33, 6.22, of all 8.31",
        check="recomputed from the scores, to two decimals",
        expected="8.44, 8.89, 9.67, 8.33, 6.22; 8.31",
        find=without_law(_averages),
        lawless=True,
    ),
    Claim(
        id="table4-comprehensive",
        place="Table 4",
        claim="the comprehensive scores are 8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6",
        check="row means of the scores, to one decimal",
        expected="the printed column",
        find=without_law(_comprehensive),
        lawless=True,
    ),
    Claim(
        id="table4-lowest",
        place="Section 5.2, after Table 4",
        claim="the lowest average score is 7.2",
        check="the smallest row mean",
        expected="7.2",
        find=without_law(_lowest),
        lawless=True,
    ),
    Claim(
        id="table4-highest",
        place="Section 5.2, after Table 4",
        claim="the highest average score is 9.6",
        check="the largest row mean",
        expected="9.6",
        find=without_law(_highest),
        lawless=True,
    ),
    Claim(
        id="table4-range",
        place="Section 5.2, after Table 4",
        claim="comprehensive scores range from 7 to 10",
        check="smallest and largest row mean",
        expected="7 and 10",
        find=without_law(_range),
        lawless=True,
    ),
    Claim(
        id="table4-third-subject",
        place="Section 5.2, after Table 4",
        claim="the third subject scores lowest: 4 for pressure, 7 or 8 elsewhere",
        check="the row of subject 3",
        expected="lowest mean; 4; 7 or 8",
        find=without_law(_third_subject),
        lawless=True,
    ),
)

REFERENCE_SCENE = Scene(touch=FingerContact(finger_load_n=0.5))
CONDITIONS = ("frequency", "structure", "voltage", "direction", "pressure")


@lru_cache(maxsize=8)
def _contrasts(law: str) -> dict[str, float]:
    """The contrast that a law predicts for each condition."""
    return {name: predicted_contrast(changes.CONDITIONS[name], law) for name in CONDITIONS}


def _voltage_best(law: str) -> Finding:
    contrasts, means = _contrasts(law), SCORES.mean(axis=0)
    return Finding(
        parts=(
            CONDITIONS[int(means.argmax())] == "voltage",
            max(contrasts, key=lambda name: contrasts[name]) == "voltage",
        ),
        computed={"mean_scores": dict(zip(CONDITIONS, means.tolist(), strict=True)), **contrasts},
    )


def _pressure_weakest(law: str) -> Finding:
    contrasts, means = _contrasts(law), SCORES.mean(axis=0)
    least = min(abs(value) for value in contrasts.values())
    tied = [name for name, value in contrasts.items() if abs(value) <= least + 1e-12]
    return Finding(
        parts=(CONDITIONS[int(means.argmin())] == "pressure", tied == ["pressure"]),
        computed={"mean_scores": dict(zip(CONDITIONS, means.tolist(), strict=True)), **contrasts},
    )


def _ranking(law: str) -> Finding:
    from scipy.stats import spearmanr

    contrasts = _contrasts(law)
    predicted = [contrasts[name] for name in CONDITIONS]
    rho = float(spearmanr(predicted, SCORES.mean(axis=0)).statistic)
    order = sorted(CONDITIONS, key=lambda name: -contrasts[name])
    people = [CONDITIONS[index] for index in np.argsort(-SCORES.mean(axis=0))]
    return Finding(
        # Contrasts or means that are equal are in no order.
        parts=(rho > 1 - 1e-9,),
        computed={"law_order": order, "people_order": people, "spearman": rho},
    )


def _all_nine_smoother(law: str) -> Finding:
    path = np.linspace(*changes.PATH_M, 711)
    curve = friction_coefficient(REFERENCE_SCENE, law=law, x_m=path)
    rougher = float(np.mean(curve > MU * (1 + 1e-9)))
    return Finding(
        parts=(float(curve.mean()) < MU, rougher == 0),
        computed={"mean_mu_along_path": float(curve.mean()), "part_of_path_rougher": rougher},
    )


def _contrast_is_positive(name: str, law: str) -> Finding:
    contrast = _contrasts(law)[name]
    return Finding(parts=(contrast > 1e-6,), computed={"contrast": contrast})


def _density(law: str) -> Finding:
    contrast = _contrasts(law)["structure"]
    return Finding(
        parts=(contrast > 1e-6, None), computed={"none_to_bodies": contrast, "1.5_to_1_mm": None}
    )


def _voltage_strengthens(law: str) -> Finding:
    return _contrast_is_positive("voltage", law)


def _approach_strengthens(law: str) -> Finding:
    return _contrast_is_positive("frequency", law)


def _pressure_smoother(law: str) -> Finding:
    return _contrast_is_positive("pressure", law)


def _structure_and_voltage_lead(law: str) -> Finding:
    contrasts, means = _contrasts(law), SCORES.mean(axis=0)
    people = {CONDITIONS[index] for index in np.argsort(-means)[:2]}
    model = set(sorted(contrasts, key=lambda name: -contrasts[name])[:2])
    wanted = {"structure", "voltage"}
    return Finding(parts=(people == wanted, model == wanted), computed=dict(contrasts))


def _amplitude_is_felt(law: str) -> Finding:
    voltages = (0.0, 50.0, 100.0, 200.0)
    drive = REFERENCE_SCENE.drive
    values = [
        float(
            friction_coefficient(
                replace(REFERENCE_SCENE, drive=replace(drive, voltage_v=voltage)), law=law
            )[0]
        )
        for voltage in voltages
    ]
    steps = np.diff(values)
    return Finding(
        parts=(bool((np.abs(steps) > 0.01).all()), bool((steps < 0).all())),
        computed={"mu_at_0_50_100_200_v": values},
    )


CLAIMS = (
    Claim(
        id="all-nine-smoother",
        place="Section 5.2",
        claim="all nine felt the beam become smoother when the signal came on",
        check="μ' along the path: lower than μ on average, and nowhere higher",
        expected="smoother",
        find=_all_nine_smoother,
    ),
    Claim(
        id="voltage-best",
        place="Section 5.2, after Table 4",
        claim="changing the voltage has the best effect, as μ' is most sensitive to it",
        check="voltage has the highest mean score, and the law's largest contrast",
        expected="voltage first",
        find=_voltage_best,
    ),
    Claim(
        id="pressure-weakest",
        place="Section 5.2, after Table 4",
        claim="changing the pressure has the weakest effect, as it hardly changes μ'",
        check="pressure has the lowest mean score, and alone the law's smallest contrast",
        expected="pressure last",
        find=_pressure_weakest,
    ),
    Claim(
        id="ranking-follows-model",
        place="Section 5.2",
        claim="the model explains how strongly the conditions were felt",
        check="the order of the law's contrasts against that of the mean scores",
        expected="the same order",
        find=_ranking,
        remark="five means: of all 120 orders only the two perfect ones have p < .05, two-sided; a "
        "rank correlation of 0.9 has p = .083 and is no evidence either way",
    ),
    Claim(
        id="structure-and-voltage-lead",
        place="Abstract, Section 6",
        claim="voltage and ciliary structure regulate the touch most",
        check="the two highest mean scores, and the law's two largest contrasts",
        expected="voltage and structure",
        find=_structure_and_voltage_lead,
    ),
    Claim(
        id="density-strengthens",
        place="Section 5.2, step on structure",
        claim="the denser the bodies the stronger the change (none, 1.5 mm, 1 mm)",
        check="contrast from no bodies to bodies is positive; from 1.5 to 1 mm",
        expected="stronger with density",
        find=_density,
        remark="no law here has a density term: in the dense limit 1.5 to 1 mm predicts nothing",
    ),
    Claim(
        id="approach-strengthens",
        place="Section 5.2, step on frequency",
        claim="the change is felt more as the drive nears resonance",
        check="growth of the modulation depth along the path from 0.98 to 1 times the resonance",
        expected="positive",
        find=_approach_strengthens,
    ),
    Claim(
        id="voltage-strengthens",
        place="Section 5.2, step on voltage",
        claim="at a smooth place it gets smoother from 0 to 200 V",
        check="ln(μ' at 0 V / μ' at 200 V) at the smooth place",
        expected="positive",
        find=_voltage_strengthens,
    ),
    Claim(
        id="voltage-felt-at-every-step",
        place="Section 6",
        claim="the larger the amplitude the more obvious the change",
        check="μ' at the smooth place at 0, 50, 100, 200 V: steps above 0.01, all downward",
        expected="each step felt",
        find=_amplitude_is_felt,
    ),
    Claim(
        id="pressure-smoother",
        place="Section 5.2, step on pressure",
        claim="at a smooth place it gets smoother as the finger presses harder",
        check="ln(μ' before / after) at 1.5 times the finger's load",
        expected="positive",
        find=_pressure_smoother,
    ),
)
