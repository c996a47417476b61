"""The checks of claims that take more than a line; each returns its outcome."""

import math
from itertools import combinations

import numpy as np

from analysis.estimates import LEVEL, FloatArray
from device.beam.eq15 import same_direction_ratio
from device.friction.rungs import rung_resonance_hz
from handbook.paper import people, scenes
from handbook.paper.claim import Outcome, judged
from handbook.paper.people import MEANS, SCORES, contrasts
from handbook.paper.scenes import (
    BEAM,
    CONTACT_M,
    MU,
    RESONANCE_HZ,
    mode_shape,
    mu,
    periodic,
    term,
    whole_hand,
)

BELOW = RESONANCE_HZ * np.array([0.95, 0.97, 0.99, 1.0])
ABOVE = RESONANCE_HZ * np.array([1.0, 1.01, 1.03, 1.05])
"""Up to the resonance and beyond it: motion grows on one side and fades on the other."""


def falls(values: FloatArray) -> bool:
    """Return whether each of the values lies below the one before."""
    return bool((np.diff(values) < 0).all())


def falling(**curves: FloatArray) -> Outcome:
    """Return whether each of the curves falls."""
    return judged([falls(curve) for curve in curves.values()], **curves)


def rising(**curves: FloatArray) -> Outcome:
    """Return whether each of the curves rises."""
    return judged([falls(-curve) for curve in curves.values()], **curves)


def from_02_to_06(curve: FloatArray, **computed: float) -> Outcome:
    """Return whether the ends of a range of μ' are about 0.2 and 0.6, as in Figs 8 and 12."""
    low, high = float(curve.min()), float(curve.max())
    close = [abs(low - 0.2) < 0.02, abs(high - 0.6) < 0.02]
    return judged(close, lowest=low, highest=high, **computed)


def periodic_troughs(law: str) -> Outcome:
    """Return the troughs of μ' along the beam, and how much their gaps scatter."""
    troughs = scenes.trough_places_m(scenes.along(law))
    gaps = np.diff(troughs)
    spread = gaps.std() / gaps.mean() if gaps.size > 1 else math.nan
    return judged(troughs.size >= 3 and spread < 0.05, troughs_m=troughs, spread_of_gaps=spread)


def eq4_over_eq3(a: float, b: float, f: float, f_p: float) -> float:
    """Return Eq 4's friction force, with F of Eq 2, over Eq 3's."""
    bracket = 1.5 - a / (a + b) + f_p / ((a + b) * f)
    return bracket * ((a + b) * f + f_p) / (1.5 * f * b + 0.5 * f * a + f_p)


def inertial_loads() -> Outcome:
    """Return f_p by Eq 8, as sum and as average over 20 bodies, and by Eq 9 read literally."""
    # The mean of a rectified sine over its period is 2/π of its peak; η_p halves it (Eq 8).
    peak = 0.01 * (2 * math.pi * RESONANCE_HZ) ** 2 * term("displacement_m")[0] / math.pi
    bodies = peak * np.abs(mode_shape(np.linspace(0.0025, 0.0975, 20)))
    total, mean, eq9 = bodies.sum(), bodies.mean(), term("inertial_load_n", coverage="full")[0]
    equal = any(abs(eq9 / load - 1) < 0.1 for load in (total, mean))
    return judged(equal, eq8_sum_n=total, eq8_average_n=mean, eq9_n_m=eq9)


def jumps_of_eq15() -> Outcome:
    """Return the jumps of Eq 15 at its breakpoints for γ = 0."""
    breakpoints_m = np.array([0.0131, 0.0218, 0.0231, 0.0318, 0.0331, 0.0418])
    # A jump is what remains between places a nanometre to either side.
    before, after = same_direction_ratio(breakpoints_m + np.array([[-1e-9], [1e-9]]), CONTACT_M)
    jumps = np.abs(after - before).round(6)
    return judged((jumps < 1e-3).all(), breakpoints_m=breakpoints_m, jumps=jumps)


def range_of_eq15() -> Outcome:
    """Return the range of Eq 15 with the lower and with the higher γ where pieces overlap."""
    x_m = np.linspace(0.0, 0.1, 100_001)
    lower, higher = (same_direction_ratio(x_m, CONTACT_M, which) for which in ("first", "last"))
    ends = {"lower_gamma": (lower.min(), lower.max()), "higher_gamma": (higher.min(), higher.max())}
    return judged([abs(a) < 0.01 and abs(b - 0.87) < 0.01 for a, b in ends.values()], **ends)


def near_resonance(frequency_hz: float) -> Outcome:
    """Return whether a drive lies within half a bandwidth of mode 6, alone and as built."""
    resonances_hz = {r: rung_resonance_hz(r, BEAM, 6) for r in (scenes.MODE, scenes.WHOLE_BEAM)}
    off = [abs(frequency_hz / hz - 1) for hz in resonances_hz.values()]
    close = [ratio <= BEAM.damping_ratio for ratio in off]
    return judged(close, resonances_hz=resonances_hz, damping_ratio_needed=off)


def withstood(load_n: float) -> Outcome:
    """Return the cantilever's deflection, and stress at the clamp, under an even load."""
    moment, inertia = load_n * BEAM.length_m / 2, BEAM.second_moment_m4
    tip_m = load_n * BEAM.length_m**3 / (8 * BEAM.youngs_modulus_pa * inertia)
    stress_pa = moment * BEAM.thickness_m / 2 / inertia
    return judged([tip_m < 1e-3, stress_pa < 350e6], tip_deflection_m=tip_m, stress_pa=stress_pa)


def straight(values: FloatArray) -> Outcome:
    """Return whether the values fall, on a straight line."""
    steps = np.diff(values)
    even = np.ptp(steps) <= 0.05 * np.abs(steps).max()
    return judged(falls(values), even, values=values, mean_step=steps.mean())


def saturation(law: str) -> Outcome:
    """Return the change of μ' from 4 to 20 bodies and from 20 to 40, under the lightest load."""
    u = np.array([4.0, 20.0, 40.0])
    early, late = np.abs(np.diff(whole_hand(law, a=u / 2, u=u, body_load_n=2.0)))
    return judged(late <= 0.25 * early, from_4_to_20=early, from_20_to_40=late)


def leading_under_a_hand(law: str) -> Outcome:
    """Return the range of μ' over a, frequency, u and voltage; which two are the largest."""
    u = np.array([10.0, 20.0, 40.0])
    ranges = {
        "a": np.ptp(scenes.fig8(law)),
        "frequency": np.ptp(whole_hand(law, frequency_hz=np.hstack([BELOW, ABOVE]))),
        # With half of them helping, so that a's own influence is not counted again.
        "u": np.ptp(whole_hand(law, a=u / 2, u=u)),
        "voltage": np.ptp(whole_hand(law, voltage_v=np.array([0.0, 100.0, 200.0]))),
    }
    leading = sorted(ranges, key=lambda name: -ranges[name])[:2]
    return judged([name in leading for name in ("a", "frequency")], **ranges)


def _ranges_under_a_finger(law: str) -> dict[str, float]:
    """Return the range of μ' over places, voltages and loads in the paper's scene."""
    return {
        "place": float(np.ptp(periodic(law))),
        "voltage": float(np.ptp(mu(law, voltage_v=[0, 100, 200]))),
        "load": float(np.ptp(mu(law, body_load_n=[10, 20, 30]))),
    }


def place_and_voltage_lead(law: str) -> Outcome:
    """Return whether places and voltages each change μ' by more than loads do."""
    ranges = _ranges_under_a_finger(law)
    return judged([ranges[name] > ranges["load"] for name in ("place", "voltage")], **ranges)


def pressure_is_weak(law: str) -> Outcome:
    """Return whether loads change μ' by less than a tenth of what places do."""
    ranges = _ranges_under_a_finger(law)
    return judged(ranges["load"] < 0.1 * ranges["place"], **ranges)


def troughs_as_printed(law: str) -> Outcome:
    """Return whether the first three troughs are the printed ones, each within 1 mm."""
    troughs = scenes.left_troughs_m(law)[:3]
    # A law with fewer troughs is judged on those that it has.
    close = np.abs(troughs - scenes.TROUGHS_M[: troughs.size]) < 1e-3
    return judged(close if troughs.size else False, troughs_m=troughs)


def centre(curve: FloatArray) -> float:
    """Return the middle of a curve's range."""
    return float(curve.max() + curve.min()) / 2


def swings_by_voltage(law: str) -> Outcome:
    """Return the swing of μ', half its range, at 50, 100 and 200 V; does it grow by above 5%?"""
    swings = np.array([np.ptp(periodic(law, voltage_v=v)) / 2 for v in (50, 100, 200)])
    return judged((swings[1:] > 1.05 * swings[:-1]).all(), at_50_100_200_v=swings)


def swings_off_resonance(law: str, *ratios: float) -> FloatArray:
    """Return the swing of μ' with drives at ratios to the resonance."""
    curves = (periodic(law, frequency_hz=ratio * RESONANCE_HZ) for ratio in ratios)
    return np.array([np.ptp(curve) / 2 for curve in curves])


def troughs_by_mode(law: str) -> Outcome:
    """Return the number of troughs at the resonances of modes 6, 5 and 4, at 200 V."""
    curves = (scenes.along(law, mode=mode, voltage_v=200.0, ratio="mode") for mode in (6, 5, 4))
    return falling(troughs=np.array([scenes.trough_places_m(curve).size for curve in curves]))


def mirrored(law: str) -> Outcome:
    """Return the correlation of μ' rightward and leftward; inertia, without direction, blurs it."""
    correlation = np.corrcoef(periodic(law), periodic(law, direction="left"))[0, 1]
    return judged(correlation < -0.5, correlation=correlation)


def varies_when_sliding(law: str) -> Outcome:
    """Return the swing along the path at 23,200 Hz and 0.56 N, as a share of Fig 12's."""

    def share(damping_ratio: float) -> float:
        paper = mu(law, x_m=scenes.PATH_M, damping_ratio=damping_ratio)
        slid = mu(law, x_m=scenes.PATH_M, damping_ratio=damping_ratio, **scenes.SLIDING)
        return float(np.ptp(slid) / np.ptp(paper))

    # If theory varies, only the measured curve could decide.
    verdict = None if share(BEAM.damping_ratio) > 0.5 else False
    shares = {f"share_at_damping_ratio_{zeta}": share(zeta) for zeta in (0.005, 0.03)}
    return judged(verdict, **shares)


def smoother_with_the_signal(law: str) -> Outcome:
    """Return μ' at the smooth place and along the path, under a finger of 0.5 N."""
    place = float(mu(law, scenes.WHOLE_BEAM, finger_load_n=0.5))
    path = mu(law, scenes.WHOLE_BEAM, finger_load_n=0.5, x_m=scenes.PATH_M)
    rougher = np.mean(path > MU * (1 + 1e-9))
    numbers = {"at_smooth_place": place, "mean_along_path": path.mean(), "part_rougher": rougher}
    return judged([place < MU, path.mean() < MU and rougher == 0], **numbers)


def steps_of_voltage(law: str) -> Outcome:
    """Return μ' at 0, 50, 100 and 200 V at the smooth place, under a finger of 0.5 N."""
    volts = np.array([0.0, 50.0, 100.0, 200.0])
    values = mu(law, scenes.WHOLE_BEAM, voltage_v=volts, finger_load_n=0.5)
    return judged(np.diff(values) < -0.01, at_0_50_100_200_v=values)


def order_of_conditions(law: str) -> Outcome:
    """Return whether a law orders those pairs as people do that people tell apart."""
    predicted = contrasts(law)
    by_score = sorted(MEANS, key=lambda name: -MEANS[name])
    # The condition with the higher mean first, so that the law has to put it first as well.
    p = {(a, b): people.P_HOLM[frozenset((a, b))] for a, b in combinations(by_score, 2)}
    agrees = [predicted[a] > predicted[b] if p[a, b] < LEVEL else None for a, b in p]
    decided = {f"{a} > {b}": value for (a, b), value in p.items() if value < LEVEL}
    return judged(agrees, p_holm_of_decided=decided, law=list(predicted), people=by_score)


def smallest(law: str) -> list[str]:
    """Return the conditions that share the law's smallest contrast."""
    sizes = {name: abs(value) for name, value in contrasts(law).items()}
    return [name for name, size in sizes.items() if size <= min(sizes.values()) + 1e-12]


def spread_of_gains(law: str) -> Outcome:
    """Return whether people's gains on a law's contrasts differ, None where that is open."""
    by_law = people.gain_spread(SCORES, np.array([contrasts(law)[name] for name in MEANS]))
    # On the conditions' own effects the mean gain is 1, whatever the law.
    by_score = people.gain_spread(SCORES, SCORES.mean(axis=0))
    return judged(people.gains_differ(by_law), gains=by_law, gains_on_condition_means=by_score)
