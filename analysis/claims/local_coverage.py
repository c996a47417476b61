"""Claims about a single finger: Fig 14, Section 4.2 and the conclusions."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from analysis.claims.claim import Claims, Finding
from analysis.claims.curves import (
    MU,
    PLACES_M,
    centre,
    leftward,
    local_curve,
    local_scene,
    operating,
    rising,
    spread,
    swing,
    trough_places_m,
)
from device.beam.modes import FloatArray
from device.friction.coefficient import friction_coefficient
from device.friction.prediction import LawChoice
from device.friction.scenes import Drive, Scene

CLAIMS = Claims()


def _curves(law: str) -> list[FloatArray]:
    scenes = (local_scene(voltage_v=voltage) for voltage in (50.0, 100.0, 200.0))
    return [operating(local_curve(law, scene)) for scene in scenes]


@CLAIMS.under_each_law(
    id="swing-grows-with-voltage",
    place="Section 4.2, Fig 14a",
    claim="the variation of μ' along the beam grows with voltage",
    check="swing of μ' beyond 23.1 mm at 50, 100 and 200 V, each step above 5 %",
    expected="growing",
)
def _swing_grows(law: str) -> Finding:
    values = [swing(curve) for curve in _curves(law)]
    grows = all(b > 1.05 * a for a, b in pairwise(values))
    return Finding(parts=(grows,), computed={"swing_at_50_100_200_v": values})


@CLAIMS.under_each_law(
    id="centre-stays",
    place="Section 4.2, Fig 14a",
    claim="μ' stays centred at 0.4 at every voltage",
    check="centre of μ' beyond 23.1 mm at 50, 100 and 200 V, each within 0.02",
    expected="0.4",
)
def _centre_stays(law: str) -> Finding:
    values = [centre(curve) for curve in _curves(law)]
    return Finding(
        parts=tuple(abs(value - MU) < 0.02 for value in values),
        computed={"centre_at_50_100_200_v": values},
    )


@CLAIMS.under_each_law(
    id="swing-grows-as-frequency-falls",
    place="Section 4.2, Fig 14b",
    claim="the variation of μ' grows slightly as the frequency falls",
    check="swing of μ' falling to the resonance from 1.02, and below it to 0.98",
    expected="growing",
)
def _swing_with_falling_frequency(law: str) -> Finding:
    steps = {"above": (1.02, 1.01, 1.0), "below": (1.0, 0.99, 0.98)}
    values = {
        side: [swing(operating(local_curve(law, local_scene(detuning=d)))) for d in detunings]
        for side, detunings in steps.items()
    }
    return Finding(
        parts=tuple(rising(series) for series in values.values()),
        computed={f"{side}_resonance": series for side, series in values.items()},
    )


@CLAIMS.under_each_law(
    id="fewer-peaks-at-lower-frequency",
    place="Section 4.2, Fig 14b",
    claim="peaks and troughs become fewer as the frequency falls",
    check="troughs of μ' at the resonances of modes 6, 5 and 4, with exact mode shapes",
    expected="fewer",
    remark="200 V, as lower modes move less",
)
def _peaks_per_mode(law: str) -> Finding:
    choice = LawChoice(name=law, ratio="mode")
    counts = {
        mode: trough_places_m(
            friction_coefficient(
                replace(Scene(), drive=Drive(mode=mode, voltage_v=200.0)), law=choice, x_m=PLACES_M
            )
        ).size
        for mode in (6, 5, 4)
    }
    return Finding(
        parts=(counts[6] > counts[5] > counts[4],),
        computed={f"troughs_at_mode_{mode}": int(count) for mode, count in counts.items()},
    )


@CLAIMS.under_each_law(
    id="direction-swaps",
    place="Section 2, Section 5.2",
    claim="smooth and rough places swap when the finger turns round",
    check="correlation of μ' rightward and leftward beyond 23.1 mm below -0.5",
    expected="opposite",
)
def _directions_swap(law: str) -> Finding:
    right = local_curve(law, local_scene())
    left = local_curve(law, leftward(local_scene()))
    correlation = float(np.corrcoef(operating(right), operating(left))[0, 1])
    return Finding(parts=(correlation < -0.5,), computed={"correlation": correlation})


def _local_effects(law: str) -> dict[str, float]:
    """Return the range of μ' over each parameter in local coverage, about the paper's scene."""
    scene = Scene()
    at = local_curve(law, scene)

    def at_place(changes: Callable[[Scene], Scene]) -> float:
        return float(friction_coefficient(changes(scene), law=law)[0])

    def loaded(load_n: float) -> Callable[[Scene], Scene]:
        return lambda old: replace(old, touch=replace(old.touch, body_load_n=load_n))

    def driven(voltage_v: float) -> Callable[[Scene], Scene]:
        return lambda old: replace(old, drive=replace(old.drive, voltage_v=voltage_v))

    return {
        "place": 2 * swing(operating(at)),
        "voltage": spread([at_place(driven(voltage)) for voltage in (0.0, 100.0, 200.0)]),
        "load": spread([at_place(loaded(load)) for load in (10.0, 20.0, 30.0)]),
    }


@CLAIMS.under_each_law(
    id="place-and-voltage-lead",
    place="Abstract, Section 6",
    claim="under local coverage place and voltage matter most, pressure little",
    check="range of μ' over places, 0-200 V and 10-30 N: place and voltage each beat the load",
    expected="place and voltage",
)
def _place_and_voltage_lead(law: str) -> Finding:
    effects = _local_effects(law)
    return Finding(
        parts=(effects["place"] > effects["load"], effects["voltage"] > effects["load"]),
        computed=effects,
    )


@CLAIMS.under_each_law(
    id="pressure-weak",
    place="Abstract, Section 5.2",
    claim="the touch pressure changes μ' only a little",
    check="range of μ' over 10-30 N below a tenth of that over places",
    expected="weak",
)
def _load_is_weak(law: str) -> Finding:
    effects = _local_effects(law)
    ratio = effects["load"] / effects["place"] if effects["place"] else math.nan
    return Finding(parts=(bool(ratio < 0.1),), computed={"load_over_place": ratio})
