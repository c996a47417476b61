"""Claims about the device's parameters and their effects: Tables 1 to 3, Figs 8, 13 and 14."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from analysis.claims.claim import Claim, Finding, without_law
from analysis.claims.curves import (
    MU,
    PLACES_M,
    centre,
    full_coverage,
    leftward,
    local_curve,
    local_scene,
    operating,
    swing,
    trough_places_m,
)
from device.beam import Beam, Patches
from device.friction import friction_coefficient
from device.prediction import LawChoice
from device.response import modal_force_n_per_v
from device.rungs import TOP_RUNG, rung_resonance_hz
from device.scenes import Drive, Scene
from device.zones import zones

_RUNGS = ("mode", "euler-patched", "timoshenko", TOP_RUNG)
_FREQUENCY_HZ = 24221.0
_BEAM = Beam()


def _falling(values: Sequence[float]) -> bool:
    return all(b < a for a, b in pairwise(values))


def _near_natural(frequency_hz: float) -> Finding:
    """Whether a drive lies within the half-power bandwidth 2ζf of the nearest resonance."""
    found, parts = {}, []
    for rung in _RUNGS:
        resonances = np.array([rung_resonance_hz(rung, _BEAM, mode) for mode in range(4, 9)])
        nearest = float(resonances[np.argmin(np.abs(resonances - frequency_hz))])
        found[f"{rung}_hz"] = nearest
        parts.append(abs(frequency_hz / nearest - 1) <= _BEAM.damping_ratio)
    return Finding(parts=tuple(parts), computed=found)


def _patch_at(centre_m: float) -> Beam:
    return replace(_BEAM, patches=replace(Patches(), centre_m=centre_m))


def _from_patch_position() -> Finding:
    places = [float(place) for place in zones(6, 0.1).antinodes_m if 5e-3 <= place <= 95e-3]
    found = {
        rung: [rung_resonance_hz(rung, _patch_at(place), 6) for place in places]
        for rung in ("euler-patched", TOP_RUNG)
    }
    closest = {rung: min(abs(f - _FREQUENCY_HZ) for f in values) for rung, values in found.items()}
    return Finding(
        parts=tuple(gap < 10.0 for gap in closest.values()),
        computed={"patch_at_m": places, **found, "closest_hz": closest},
    )


def _patch_on_peak() -> Finding:
    peak = float(zones(6, 0.1).antinodes_m[-1])
    places = np.linspace(peak - 6e-3, peak + 6e-3, 121)
    forces = np.array([abs(modal_force_n_per_v(_patch_at(float(p)), 6)) for p in places])
    best = float(places[np.argmax(forces)])
    return Finding(
        parts=(abs(best - peak) < 1e-3,),
        computed={"fifth_peak_m": peak, "strongest_drive_at_m": best},
    )


def _bodies_are_light() -> Finding:
    bodies_kg = 20 * 0.01
    return Finding(
        parts=(bodies_kg < _BEAM.mass_kg,),
        computed={
            "bodies_kg": bodies_kg,
            "beam_kg": _BEAM.mass_kg,
            "ratio": bodies_kg / _BEAM.mass_kg,
        },
    )


def _beam_bears_the_load() -> Finding:
    load_n_per_m = 20 * 20.0 / _BEAM.length_m
    rigidity = _BEAM.youngs_modulus_pa * _BEAM.second_moment_m4
    deflection_m = load_n_per_m * _BEAM.length_m**4 / (8 * rigidity)
    moment = load_n_per_m * _BEAM.length_m**2 / 2
    stress_pa = moment * _BEAM.thickness_m / 2 / _BEAM.second_moment_m4
    return Finding(
        parts=(deflection_m < 1e-3, stress_pa < 350e6),
        computed={"tip_deflection_m": deflection_m, "stress_at_clamp_pa": stress_pa},
    )


def _fig8(law: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([full_coverage(law, same_direction=float(a)) for a in range(21)])


def _fig8_range(law: str) -> Finding:
    curve = _fig8(law)
    low, high = float(curve.min()), float(curve.max())
    return Finding(
        parts=(abs(low - 0.2) < 0.02, abs(high - 0.6) < 0.02),
        computed={"lowest": low, "highest": high},
    )


def _fig8_linear(law: str) -> Finding:
    curve = _fig8(law)
    steps = np.diff(curve)
    return Finding(
        parts=(bool((steps < 0).all()), bool(np.ptp(steps) < 1e-9)),
        computed={"first_step": float(steps[0]), "last_step": float(steps[-1])},
    )


def _fig8_crossing(law: str) -> Finding:
    curve = _fig8(law)
    return Finding(
        parts=(bool((curve[:10] > MU).all()), bool((curve[11:] < MU).all())),
        computed={"at_9": float(curve[9]), "at_10": float(curve[10]), "at_11": float(curve[11])},
    )


def _u_at_fixed_a(law: str) -> Finding:
    values = [full_coverage(law, same_direction=10.0, bodies=u) for u in (10, 15, 20, 30, 40)]
    return Finding(parts=(_falling(values),), computed={"mu_at_10_15_20_30_40": values})


def _u_at_fixed_ratio(law: str) -> Finding:
    values = [full_coverage(law, same_direction=u / 2, bodies=u) for u in (10, 20, 30, 40)]
    return Finding(parts=(_falling(values),), computed={"mu_at_10_20_30_40": values})


def _u_saturates(law: str) -> Finding:
    at = {u: full_coverage(law, same_direction=u / 2, bodies=u, load_n=2.0) for u in (4, 20, 40)}
    early, late = abs(at[20] - at[4]), abs(at[40] - at[20])
    return Finding(
        parts=(late < 0.25 * early,), computed={"from_4_to_20": early, "from_20_to_40": late}
    )


_BELOW, _ABOVE = (0.95, 0.97, 0.99, 1.0), (1.0, 1.01, 1.03, 1.05)


def _frequency_raises(law: str) -> Finding:
    values = {
        side: [full_coverage(law, detuning=detuning) for detuning in steps]
        for side, steps in (("below", _BELOW), ("above", _ABOVE))
    }
    return Finding(
        parts=tuple(_falling([-value for value in series]) for series in values.values()),
        computed={f"{side}_resonance": series for side, series in values.items()},
    )


def _voltage_lowers(law: str) -> Finding:
    values = [full_coverage(law, voltage_v=v) for v in (0.0, 50.0, 100.0, 150.0, 200.0)]
    steps = np.diff(values)
    straight = bool(np.ptp(steps) < 0.05 * np.abs(steps).max()) if steps.any() else False
    return Finding(
        parts=(_falling(values), straight),
        computed={"mu_at_0_50_100_150_200_v": values, "per_volt": float(steps.mean() / 50)},
    )


def _load_lowers(law: str) -> Finding:
    values = [full_coverage(law, load_n=load) for load in (2.0, 10.0, 20.0)]
    return Finding(parts=(_falling(values),), computed={"mu_at_2_10_20_n": values})


def _spread(values: Sequence[float]) -> float:
    return max(values) - min(values)


def _a_and_frequency_lead(law: str) -> Finding:
    effects = {
        "a": _spread(_fig8(law).tolist()),
        "frequency": _spread([full_coverage(law, detuning=d) for d in (*_BELOW, *_ABOVE)]),
        "u": _spread([full_coverage(law, same_direction=u / 2, bodies=u) for u in (10, 20, 40)]),
        "voltage": _spread([full_coverage(law, voltage_v=v) for v in (0.0, 100.0, 200.0)]),
    }
    leading = sorted(effects, key=lambda name: -effects[name])[:2]
    return Finding(parts=("a" in leading, "frequency" in leading), computed=effects)


def _u_effects_fade(law: str) -> Finding:
    values = {u: full_coverage(law, same_direction=10.0, bodies=u) for u in (10, 20, 40, 80)}
    early, late = values[10] - values[20], values[40] - values[80]
    return Finding(
        parts=(abs(late) < abs(early),), computed={"from_10_to_20": early, "from_40_to_80": late}
    )


_VOLTAGES = (50.0, 100.0, 200.0)


def _swings(law: str) -> list[float]:
    scenes = (local_scene(voltage_v=voltage) for voltage in _VOLTAGES)
    return [swing(operating(local_curve(law, scene))) for scene in scenes]


def _swing_grows(law: str) -> Finding:
    values = _swings(law)
    grows = all(b > 1.05 * a for a, b in pairwise(values))
    return Finding(parts=(grows,), computed={"swing_at_50_100_200_v": values})


def _centre_stays(law: str) -> Finding:
    scenes = (local_scene(voltage_v=voltage) for voltage in _VOLTAGES)
    values = [centre(operating(local_curve(law, scene))) for scene in scenes]
    return Finding(
        parts=tuple(abs(value - MU) < 0.02 for value in values),
        computed={"centre_at_50_100_200_v": values},
    )


def _swing_with_falling_frequency(law: str) -> Finding:
    steps = {"above": (1.02, 1.01, 1.0), "below": (1.0, 0.99, 0.98)}
    values = {
        side: [swing(operating(local_curve(law, local_scene(detuning=d)))) for d in detunings]
        for side, detunings in steps.items()
    }
    return Finding(
        parts=tuple(_falling([-value for value in series]) for series in values.values()),
        computed={f"{side}_resonance": series for side, series in values.items()},
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


def _directions_swap(law: str) -> Finding:
    right = local_curve(law, local_scene())
    left = local_curve(law, leftward(local_scene()))
    correlation = float(np.corrcoef(operating(right), operating(left))[0, 1])
    return Finding(parts=(correlation < -0.5,), computed={"correlation": correlation})


def _local_effects(law: str) -> dict[str, float]:
    """How far each parameter moves μ' in local coverage, about the paper's scene."""
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
        "voltage": _spread([at_place(driven(voltage)) for voltage in (0.0, 100.0, 200.0)]),
        "load": _spread([at_place(loaded(load)) for load in (10.0, 20.0, 30.0)]),
    }


def _place_and_voltage_lead(law: str) -> Finding:
    effects = _local_effects(law)
    return Finding(
        parts=(effects["place"] > effects["load"], effects["voltage"] > effects["load"]),
        computed=effects,
    )


def _load_is_weak(law: str) -> Finding:
    effects = _local_effects(law)
    ratio = effects["load"] / effects["place"] if effects["place"] else math.nan
    return Finding(parts=(bool(ratio < 0.1),), computed={"load_over_place": ratio})


def _number_of_bodies_is_dense() -> Finding:
    spacing_m, zone_m = _BEAM.length_m / 20, float(np.diff(zones(6, 0.1).edges_m).mean())
    return Finding(
        parts=(spacing_m < 0.1 * zone_m,), computed={"spacing_m": spacing_m, "zone_m": zone_m}
    )


def _single_finger_is_local() -> Finding:
    half_wave_m = 2 * float(np.diff(zones(6, 0.1).edges_m)[2:-2].mean())
    return Finding(
        parts=(half_wave_m > 0.01,),
        computed={"contact_m": 0.01, "half_wave_m": half_wave_m},
    )


CLAIMS = (
    Claim(
        id="drive-near-natural-frequency",
        place="Section 2, Table 3",
        claim="24,221 Hz is near the beam's natural frequency",
        check="within the half-power bandwidth of the nearest resonance of four beam models",
        expected="within 0.5 %",
        find=without_law(lambda: _near_natural(_FREQUENCY_HZ)),
        remark="damping ratio 0.005 is assumed; the paper gives none",
        lawless=True,
    ),
    Claim(
        id="drive-from-patch-position",
        place="Section 2, Table 3",
        claim="24,221 Hz is the resonance of a beam with sheets at a peak of its mode",
        check="mode 6 with the sheets at each peak in turn, two patched models, within 10 Hz",
        expected="24,221 Hz",
        find=without_law(_from_patch_position),
        lawless=True,
    ),
    Claim(
        id="patch-on-peak",
        place="Section 2, Fig 3",
        claim="the sheets are pasted on a peak of the mode function",
        check="the place near the fifth peak where they drive mode 6 most is the peak, to 1 mm",
        expected="the peak",
        find=without_law(_patch_on_peak),
        lawless=True,
    ),
    Claim(
        id="body-mass",
        place="Table 3",
        claim="a ciliary body has a mass of 0.01 kg",
        check="the mass of 20 bodies is below that of the beam that carries them",
        expected="a part of the beam's mass",
        find=without_law(_bodies_are_light),
        lawless=True,
    ),
    Claim(
        id="body-load",
        place="Table 3",
        claim="the skin presses each of 20 bodies with 20 N",
        check="the cantilever's deflection stays below 1 mm, its stress below 350 MPa",
        expected="a load that the beam bears",
        find=without_law(_beam_bears_the_load),
        lawless=True,
    ),
    Claim(
        id="bodies-dense",
        place="Section 2, before Fig 5",
        claim="20 bodies on the beam are dense enough to count as continuous",
        check="their spacing is below a tenth of a zone of mode 6",
        expected="much smaller than a zone",
        find=without_law(_number_of_bodies_is_dense),
        lawless=True,
    ),
    Claim(
        id="single-finger-is-local",
        place="Section 2",
        claim="a single finger covers less than half a wavelength",
        check="10 mm against mode 6's half wave",
        expected="less",
        find=without_law(_single_finger_is_local),
        lawless=True,
    ),
    Claim(
        id="fig8-range",
        place="Fig 8",
        claim="μ' under full coverage runs from about 0.2 to 0.6",
        check="lowest and highest μ' for a = 0 to 20 of 20, each within 0.02",
        expected="0.2 and 0.6",
        find=_fig8_range,
    ),
    Claim(
        id="fig8-linear-in-a",
        place="Fig 8, Section 4.1",
        claim="μ' falls linearly with a",
        check="every step in a lowers μ', all steps equal",
        expected="a straight line",
        find=_fig8_linear,
    ),
    Claim(
        id="fig8-crossing",
        place="Fig 8",
        claim="with less than half of the bodies helping it is rougher, with more it is smoother",
        check="μ' above μ for a below 10 of 20, below μ for a above 10",
        expected="crossing at 10",
        find=_fig8_crossing,
    ),
    Claim(
        id="u-lowers-mu-fixed-a",
        place="Section 4.1, Fig 13b",
        claim="μ' falls as u grows (a fixed)",
        check="μ' at u = 10, 15, 20, 30, 40 with a = 10",
        expected="falling",
        find=_u_at_fixed_a,
    ),
    Claim(
        id="u-lowers-mu-fixed-ratio",
        place="Section 4.1, Fig 13b, Eq 7",
        claim="μ' falls as u grows (a/b fixed)",
        check="μ' at u = 10, 20, 30, 40 with half of them helping",
        expected="falling",
        find=_u_at_fixed_ratio,
    ),
    Claim(
        id="u-saturates",
        place="Section 4.1",
        claim="beyond 20 bodies more of them change little (a/b fixed)",
        check="the change from 20 to 40 is below a quarter of that from 4 to 20, at 2 N",
        expected="no significant change",
        find=_u_saturates,
    ),
    Claim(
        id="u-effect-fades",
        place="Section 4.1, Fig 13b",
        claim="u matters at first and less as it grows (a fixed)",
        check="the change from 40 to 80 against that from 10 to 20, with a = 10",
        expected="smaller",
        find=_u_effects_fade,
    ),
    Claim(
        id="omega-raises-mu",
        place="Section 4.1, Fig 13c, Section 6",
        claim="μ' under full coverage rises with frequency",
        check="μ' (a = 10 of 20) from 0.95 to 1 and from 1 to 1.05 times the resonance",
        expected="rising",
        find=_frequency_raises,
    ),
    Claim(
        id="voltage-lowers-mu",
        place="Section 4.1, Fig 13d",
        claim="μ' under full coverage falls linearly with voltage",
        check="μ' (a = 10 of 20) at 0 to 200 V falls; its steps are equal to 5 %",
        expected="falling, straight",
        find=_voltage_lowers,
    ),
    Claim(
        id="pressure-lowers-mu",
        place="Section 4.1, Fig 13",
        claim="the higher the touch pressure the smaller μ'",
        check="μ' (a = 10 of 20) at 2, 10 and 20 N per body",
        expected="falling",
        find=_load_lowers,
    ),
    Claim(
        id="a-and-frequency-lead",
        place="Section 4.1, Section 6",
        claim="under full coverage a and the frequency have the greatest influence",
        check="spread of μ' over a 0-20, frequency ±5 %, u 10-40 and 0-200 V: the two largest",
        expected="a and frequency",
        find=_a_and_frequency_lead,
    ),
    Claim(
        id="swing-grows-with-voltage",
        place="Section 4.2, Fig 14a",
        claim="the variation of μ' along the beam grows with voltage",
        check="swing of μ' beyond 23.1 mm at 50, 100 and 200 V, each step above 5 %",
        expected="growing",
        find=_swing_grows,
    ),
    Claim(
        id="centre-stays",
        place="Section 4.2, Fig 14a",
        claim="μ' stays centred at 0.4 at every voltage",
        check="centre of μ' beyond 23.1 mm at 50, 100 and 200 V, each within 0.02",
        expected="0.4",
        find=_centre_stays,
    ),
    Claim(
        id="swing-grows-as-frequency-falls",
        place="Section 4.2, Fig 14b",
        claim="the variation of μ' grows slightly as the frequency falls",
        check="swing of μ' falling to the resonance from 1.02, and below it to 0.98",
        expected="growing",
        find=_swing_with_falling_frequency,
    ),
    Claim(
        id="fewer-peaks-at-lower-frequency",
        place="Section 4.2, Fig 14b",
        claim="peaks and troughs become fewer as the frequency falls",
        check="troughs of μ' at the resonances of modes 6, 5 and 4, with exact mode shapes",
        expected="fewer",
        find=_peaks_per_mode,
        remark="200 V, as lower modes move less",
    ),
    Claim(
        id="direction-swaps",
        place="Section 2, Section 5.2",
        claim="smooth and rough places swap when the finger turns round",
        check="correlation of μ' rightward and leftward beyond 23.1 mm below -0.5",
        expected="opposite",
        find=_directions_swap,
    ),
    Claim(
        id="place-and-voltage-lead",
        place="Abstract, Section 6",
        claim="under local coverage place and voltage matter most, pressure little",
        check="range of μ' over places, 0-200 V and 10-30 N: place and voltage each beat the load",
        expected="place and voltage",
        find=_place_and_voltage_lead,
    ),
    Claim(
        id="pressure-weak",
        place="Abstract, Section 5.2",
        claim="the touch pressure changes μ' only a little",
        check="range of μ' over 10-30 N below a tenth of that over places",
        expected="weak",
        find=_load_is_weak,
    ),
)
