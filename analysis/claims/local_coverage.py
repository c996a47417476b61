"""Claims about a single finger: Fig 14, Section 4.2 and the conclusions."""

import math
from itertools import pairwise

import numpy as np

from analysis.claims.claim import Claims, Finding, finding
from analysis.claims.curves import (
    MU,
    PLACES_M,
    centre,
    falling,
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
from device.friction.scenes import Drive, FingerContact, Scene

CLAIMS = Claims()


def _curves(law: str) -> list[FloatArray]:
    scenes = (local_scene(voltage_v=voltage) for voltage in (50.0, 100.0, 200.0))
    return [operating(local_curve(law, scene)) for scene in scenes]


@CLAIMS.add(
    place="Section 4.2, Fig 14a",
    claim="the variation of μ' along the beam grows with voltage",
    check="swing of μ' beyond 23.1 mm at 50, 100 and 200 V, each step above 5 %",
    expected="growing",
)
def _swing_grows_with_voltage(law: str) -> Finding:
    values = [swing(curve) for curve in _curves(law)]
    grows = all(b > 1.05 * a for a, b in pairwise(values))
    return finding(grows, swing_at_50_100_200_v=values)


@CLAIMS.add(
    place="Section 4.2, Fig 14a",
    claim="μ' stays centred at 0.4 at every voltage",
    check="centre of μ' beyond 23.1 mm at 50, 100 and 200 V, each within 0.02",
    expected="0.4",
)
def _centre_stays(law: str) -> Finding:
    values = [centre(curve) for curve in _curves(law)]
    return finding(*(abs(value - MU) < 0.02 for value in values), centre_at_50_100_200_v=values)


@CLAIMS.add(
    place="Section 4.2, Fig 14b",
    claim="the variation of μ' grows slightly as the frequency falls",
    check="swing of μ' falling to the resonance from 1.02, and below it to 0.98",
    expected="growing",
)
def _swing_grows_as_frequency_falls(law: str) -> Finding:
    steps = {"above": (1.02, 1.01, 1.0), "below": (1.0, 0.99, 0.98)}
    values = {
        f"{side}_resonance": [
            swing(operating(local_curve(law, local_scene(detuning=d)))) for d in detunings
        ]
        for side, detunings in steps.items()
    }
    return finding(*map(rising, values.values()), **values)


@CLAIMS.add(
    place="Section 4.2, Fig 14b",
    claim="peaks and troughs become fewer as the frequency falls",
    check="troughs of μ' at the resonances of modes 6, 5 and 4, with exact mode shapes",
    expected="fewer",
    remark="200 V, as lower modes move less",
)
def _fewer_peaks_at_lower_frequency(law: str) -> Finding:
    choice = LawChoice(name=law, ratio="mode")
    counts = {}
    for mode in (6, 5, 4):
        scene = Scene(drive=Drive(mode=mode, voltage_v=200.0))
        curve = friction_coefficient(scene, law=choice, x_m=PLACES_M)
        counts[f"troughs_at_mode_{mode}"] = trough_places_m(curve).size
    return finding(falling([*counts.values()]), **counts)


@CLAIMS.add(
    place="Section 2, Section 5.2",
    claim="smooth and rough places swap when the finger turns round",
    check="correlation of μ' rightward and leftward beyond 23.1 mm below -0.5",
    expected="opposite",
)
def _direction_swaps(law: str) -> Finding:
    right = local_curve(law, local_scene())
    left = local_curve(law, leftward(local_scene()))
    correlation = float(np.corrcoef(operating(right), operating(left))[0, 1])
    return finding(correlation < -0.5, correlation=correlation)


def _local_effects(law: str) -> dict[str, float]:
    """Return the range of μ' over each parameter in local coverage, about the paper's scene."""
    driven = [Scene(drive=Drive(voltage_v=voltage)) for voltage in (0.0, 100.0, 200.0)]
    loaded = [Scene(touch=FingerContact(body_load_n=load)) for load in (10.0, 20.0, 30.0)]

    def over(scenes: list[Scene]) -> float:
        return spread([float(friction_coefficient(scene, law=law)[0]) for scene in scenes])

    place = 2 * swing(operating(local_curve(law, Scene())))
    return {"place": place, "voltage": over(driven), "load": over(loaded)}


@CLAIMS.add(
    place="Abstract, Section 6",
    claim="under local coverage place and voltage matter most, pressure little",
    check="range of μ' over places, 0-200 V and 10-30 N: place and voltage each beat the load",
    expected="place and voltage",
)
def _place_and_voltage_lead(law: str) -> Finding:
    effects = _local_effects(law)
    beaten = (effects[name] > effects["load"] for name in ("place", "voltage"))
    return finding(*beaten, **effects)


@CLAIMS.add(
    place="Abstract, Section 5.2",
    claim="the touch pressure changes μ' only a little",
    check="range of μ' over 10-30 N below a tenth of that over places",
    expected="weak",
)
def _pressure_weak(law: str) -> Finding:
    effects = _local_effects(law)
    ratio = effects["load"] / effects["place"] if effects["place"] else math.nan
    return finding(ratio < 0.1, load_over_place=ratio)
