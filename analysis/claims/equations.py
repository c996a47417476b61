"""Claims about the vibration and Eqs 1 to 12."""

import math

import numpy as np

from analysis.claims.claim import Claims, Finding, finding
from analysis.claims.curves import (
    MU,
    falling,
    leftward,
    local_curve,
    local_scene,
    mu_at_ratio,
    trough_places_m,
)
from device.beam.beam import Beam
from device.beam.modes import modal_displacement_m, mode_shape, natural_frequency_hz
from device.beam.zones import zones
from device.friction.coefficient import friction_coefficient
from device.friction.contact import contact_of, contact_state
from device.friction.laws import LAWS, ContactTerms, anisotropy
from device.friction.prediction import LawChoice
from device.friction.rungs import TOP_RUNG, reference_tip_speed_m_s, rung_field
from device.friction.scenes import Drive, FingerContact, Scene

_BEAM = Beam()
_EXACT = 1e-9
CLAIMS = Claims()


@CLAIMS.add(
    place="Section 2, Eq 1",
    claim="bodies right of a vibration peak are thrown right, those left of it left",
    check="mode 6: |φ| falls just right of every inner peak and grows just left of it",
    expected="all five peaks",
)
def _eq1_right_of_peak() -> Finding:
    antinodes = zones(6, _BEAM.length_m).antinodes_m / _BEAM.length_m
    step = 1e-3
    after = mode_shape(6, antinodes + step) ** 2 - mode_shape(6, antinodes + 2 * step) ** 2
    before = mode_shape(6, antinodes - step) ** 2 - mode_shape(6, antinodes - 2 * step) ** 2
    right, left = after > 0, before > 0
    return finding(right.all(), left.all(), peaks=antinodes.size, right_side=right)


@CLAIMS.add(
    place="Section 2, Fig 5",
    claim="the direction of vibration changes at the peak or trough of a wave",
    check="mode 6: every inner peak is a zone edge, and every zone edge is a peak",
    expected="edges and peaks coincide",
    remark="φφ' changes sign at nodes as well",
)
def _direction_changes_at_peaks() -> Finding:
    here = zones(6, _BEAM.length_m)
    inner = here.edges_m[1:-1]
    antinodes = set(here.antinodes_m.tolist())
    shared = sum(edge in antinodes for edge in inner.tolist())
    found = {"zone_edges": inner.size, "antinodes": len(antinodes), "edges_at_them": shared}
    return finding(shared == len(antinodes), shared == inner.size, **found)


@CLAIMS.add(
    place="Section 2",
    claim="moving right, a peak's right side is smoother than its left; moving left, rougher",
    check="mean over the peaks of μ' right minus left of the peak under a 2 mm contact",
    expected="negative moving right, positive moving left",
)
def _right_of_peak_smoother(law: str) -> Finding:
    touch = FingerContact(contact_m=2e-3)
    peaks = zones(6, _BEAM.length_m).antinodes_m[:-1]
    places = np.concatenate([peaks + 3e-3, peaks - 1e-3])
    gaps = []
    for scene in (Scene(touch=touch), leftward(Scene(touch=touch))):
        mu = friction_coefficient(scene, law=LawChoice(name=law, ratio="mode"), x_m=places)
        gaps.append(np.mean(mu[: peaks.size] - mu[peaks.size :]))
    ways = [f"right_side_minus_left_side_moving_{way}" for way in ("right", "left")]
    return finding(gaps[0] < 0, gaps[1] > 0, **dict(zip(ways, gaps, strict=True)))


@CLAIMS.add(
    place="Section 2, Fig 4",
    claim="bodies that move with the skin lower the friction, bodies against it raise it",
    check="full coverage: μ' with a/u = 1 below μ, with a/u = 0 above μ",
    expected="below 0.4 and above 0.4",
)
def _helping_lowers_opposing_raises(law: str) -> Finding:
    helped, opposed = mu_at_ratio(law, 1.0), mu_at_ratio(law, 0.0)
    return finding(helped < MU, opposed > MU, all_helping=helped, all_opposing=opposed)


@CLAIMS.add(
    place="Section 2",
    claim="acceleration grows towards the natural frequency and falls away from it",
    check="ω²|q| of mode 6 at 0.90 to 1.10 of its natural frequency rises, then falls",
    expected="one maximum, at the natural frequency",
)
def _acceleration_near_resonance() -> Finding:
    natural_hz = natural_frequency_hz(_BEAM, 6)
    frequencies = natural_hz * np.array([0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1])
    displacement = modal_displacement_m(_BEAM, 6, 100.0, frequencies)
    acceleration = (2 * math.pi * frequencies) ** 2 * displacement
    rises = np.diff(acceleration) > 0
    return finding(
        rises[:3].all(),
        not rises[3:].any(),
        frequency_hz=frequencies,
        acceleration_m_s2=acceleration,
    )


@CLAIMS.add(
    place="Section 2",
    claim="near the next natural frequency the distribution of directions is different",
    check="top rung: the number of zones at the resonances of modes 5, 6 and 7",
    expected="three different numbers",
)
def _next_mode_other_distribution() -> Finding:
    counts = {
        mode: int(rung_field(TOP_RUNG, _BEAM, Drive(mode=mode)).pattern.edges_m.size - 1)  # type: ignore[attr-defined]
        for mode in (5, 6, 7)
    }
    return finding(
        len(set(counts.values())) == 3,
        **{f"zones_of_mode_{mode}": count for mode, count in counts.items()},
    )


@CLAIMS.add(
    place="Section 2, Fig 5",
    claim="friction varies periodically as the finger travels",
    check="at least three troughs along the beam, with gaps equal to within 5 %",
    expected="equal gaps",
)
def _periodic_variation(law: str) -> Finding:
    troughs = trough_places_m(local_curve(law, local_scene()))
    gaps = np.diff(troughs)
    spread = float(gaps.std() / gaps.mean()) if gaps.size > 1 else math.nan
    equal = spread < 0.05
    return finding(troughs.size >= 3, equal, troughs_m=troughs, relative_spread_of_gaps=spread)


_DRAWN = [(4.0, 16.0, 20.0, 2.8), (10.0, 10.0, 2.0, 28.0), (15.0, 5.0, 10.0, 0.5)]


def _bracket(a: float, b: float, f: float, f_p: float) -> tuple[float, float]:
    """Return Eq 3's second line over μ, and Eq 4's bracket."""
    u = a + b
    return 1.5 * f * b + 0.5 * f * a + f_p, 1.5 - a / u + f_p / (u * f)


@CLAIMS.add(
    place="Eq 3",
    claim="with η = ½ the first line of Eq 3 equals the second",
    check="both lines for three sets of a, b, f, f_p",
    expected="equal",
)
def _eq3_second_line() -> Finding:
    gaps = [
        abs((f * a + f * b + 0.5 * (f * b - f * a) + f_p) / _bracket(a, b, f, f_p)[0] - 1)
        for a, b, f, f_p in _DRAWN
    ]
    return finding(max(gaps) < _EXACT, largest_relative_gap=max(gaps))


@CLAIMS.add(
    place="Eq 4",
    claim="the friction force is μ(3/2 - a/u + f_p/(uf))F with F of Eq 2",
    check="Eq 4 with F = (a+b)f + f_p against Eq 3 for three sets of a, b, f, f_p",
    expected="equal",
    remark="they are equal with the static load uf in place of F",
)
def _eq4_static_load() -> Finding:
    gaps = [
        abs(bracket * ((a + b) * f + f_p) / force - 1)
        for a, b, f, f_p in _DRAWN
        for force, bracket in [_bracket(a, b, f, f_p)]
    ]
    return finding(max(gaps) < _EXACT, relative_gap_with_eq2_load=gaps)


@CLAIMS.add(
    place="Eq 5",
    claim="μ' = μ(3/2 - a/u + f_p/(uf))",
    check="Eq 5 times the static load uf against Eq 3",
    expected="equal",
)
def _eq5_coefficient() -> Finding:
    gaps = [
        abs(bracket * (a + b) * f / force - 1)
        for a, b, f, f_p in _DRAWN
        for force, bracket in [_bracket(a, b, f, f_p)]
    ]
    return finding(max(gaps) < _EXACT, relative_gap_with_uf=gaps)


@CLAIMS.add(
    place="Eq 7",
    claim="with χ = a/b, a/u is χ/(χ+1)",
    check="a/u of 20 bodies against χ/(χ+1) for χ = 0 to 19",
    expected="equal",
)
def _eq7_from_eq5() -> Finding:
    gaps = [abs((chi / (chi + 1)) - (20 * chi / (chi + 1)) / 20) for chi in range(20)]
    return finding(max(gaps) < _EXACT, largest_gap=max(gaps))


@CLAIMS.add(
    place="Eq 6",
    claim="a/b is a natural number",
    check="for which a of 0 to 19 out of 20 bodies a/b is a natural number (0 included)",
    expected="every a that Fig 8 draws",
)
def _eq6_natural_chi() -> Finding:
    natural = [a for a in range(20) if a % (20 - a) == 0]
    return finding(len(natural) > 0, len(natural) == 20, a_with_natural_a_over_b=natural, of=20)


def _inertial_loads() -> dict[str, float]:
    """Return f_p by Eq 8, as sum and as average over 20 bodies, and by Eq 9 read literally."""
    natural_hz = natural_frequency_hz(_BEAM, 6)
    omega = 2 * math.pi * natural_hz
    peak = 0.01 * omega**2 * float(modal_displacement_m(_BEAM, 6, 100.0, natural_hz)) / math.pi
    bodies = np.abs(mode_shape(6, (np.arange(20) + 0.5) / 20))
    scene = Scene(coverage="full")
    field = rung_field("mode", _BEAM, scene.drive)
    contact = contact_of(scene, np.array([0.1]))
    state = contact_state(contact, field, reference_tip_speed_m_s("mode"))
    return {
        "eq8_sum_n": float(peak * bodies.sum()),
        "eq8_average_n": float(peak * bodies.mean()),
        "eq9_n_m": float(state.inertial_load_n[0]),
    }


@CLAIMS.add(
    place="Eqs 8 and 9",
    claim="dense bodies turn Eq 8's sum over bodies into Eq 9's integral over the beam",
    check="f_p of Eq 8 (sum, or average, over 20 bodies) against Eq 9, within 10 %",
    expected="equal",
    remark="Eq 9 read literally is a force times a length",
)
def _eq9_from_eq8() -> Finding:
    loads = _inertial_loads()
    return finding(
        abs(loads["eq9_n_m"] / loads["eq8_sum_n"] - 1) < 0.1,
        abs(loads["eq9_n_m"] / loads["eq8_average_n"] - 1) < 0.1,
        **loads,
    )


def _eta(law: str, voltage_v: float) -> float:
    if LAWS[law].as_printed:
        return 0.5
    field = rung_field("mode", _BEAM, Drive(voltage_v=voltage_v))
    speed = float(field.tip_speed_m_s(_BEAM.thickness_m / 2 + 1e-3))
    return float(anisotropy(np.array(speed / reference_tip_speed_m_s("mode"))))


@CLAIMS.add(
    place="Section 3.1, after Eq 3",
    claim="the effect coefficient of the anisotropic vibration is ½",
    check="η at 50, 100 and 200 V at resonance, each within 0.01 of ½",
    expected="½ at any drive",
)
def _eta_half(law: str) -> Finding:
    etas = {f"eta_at_{voltage:.0f}_v": _eta(law, voltage) for voltage in (50.0, 100.0, 200.0)}
    return finding(*(abs(eta - 0.5) < 0.01 for eta in etas.values()), **etas)


@CLAIMS.add(
    place="Section 3.1, after Eq 3",
    claim="μ is the friction coefficient of the beam without vibration",
    check="μ' at 0 V along the beam equals μ to 1e-9",
    expected="0.4",
)
def _no_signal_no_change(law: str) -> Finding:
    curve = local_curve(law, local_scene(voltage_v=0.0))
    worst = float(np.abs(curve - MU).max())
    return finding(worst < _EXACT, largest_distance_from_mu=worst)


@CLAIMS.add(
    place="Eq 5",
    claim="μ' is a friction coefficient",
    check="the lowest μ' with all bodies helping, no inertia, at 0 to 100 times the drive",
    expected="at least 0",
)
def _friction_stays_positive(law: str) -> Finding:
    terms = ContactTerms(
        friction_coefficient=np.array(MU),
        same_direction=np.array(1.0),
        opposing=np.array(0.0),
        relative_tip_speed=np.array([0.0, 1.0, 10.0, 100.0]),
        inertial_ratio=np.array(0.0),
        printed_inertial_ratio=np.array(0.0),
    )
    lowest = float(np.min(LAWS[law](terms)))
    return finding(lowest >= 0, lowest=lowest)


@CLAIMS.add(
    place="Eq 12",
    claim="f_p/(uf) falls as the load f grows, and μ' with it",
    check="mean μ' along the beam at 2, 10 and 20 N per body",
    expected="falling",
)
def _load_lowers_local_mu(law: str) -> Finding:
    means = {
        f"{load}_n": local_curve(law, Scene(touch=FingerContact(body_load_n=load))).mean()
        for load in (2, 10, 20)
    }
    return finding(falling([*means.values()]), **means)
