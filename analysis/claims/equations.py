"""Claims about the vibration and Eqs 1 to 12."""

import math

import numpy as np

from analysis.claims.claim import Claims, Finding
from analysis.claims.curves import (
    MU,
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


@CLAIMS.without_law(
    id="eq1-right-of-peak",
    place="Section 2, Eq 1",
    claim="bodies right of a vibration peak are thrown right, those left of it left",
    check="mode 6: |φ| falls just right of every inner peak and grows just left of it",
    expected="all five peaks",
)
def _right_of_peak_moves_right() -> Finding:
    antinodes = zones(6, _BEAM.length_m).antinodes_m / _BEAM.length_m
    step = 1e-3
    after = mode_shape(6, antinodes + step) ** 2 - mode_shape(6, antinodes + 2 * step) ** 2
    before = mode_shape(6, antinodes - step) ** 2 - mode_shape(6, antinodes - 2 * step) ** 2
    return Finding(
        parts=(bool((after > 0).all()), bool((before > 0).all())),
        computed={"peaks": antinodes.size, "right_side": (after > 0).tolist()},
    )


@CLAIMS.without_law(
    id="direction-changes-at-peaks",
    place="Section 2, Fig 5",
    claim="the direction of vibration changes at the peak or trough of a wave",
    check="mode 6: every inner peak is a zone edge, and every zone edge is a peak",
    expected="edges and peaks coincide",
    remark="φφ' changes sign at nodes as well",
)
def _directions_change_at_antinodes() -> Finding:
    here = zones(6, _BEAM.length_m)
    inner = here.edges_m[1:-1]
    antinodes = set(here.antinodes_m.tolist())
    shared = sum(edge in antinodes for edge in inner.tolist())
    return Finding(
        parts=(shared == len(antinodes), shared == inner.size),
        computed={"zone_edges": inner.size, "antinodes": len(antinodes), "edges_at_them": shared},
    )


@CLAIMS.under_each_law(
    id="right-of-peak-smoother",
    place="Section 2",
    claim="moving right, a peak's right side is smoother than its left; moving left, rougher",
    check="mean over the peaks of μ' right minus left of the peak under a 2 mm contact",
    expected="negative moving right, positive moving left",
)
def _smoother_right_of_peak(law: str) -> Finding:
    touch = FingerContact(contact_m=2e-3)
    peaks = zones(6, _BEAM.length_m).antinodes_m[:-1]
    found = {}
    for name, scene in (("right", Scene(touch=touch)), ("left", leftward(Scene(touch=touch)))):
        places = np.concatenate([peaks + 3e-3, peaks - 1e-3])
        mu = friction_coefficient(scene, law=LawChoice(name=law, ratio="mode"), x_m=places)
        found[name] = float(np.mean(mu[: peaks.size] - mu[peaks.size :]))
    return Finding(
        parts=(found["right"] < 0, found["left"] > 0),
        computed={f"right_side_minus_left_side_moving_{way}": gap for way, gap in found.items()},
    )


@CLAIMS.under_each_law(
    id="helping-lowers-opposing-raises",
    place="Section 2, Fig 4",
    claim="bodies that move with the skin lower the friction, bodies against it raise it",
    check="full coverage: μ' with a/u = 1 below μ, with a/u = 0 above μ",
    expected="below 0.4 and above 0.4",
)
def _helping_and_opposing(law: str) -> Finding:
    helped, opposed = mu_at_ratio(law, 1.0), mu_at_ratio(law, 0.0)
    return Finding(
        parts=(helped < MU, opposed > MU), computed={"all_helping": helped, "all_opposing": opposed}
    )


@CLAIMS.without_law(
    id="acceleration-near-resonance",
    place="Section 2",
    claim="acceleration grows towards the natural frequency and falls away from it",
    check="ω²|q| of mode 6 at 0.90 to 1.10 of its natural frequency rises, then falls",
    expected="one maximum, at the natural frequency",
)
def _acceleration_near_resonance() -> Finding:
    natural_hz = natural_frequency_hz(_BEAM, 6)
    frequencies = natural_hz * np.array([0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1])
    acceleration = (2 * math.pi * frequencies) ** 2 * modal_displacement_m(
        _BEAM, 6, 100.0, frequencies
    )
    rises = np.diff(acceleration) > 0
    return Finding(
        parts=(bool(rises[:3].all()), bool(not rises[3:].any())),
        computed={"frequency_hz": frequencies.tolist(), "acceleration_m_s2": acceleration.tolist()},
    )


@CLAIMS.without_law(
    id="next-mode-other-distribution",
    place="Section 2",
    claim="near the next natural frequency the distribution of directions is different",
    check="top rung: the number of zones at the resonances of modes 5, 6 and 7",
    expected="three different numbers",
)
def _mode_changes_distribution() -> Finding:
    counts = {
        mode: int(rung_field(TOP_RUNG, _BEAM, Drive(mode=mode)).pattern.edges_m.size - 1)  # type: ignore[attr-defined]
        for mode in (5, 6, 7)
    }
    return Finding(
        parts=(len(set(counts.values())) == 3,),
        computed={f"zones_of_mode_{mode}": count for mode, count in counts.items()},
    )


@CLAIMS.under_each_law(
    id="periodic-variation",
    place="Section 2, Fig 5",
    claim="friction varies periodically as the finger travels",
    check="at least three troughs along the beam, with gaps equal to within 5 %",
    expected="equal gaps",
)
def _periodic(law: str) -> Finding:
    troughs = trough_places_m(local_curve(law, local_scene()))
    gaps = np.diff(troughs)
    spread = float(gaps.std() / gaps.mean()) if gaps.size > 1 else math.nan
    return Finding(
        parts=(troughs.size >= 3, bool(spread < 0.05)),
        computed={"troughs_m": troughs.tolist(), "relative_spread_of_gaps": spread},
    )


_DRAWN = [(4.0, 16.0, 20.0, 2.8), (10.0, 10.0, 2.0, 28.0), (15.0, 5.0, 10.0, 0.5)]


def _bracket(a: float, b: float, f: float, f_p: float) -> tuple[float, float]:
    """Return Eq 3's second line over μ, and Eq 4's bracket."""
    u = a + b
    return 1.5 * f * b + 0.5 * f * a + f_p, 1.5 - a / u + f_p / (u * f)


@CLAIMS.without_law(
    id="eq3-second-line",
    place="Eq 3",
    claim="with η = ½ the first line of Eq 3 equals the second",
    check="both lines for three sets of a, b, f, f_p",
    expected="equal",
)
def _eq3_lines() -> Finding:
    gaps = [
        abs((f * a + f * b + 0.5 * (f * b - f * a) + f_p) / _bracket(a, b, f, f_p)[0] - 1)
        for a, b, f, f_p in _DRAWN
    ]
    return Finding(parts=(max(gaps) < _EXACT,), computed={"largest_relative_gap": max(gaps)})


@CLAIMS.without_law(
    id="eq4-static-load",
    place="Eq 4",
    claim="the friction force is μ(3/2 - a/u + f_p/(uf))F with F of Eq 2",
    check="Eq 4 with F = (a+b)f + f_p against Eq 3 for three sets of a, b, f, f_p",
    expected="equal",
    remark="they are equal with the static load uf in place of F",
)
def _eq4_static_load() -> Finding:
    gaps = []
    for a, b, f, f_p in _DRAWN:
        force, bracket = _bracket(a, b, f, f_p)
        gaps.append(abs(bracket * ((a + b) * f + f_p) / force - 1))
    return Finding(parts=(max(gaps) < _EXACT,), computed={"relative_gap_with_eq2_load": gaps})


@CLAIMS.without_law(
    id="eq5-coefficient",
    place="Eq 5",
    claim="μ' = μ(3/2 - a/u + f_p/(uf))",
    check="Eq 5 times the static load uf against Eq 3",
    expected="equal",
)
def _eq5_static_only() -> Finding:
    gaps = []
    for a, b, f, f_p in _DRAWN:
        force, bracket = _bracket(a, b, f, f_p)
        gaps.append(abs(bracket * (a + b) * f / force - 1))
    return Finding(parts=(max(gaps) < _EXACT,), computed={"relative_gap_with_uf": gaps})


@CLAIMS.without_law(
    id="eq7-from-eq5",
    place="Eq 7",
    claim="with χ = a/b, a/u is χ/(χ+1)",
    check="a/u of 20 bodies against χ/(χ+1) for χ = 0 to 19",
    expected="equal",
)
def _eq7_from_eq5() -> Finding:
    gaps = [abs((chi / (chi + 1)) - (20 * chi / (chi + 1)) / 20) for chi in range(20)]
    return Finding(parts=(max(gaps) < _EXACT,), computed={"largest_gap": max(gaps)})


@CLAIMS.without_law(
    id="eq6-natural-chi",
    place="Eq 6",
    claim="a/b is a natural number",
    check="for which a of 0 to 19 out of 20 bodies a/b is a natural number (0 included)",
    expected="every a that Fig 8 draws",
)
def _chi_is_natural() -> Finding:
    natural = [a for a in range(20) if a % (20 - a) == 0]
    return Finding(
        parts=(len(natural) > 0, len(natural) == 20),
        computed={"a_with_natural_a_over_b": natural, "of": 20},
    )


def _inertial_loads() -> dict[str, float]:
    """Return f_p by Eq 8, as sum and as average over 20 bodies, and by Eq 9 read literally."""
    natural_hz = natural_frequency_hz(_BEAM, 6)
    omega = 2 * math.pi * natural_hz
    peak = 0.01 * omega**2 * float(modal_displacement_m(_BEAM, 6, 100.0, natural_hz)) / math.pi
    bodies = np.abs(mode_shape(6, (np.arange(20) + 0.5) / 20))
    scene = Scene(coverage="full")
    field = rung_field("mode", _BEAM, scene.drive)
    state = contact_state(
        contact_of(scene, np.array([0.1])), field, reference_tip_speed_m_s("mode")
    )
    return {
        "eq8_sum_n": float(peak * bodies.sum()),
        "eq8_average_n": float(peak * bodies.mean()),
        "eq9_n_m": float(state.inertial_load_n[0]),
    }


@CLAIMS.without_law(
    id="eq9-from-eq8",
    place="Eqs 8 and 9",
    claim="dense bodies turn Eq 8's sum over bodies into Eq 9's integral over the beam",
    check="f_p of Eq 8 (sum, or average, over 20 bodies) against Eq 9, within 10 %",
    expected="equal",
    remark="Eq 9 read literally is a force times a length",
)
def _eq9_from_eq8() -> Finding:
    loads = _inertial_loads()
    return Finding(
        parts=(
            abs(loads["eq9_n_m"] / loads["eq8_sum_n"] - 1) < 0.1,
            abs(loads["eq9_n_m"] / loads["eq8_average_n"] - 1) < 0.1,
        ),
        computed=loads,
    )


def _eta(law: str, voltage_v: float) -> float:
    if LAWS[law].as_printed:
        return 0.5
    field = rung_field("mode", _BEAM, Drive(voltage_v=voltage_v))
    speed = float(field.tip_speed_m_s(_BEAM.thickness_m / 2 + 1e-3))
    return float(anisotropy(np.array(speed / reference_tip_speed_m_s("mode"))))


@CLAIMS.under_each_law(
    id="eta-half",
    place="Section 3.1, after Eq 3",
    claim="the effect coefficient of the anisotropic vibration is ½",
    check="η at 50, 100 and 200 V at resonance, each within 0.01 of ½",
    expected="½ at any drive",
)
def _eta_is_half(law: str) -> Finding:
    etas = {f"eta_at_{voltage:.0f}_v": _eta(law, voltage) for voltage in (50.0, 100.0, 200.0)}
    return Finding(parts=tuple(abs(eta - 0.5) < 0.01 for eta in etas.values()), computed=etas)


@CLAIMS.under_each_law(
    id="no-signal-no-change",
    place="Section 3.1, after Eq 3",
    claim="μ is the friction coefficient of the beam without vibration",
    check="μ' at 0 V along the beam equals μ to 1e-9",
    expected="0.4",
)
def _zero_voltage(law: str) -> Finding:
    curve = local_curve(law, local_scene(voltage_v=0.0))
    worst = float(np.abs(curve - MU).max())
    return Finding(parts=(worst < _EXACT,), computed={"largest_distance_from_mu": worst})


@CLAIMS.under_each_law(
    id="friction-stays-positive",
    place="Eq 5",
    claim="μ' is a friction coefficient",
    check="the lowest μ' with all bodies helping, no inertia, at 0 to 100 times the drive",
    expected="at least 0",
)
def _never_negative(law: str) -> Finding:
    terms = ContactTerms(
        friction_coefficient=np.array(MU),
        same_direction=np.array(1.0),
        opposing=np.array(0.0),
        relative_tip_speed=np.array([0.0, 1.0, 10.0, 100.0]),
        inertial_ratio=np.array(0.0),
        printed_inertial_ratio=np.array(0.0),
    )
    lowest = float(np.min(LAWS[law](terms)))
    return Finding(parts=(lowest >= 0,), computed={"lowest": lowest})


@CLAIMS.under_each_law(
    id="load-lowers-local-mu",
    place="Eq 12",
    claim="f_p/(uf) falls as the load f grows, and μ' with it",
    check="mean μ' along the beam at 2, 10 and 20 N per body",
    expected="falling",
)
def _inertia_lowers_with_pressure(law: str) -> Finding:
    loads = (2.0, 10.0, 20.0)
    curves = [local_curve(law, Scene(touch=FingerContact(body_load_n=load))) for load in loads]
    means = [float(curve.mean()) for curve in curves]
    return Finding(
        parts=(means[0] > means[1] > means[2],),
        computed=dict(zip(("2_n", "10_n", "20_n"), means, strict=True)),
    )
