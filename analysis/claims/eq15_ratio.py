"""Claims about a/u along the beam: Eqs 13 to 15 and Fig 11."""

import math
from typing import get_args

import numpy as np

from analysis.claims.claim import Claims, Finding, finding, near
from analysis.claims.curves import BEAM, CONTACT_M, OPERATING_M, PATCH_START_M, ZONES
from device.beam.eq15 import WAVELENGTH_M, Overlap, same_direction_ratio
from device.beam.modes import FloatArray, mode_constants, natural_frequency_hz
from device.beam.timoshenko import sections, waves
from device.beam.windows import mode_window

_FINE_M = np.linspace(0.0, 0.1, 100_001)
_PERIODIC_M = _FINE_M[_FINE_M >= OPERATING_M]
_POSITIONS_M = _II, _III, _IV, _V, _VI, _VII = 0.0131, 0.0218, OPERATING_M, 0.0318, 0.0331, 0.0418
"""Positions II to VII of Fig 10, the breakpoints of Eq 15 for γ = 0."""
CLAIMS = Claims()


def _mode_wavelength_m() -> float:
    return 2 * math.pi * BEAM.length_m / mode_constants(6).root


def _wavelength_at(frequency_hz: float, *, shear: bool) -> float:
    """Return the length of the travelling wave in the bare beam at a frequency."""
    part = sections(BEAM, patched=False, shear=shear)[0]
    wave = waves(part, np.array([2 * math.pi * frequency_hz]), 0.0)
    return float(2 * math.pi / abs(wave.exponent[0, 0].imag))


@CLAIMS.add(
    place="Eq 15, Fig 10",
    claim="the wavelength at the operating mode is 0.0348 m",
    check="the wavelength of mode 6 or of a travelling wave near 24.2 kHz, within 0.5%",
    expected="0.0348 m",
    remark="the printed λ enters Eq 15 only through 0.87 and 0.0174",
)
def _lambda() -> Finding:
    found = {
        "mode_6_m": _mode_wavelength_m(),
        "euler_at_24221_hz_m": _wavelength_at(24221.0, shear=False),
        "timoshenko_at_24221_hz_m": _wavelength_at(24221.0, shear=True),
        "timoshenko_at_24105_hz_m": _wavelength_at(natural_frequency_hz(BEAM, 6), shear=True),
    }
    close = any(abs(value / WAVELENGTH_M - 1) < 0.005 for value in found.values())
    return finding(close, printed_m=WAVELENGTH_M, **found)


@CLAIMS.add(
    place="Section 3.2, positions I and II",
    claim="up to x = 0.0131 m all bodies under the finger move left",
    check="3λ/8 of the printed λ, and mode 6's first antinode, each within 0.1 mm",
    expected="0.0131 m",
    remark="holds for the printed λ; mode 6 itself is 0.12 mm off",
)
def _first_rise() -> Finding:
    return near(
        _II,
        1e-4,
        three_eighths_lambda_m=3 * WAVELENGTH_M / 8,
        first_antinode_of_mode_6_m=ZONES.antinodes_m[0],
    )


def _mode_ratio(places_m: FloatArray) -> FloatArray:
    return mode_window(6, BEAM.length_m, places_m, np.minimum(places_m, CONTACT_M)).right


@CLAIMS.add(
    place="Eq 15, first piece",
    claim="a/u is 0 on [0, 0.0131)",
    check="largest a/u there by Eq 15 and for mode 6",
    expected="0",
)
def _zero_before_first_rise() -> Finding:
    places_m = np.linspace(0, 0.0130, 50)
    found = {
        "eq15_most": float(same_direction_ratio(places_m, CONTACT_M).max()),
        "mode_6_most": float(_mode_ratio(places_m).max()),
    }
    return finding((most == 0.0 for most in found.values()), **found)


_INNER = (_PERIODIC_M > 0.03) & (_PERIODIC_M < PATCH_START_M)
_BY_LAMBDA = {
    "printed_lambda": WAVELENGTH_M / (4 * CONTACT_M),
    "mode_6_lambda": _mode_wavelength_m() / (4 * CONTACT_M),
}
"""λ/(4 l_s), with the λ printed and with that of mode 6."""


@CLAIMS.add(
    place="Eq 13",
    claim="the largest part moving with the finger is λ/(4 l_s)",
    check="λ/(4 l_s) for mode 6 against the exact part before 30 mm and beyond, within 1%; 0.87",
    expected="0.87",
    remark="holds beyond the first segment with mode 6's own λ; with the printed λ it fails",
)
def _eq13_maximum() -> Finding:
    ratio = _mode_ratio(_PERIODIC_M)
    first = ratio[_PERIODIC_M < 0.03].max()
    exact = {"first_segment": first, "from_30_to_81_mm": ratio[_INNER].max()}
    close = [abs(_BY_LAMBDA["mode_6_lambda"] / most - 1) < 0.01 for most in exact.values()]
    value = all(abs(_BY_LAMBDA["printed_lambda"] / most - 1) < 0.01 for most in exact.values())
    return finding(close, value, **_BY_LAMBDA, exact_for_mode_6=exact)


@CLAIMS.add(
    place="Eq 14",
    claim="the smallest part in periodic motion is 1 - λ/(4 l_s)",
    check="1 - λ/(4 l_s) for mode 6 against the exact part from 30 to 81 mm, within 0.01; 0.13",
    expected="0.13",
    remark="holds with mode 6's own λ; with the printed λ it fails",
)
def _eq14_minimum() -> Finding:
    exact = float(_mode_ratio(_PERIODIC_M)[_INNER].min())
    found = {name: 1 - largest for name, largest in _BY_LAMBDA.items()}
    close = {name: abs(ratio - exact) < 0.01 for name, ratio in found.items()}
    formula, value = close["mode_6_lambda"], close["printed_lambda"]
    return finding(formula, value, **found, exact_for_mode_6=exact)


@CLAIMS.add(
    place="Eq 15",
    claim="a/u rises and falls steadily as the finger moves",
    check="jumps of Eq 15 at its six breakpoints for γ = 0, each below 0.001",
    expected="no jump",
)
def _eq15_continuous() -> Finding:
    step = 1e-9 * np.array([[-1], [1]])
    before, after = same_direction_ratio(np.array(_POSITIONS_M) + step, CONTACT_M)
    jumps = np.abs(after - before)
    return finding((jumps < 1e-3).all(), breakpoints_m=_POSITIONS_M, jumps=jumps)


@CLAIMS.add(
    place="Eq 15",
    claim="the pieces repeat with λ/2",
    check="the span of one γ's pieces against λ/2, within 0.1 mm",
    expected="0.0174 m",
    remark="pieces that span more than the period overlap",
)
def _eq15_period() -> Finding:
    span = _VII - _III
    half_wave = WAVELENGTH_M / 2
    return finding(abs(span - half_wave) < 1e-4, span_of_pieces_m=span, half_wavelength_m=half_wave)


@CLAIMS.add(
    place="Eq 15",
    claim="the stages end at 0.0231, 0.0318, 0.0331 and 0.0418 m",
    check="ramps and plateaus of a 10 mm window over zones of λ/4, each end within 0.15 mm",
    expected="the four printed places",
)
def _eq15_breakpoints() -> Finding:
    # The pieces should be ramps of λ/4 and plateaus of l_s - λ/4.
    quarter, plateau = WAVELENGTH_M / 4, CONTACT_M - WAVELENGTH_M / 4
    right = {
        "end_of_maximum_m": _III + plateau,
        "end_of_fall_m": _III + quarter,
        "end_of_minimum_m": _III + quarter + plateau,
        "end_of_rise_m": _III + 2 * quarter,
    }
    printed = _POSITIONS_M[2:]
    close = (abs(a - b) < 1.5e-4 for a, b in zip(right.values(), printed, strict=True))
    return finding(close, **right, printed_m=printed)


@CLAIMS.add(
    place="Section 3.2, stages 4 and 6",
    claim="the fall begins at 0.0131 + λ/2, the rise at 0.0331 + λ/2",
    check="the text against Eq 15's pieces for γ = 0, within 0.1 mm",
    expected="the same places",
)
def _eq15_stages_in_words() -> Finding:
    fall, rise = _II + WAVELENGTH_M / 2, _VI + WAVELENGTH_M / 2
    return finding(
        [abs(fall - _IV) < 1e-4, abs(rise - _VI) < 1e-4],
        fall_begins_by_text_m=fall,
        fall_begins_by_eq15_m=_IV,
        rise_begins_by_text_m=rise,
        rise_begins_by_eq15_m=_VI,
    )


@CLAIMS.add(
    place="Eq 15",
    claim="γ = 0 to 5 covers x up to 0.1 m",
    check="Eq 15 gives a value everywhere up to 0.1 m; every γ begins before 0.1 m",
    expected="all covered, all used",
)
def _eq15_gamma() -> Finding:
    last_start = _III + WAVELENGTH_M / 2 * np.arange(6)
    used = {"gamma_that_begin_within_0.1_m": (last_start <= 0.1).sum(), "gamma_named": 6}
    covered = np.isfinite(same_direction_ratio(_FINE_M, CONTACT_M)).all()
    return finding(covered, len(set(used.values())) == 1, **used)


@CLAIMS.add(
    place="Fig 11",
    claim="a/u alternates in [0, 0.87]",
    check="lowest and highest a/u with the lower and with the higher γ where pieces overlap",
    expected="0 and 0.87",
    remark="the paper does not say which γ applies where pieces overlap: holds with the higher, "
    "fails with the lower, which Fig 12's range needs",
)
def _fig11_range() -> Finding:
    ranges = {
        f"range_{overlap}": (ratio.min(), ratio.max())
        for overlap in get_args(Overlap)
        for ratio in [same_direction_ratio(_FINE_M, CONTACT_M, overlap)]
    }
    close = (abs(low) < 0.01 and abs(high - 0.87) < 0.01 for low, high in ranges.values())
    return finding(close, **ranges)


@CLAIMS.add(
    place="Fig 11",
    claim="a/u keeps its highest or lowest value for a short distance only",
    check="Eq 15's plateau is shorter than its ramp; for mode 6 a/u is level on less than half",
    expected="1.3 mm against 8.7 mm",
)
def _fig11_plateaus() -> Finding:
    plateau, ramp = _IV - _III, _V - _IV
    ratio = _mode_ratio(_FINE_M)
    level = float(np.mean(np.abs(np.diff(ratio)) < 1e-9))
    return finding(
        plateau < ramp, level < 0.5, plateau_m=plateau, ramp_m=ramp, level_part_for_mode_6=level
    )
