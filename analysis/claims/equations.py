"""Claims about Eqs 3 to 12, from the friction force to the coefficient."""

import math
from collections.abc import Callable

import numpy as np

from analysis.claims.claim import Claims, Finding, finding, near
from analysis.claims.curves import BEAM, MU, PLACES_M, falling, local_curve, local_scene
from device.beam.modes import FloatArray, modal_displacement_m, mode_shape, natural_frequency_hz
from device.friction.contact import ContactState, contact_of, contact_state
from device.friction.laws import LAWS, ContactTerms, anisotropy
from device.friction.rungs import reference_tip_speed_m_s, rung_field
from device.friction.scenes import Drive, FingerContact, Scene

_EXACT = 1e-9
CLAIMS = Claims()


def _gaps(form: Callable[[float, float, float, float], float]) -> list[float]:
    """Return the relative gaps between a form of the friction force over μ and Eq 3's second line.

    The form takes a, b, f and f_p.
    """
    drawn = [(4.0, 16.0, 20.0, 2.8), (10.0, 10.0, 2.0, 28.0), (15.0, 5.0, 10.0, 0.5)]
    return [
        abs(form(a, b, f, f_p) / (1.5 * f * b + 0.5 * f * a + f_p) - 1) for a, b, f, f_p in drawn
    ]


def _bracket(a: float, b: float, f: float, f_p: float) -> float:
    """Return the bracket of Eqs 4 and 5."""
    return 1.5 - a / (a + b) + f_p / ((a + b) * f)


@CLAIMS.add(
    place="Eq 3",
    claim="with η = ½ the first line of Eq 3 equals the second",
    check="both lines for three sets of a, b, f, f_p",
    expected="equal",
)
def _eq3_second_line() -> Finding:
    gap = max(_gaps(lambda a, b, f, f_p: f * a + f * b + 0.5 * (f * b - f * a) + f_p))
    return finding(gap < _EXACT, largest_relative_gap=gap)


@CLAIMS.add(
    place="Eq 4",
    claim="the friction force is μ(3/2 - a/u + f_p/(uf))F with F of Eq 2",
    check="Eq 4 with F = (a+b)f + f_p against Eq 3 for three sets of a, b, f, f_p",
    expected="equal",
    remark="they are equal with the static load uf in place of F",
)
def _eq4_static_load() -> Finding:
    gaps = _gaps(lambda a, b, f, f_p: _bracket(a, b, f, f_p) * ((a + b) * f + f_p))
    return finding(max(gaps) < _EXACT, relative_gap_with_eq2_load=gaps)


@CLAIMS.add(
    place="Eq 5",
    claim="μ' = μ(3/2 - a/u + f_p/(uf))",
    check="Eq 5 times the static load uf against Eq 3",
    expected="equal",
)
def _eq5_coefficient() -> Finding:
    gaps = _gaps(lambda a, b, f, f_p: _bracket(a, b, f, f_p) * (a + b) * f)
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
    return finding((a in natural for a in range(20)), a_with_natural_a_over_b=natural, of=20)


def _state(scene: Scene, x_m: FloatArray) -> ContactState:
    """Return the terms of the contact in a scene with its finger moved to these places."""
    field = rung_field("mode", BEAM, scene.drive)
    return contact_state(contact_of(scene, x_m), field, reference_tip_speed_m_s("mode"))


def _inertial_loads() -> dict[str, float]:
    """Return f_p by Eq 8, as sum and as average over 20 bodies, and by Eq 9 read literally."""
    natural_hz = natural_frequency_hz(BEAM, 6)
    omega = 2 * math.pi * natural_hz
    peak = 0.01 * omega**2 * float(modal_displacement_m(BEAM, 6, 100.0, natural_hz)) / math.pi
    bodies, at_ends = (np.abs(mode_shape(6, (np.arange(20) + part) / 20)) for part in (0.5, 1.0))
    state = _state(Scene(coverage="full"), np.array([BEAM.length_m]))
    return {
        "eq8_sum_n": float(peak * bodies.sum()),
        "eq8_sum_with_bodies_at_spacing_ends_n": float(peak * at_ends.sum()),
        "eq8_average_n": float(peak * bodies.mean()),
        "eq9_n_m": float(state.inertial_load_n[0]),
    }


@CLAIMS.add(
    place="Eqs 8 and 9",
    claim="dense bodies turn Eq 8's sum over bodies into Eq 9's integral over the beam",
    check="f_p of Eq 8 (sum, or average, over 20 bodies) against Eq 9, within 10%",
    expected="equal",
    remark="Eq 9 read literally is a force times a length; the bodies are assumed in the "
    "middles of their spacings; the verdict is the same with them at the ends",
)
def _eq9_from_eq8() -> Finding:
    loads = _inertial_loads()
    readings = loads["eq8_sum_n"], loads["eq8_average_n"]
    equal = any(abs(loads["eq9_n_m"] / load_n - 1) < 0.1 for load_n in readings)
    return finding(equal, **loads)


def _rectified_s(limit_s: float, period_s: float) -> float:
    """Return the integral of |sin(2πt/T)| from 0 to a limit."""
    half_waves, rest_s = divmod(limit_s, period_s / 2)
    turn = math.cos(2 * math.pi * rest_s / period_s)
    return (2 * half_waves + 1 - turn) * period_s / (2 * math.pi)


@CLAIMS.add(
    place="Eq 11",
    claim="Eq 9 gives the local inertial load with the inner integral from 0 to L/2",
    check="the inner integral to L/2, in seconds, against that to Eq 9's T/2, within 1%",
    expected="equal",
    remark="L/2 is a length and the limit a time; if it is a misprint of T/2, which Eq 12 has, "
    "the claim holds",
)
def _eq11_inner_limit() -> Finding:
    period_s = 1 / natural_frequency_hz(BEAM, 6)
    limits_s = {"l_half": BEAM.length_m / 2, "t_half": period_s / 2}
    integrals_s = {name: _rectified_s(limit_s, period_s) for name, limit_s in limits_s.items()}
    ratio = integrals_s["l_half"] / integrals_s["t_half"]
    return finding(abs(ratio - 1) < 0.01, integrals_s=integrals_s, ratio=ratio)


@CLAIMS.add(
    place="Eq 12",
    claim="the local inertial load f_p over the load uf is the inertial term under one finger",
    check="f_p/(uf) of Eq 12 against f_p over the load on the bodies covered, within 1%",
    expected="equal",
    remark="f_p counts the bodies under the finger, uf all bodies of the beam; with the load on "
    "the covered ones the term is L/l_s times as large",
)
def _eq12_local_load() -> Finding:
    terms = _state(Scene(), PLACES_M[FingerContact().contact_m <= PLACES_M]).terms
    shares = terms.printed_inertial_ratio / terms.inertial_ratio
    largest = {
        "f_p_over_uf": terms.printed_inertial_ratio.max(),
        "f_p_over_covered_load": terms.inertial_ratio.max(),
    }
    return finding((np.abs(shares - 1) < 0.01).all(), share=shares.mean(), **largest)


def _etas(law: str) -> dict[str, float]:
    """Return η at resonance by voltage."""
    found = {}
    for voltage_v in (50.0, 100.0, 200.0):
        scene = Scene(drive=Drive(voltage_v=voltage_v))
        speed = _state(scene, np.array([BEAM.length_m])).terms.relative_tip_speed
        eta = 0.5 if LAWS[law].as_printed else float(anisotropy(speed))
        found[f"eta_at_{voltage_v:.0f}_v"] = eta
    return found


@CLAIMS.add(
    place="Section 3.1, after Eq 3",
    claim="the effect coefficient of the anisotropic vibration is ½",
    check="η at 50, 100 and 200 V at resonance, each within 0.01 of ½",
    expected="½ at any drive",
    remark="the repaired laws assume ½ at 100 V, where their η is set, and depend on the drive",
)
def _eta_half(law: str) -> Finding:
    return near(0.5, 0.01, **_etas(law))


def _mu_at(law: str, *, same_direction: float, speed: FloatArray, inertia: float) -> FloatArray:
    """Return μ' of a law at relative tip speeds, with one ratio of inertial to static load."""
    terms = ContactTerms(
        friction_coefficient=np.array(MU),
        same_direction=np.array(same_direction),
        opposing=np.array(1.0 - same_direction),
        relative_tip_speed=speed,
        inertial_ratio=np.array(inertia),
        printed_inertial_ratio=np.array(inertia),
    )
    return LAWS[law](terms)


@CLAIMS.add(
    place="Section 3.1, before Eq 8",
    claim="the effect coefficient of the inertial pressure is that of the vibration, η_p = η = ½",
    check="η_p, from the growth of μ'/μ with the inertial load, against η at 50, 100 and 200 V",
    expected="equal, within 0.01",
    remark="η_p is the share of a period in which a body presses, whatever the drive; the repaired "
    "laws assume η = ½ at 100 V alone",
)
def _inertia_half(law: str) -> Finding:
    small, speed = 1e-6, np.array(1.0)
    loaded, free = (
        float(_mu_at(law, same_direction=0.5, speed=speed, inertia=p)) for p in (small, 0.0)
    )
    eta_p = 0.5 * (loaded - free) / (MU * small)
    etas = _etas(law)
    return finding((abs(eta - eta_p) < 0.01 for eta in etas.values()), eta_p=eta_p, **etas)


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
    remark="assumes a/u within 0 to 1; Eq 15's leaves it for a contact below 8.7 mm, and the "
    "printed μ' is then below 0 at some places",
)
def _friction_stays_positive(law: str) -> Finding:
    speeds = np.array([0.0, 1.0, 10.0, 100.0])
    lowest = float(np.min(_mu_at(law, same_direction=1.0, speed=speeds, inertia=0.0)))
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
