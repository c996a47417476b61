"""Claims about friction along the beam in Fig 12, which follows from Eq 15."""

import math

import numpy as np

from analysis.claims.claim import Claims, Finding, finding
from analysis.claims.curves import (
    CONTACT_M,
    MU,
    PATCH_START_M,
    PLACES_M,
    centre,
    from_02_to_06,
    mu_at_ratio,
    operating,
    trough_places_m,
)
from device.beam.eq15 import WAVELENGTH_M
from device.beam.modes import FloatArray
from device.friction.coefficient import friction_coefficient
from device.friction.prediction import LawChoice
from device.friction.scenes import Scene

_TROUGHS_M = np.array([0.0137, 0.0275, 0.0422])
CLAIMS = Claims()


def _curve(law: str) -> FloatArray:
    choice = LawChoice(name=law, overlap="first")
    return friction_coefficient(Scene(), law=choice, x_m=PLACES_M)


@CLAIMS.add(
    place="Fig 12",
    claim="μ' fluctuates from about 0.2 to 0.6 along the beam",
    check="lowest and highest μ' beyond 23.1 mm, each within 0.02",
    expected="0.2 and 0.6",
)
def _fig12_range(law: str) -> Finding:
    curve = operating(_curve(law))
    return from_02_to_06(float(curve.min()), float(curve.max()))


@CLAIMS.add(
    place="Fig 12",
    claim="the range 0.2 to 0.6 follows from Eqs 12 to 14",
    check="μ' at the a/u of Eqs 13 and 14, each within 0.02",
    expected="0.2 and 0.6",
)
def _fig12_range_repaired(law: str) -> Finding:
    """Check the range with Eq 15's λ but without its breakpoints."""
    largest = WAVELENGTH_M / (4 * CONTACT_M)
    return from_02_to_06(mu_at_ratio(law, largest), mu_at_ratio(law, 1 - largest))


@CLAIMS.add(
    place="Fig 12",
    claim="μ' is centred at 0.4",
    check="middle between lowest and highest μ' beyond 23.1 mm, within 0.02",
    expected="0.4",
)
def _fig12_centre(law: str) -> Finding:
    middle = centre(operating(_curve(law)))
    return finding(abs(middle - MU) < 0.02, centre=middle)


def _left_troughs(law: str) -> FloatArray:
    found = trough_places_m(_curve(law))
    return found[found < PATCH_START_M]


@CLAIMS.add(
    place="Fig 12",
    claim="there are four troughs left of the piezoelectric sheet",
    check="minima of μ' at x below 81 mm",
    expected="4",
)
def _fig12_four_troughs(law: str) -> Finding:
    found = _left_troughs(law)
    return finding(found.size == 4, troughs_m=found)


@CLAIMS.add(
    place="Fig 12, Section 6",
    claim="the first three troughs lie at 13.7, 27.5 and 42.2 mm",
    check="the first three minima of μ', each within 1 mm",
    expected="0.0137, 0.0275, 0.0422 m",
)
def _fig12_troughs(law: str) -> Finding:
    found = _left_troughs(law)[:3]
    off = np.abs(found - _TROUGHS_M[: found.size])
    return finding(*(off < 1e-3 if off.size else [False]), troughs_m=found, paper_m=_TROUGHS_M)


@CLAIMS.add(
    place="Fig 12",
    claim="troughs repeat with the period of Eq 15",
    check="gaps between the printed troughs against λ/2, within 1 mm",
    expected="0.0174 m",
)
def _fig12_trough_gaps() -> Finding:
    gaps = np.diff(_TROUGHS_M)
    close = np.abs(gaps - WAVELENGTH_M / 2) < 1e-3
    return finding(*close, gaps_m=gaps, half_wavelength_m=WAVELENGTH_M / 2)


@CLAIMS.add(
    place="Fig 12",
    claim="the fourth trough is so near the sheet that a finger can hardly move there",
    check="the last trough left of the sheet is less than a contact length from it",
    expected="below 10 mm",
)
def _fig12_fourth_trough(law: str) -> Finding:
    found = _left_troughs(law)
    gap = PATCH_START_M - found[-1] if found.size else math.nan
    return finding(gap < CONTACT_M, last_trough_to_patch_m=gap)
