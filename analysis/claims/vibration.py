"""Claims about the vibration of the beam and the direction of its bodies (Section 2)."""

import math
from dataclasses import replace

import numpy as np

from analysis.claims import coverage
from analysis.claims.claim import Outcome, PaperClaims, outcome
from device.beam.modes import FloatArray, modal_displacement_m, mode_shape, natural_frequency_hz
from device.beam.motion import MotionPattern
from device.friction.coefficient import friction_coefficient
from device.friction.prediction import LawChoice
from device.friction.rungs import TOP_RUNG, rung_field, rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene

CLAIMS = PaperClaims()


@CLAIMS.add(
    "Section 2, Eq 1",
    "bodies right of a vibration peak are thrown right, those left of it left",
    "all five peaks",
)
def _eq1_right_of_peak() -> Outcome:
    """Mode 6: |φ| falls just right of every inner peak and grows just left of it."""
    antinodes = coverage.ZONES.antinodes_m / coverage.BEAM.length_m
    step = 1e-3
    # Squared, so that peaks and troughs of the shape count alike.
    after = mode_shape(6, antinodes + step) ** 2 - mode_shape(6, antinodes + 2 * step) ** 2
    before = mode_shape(6, antinodes - step) ** 2 - mode_shape(6, antinodes - 2 * step) ** 2
    right, left = after > 0, before > 0
    return outcome([right.all(), left.all()], peaks=antinodes.size, right_side=right)


@CLAIMS.add(
    "Section 2, Fig 5",
    "the direction of vibration changes at the peak or trough of a wave",
    "edges and peaks coincide",
    remark="φφ' changes sign at nodes as well: half of the edges are not at peaks",
)
def _direction_changes_at_peaks() -> Outcome:
    """Mode 6: every inner peak is a zone edge, and every zone edge is a peak."""
    # The beam's ends are edges without a change of direction.
    inner, antinodes = coverage.ZONES.edges_m[1:-1], coverage.ZONES.antinodes_m
    shared = int(np.isin(inner, antinodes).sum())
    found = {"zone_edges": inner.size, "antinodes": antinodes.size, "edges_at_them": shared}
    return outcome(shared == antinodes.size, shared == inner.size, **found)


@CLAIMS.add(
    "Section 2",
    "moving right, a peak's right side is smoother than its left; moving left, rougher",
    "negative moving right, positive moving left",
    remark="a contact of 2 mm is assumed, which lies on one side of a peak",
)
def _right_of_peak_smoother(law: str) -> Outcome:
    """Mean over the peaks of μ' right minus left of the peak under a 2 mm contact."""
    rightward = Scene(touch=FingerContact(contact_m=2e-3))
    # The last one lies under the sheets, where nobody touches.
    peaks = coverage.ZONES.antinodes_m[:-1]
    # A place is the finger's right edge: contacts begin 1 mm beyond the peak, and end 1 mm before
    # it.
    places = np.concatenate([peaks + 3e-3, peaks - 1e-3])
    gaps = []
    for scene in (rightward, replace(rightward, direction="left")):
        mu = friction_coefficient(scene, law=LawChoice(name=law, ratio="mode"), x_m=places)
        gaps.append(np.mean(mu[: peaks.size] - mu[peaks.size :]))
    ways = [f"right_side_minus_left_side_moving_{way}" for way in ("right", "left")]
    return outcome([gaps[0] < 0, gaps[1] > 0], **dict(zip(ways, gaps, strict=True)))


@CLAIMS.add(
    "Section 2, Fig 4",
    "bodies that move with the skin lower the friction, bodies against it raise it",
    "below 0.4 and above 0.4",
)
def _helping_lowers_opposing_raises(law: str) -> Outcome:
    """Full coverage: μ' with a/u = 1 below μ, with a/u = 0 above μ."""
    helped, opposed = (coverage.full_coverage(law, same_direction=a) for a in (20.0, 0.0))
    return outcome(
        [helped < coverage.MU, opposed > coverage.MU], all_helping=helped, all_opposing=opposed
    )


@CLAIMS.add(
    "Section 2",
    "acceleration grows towards the natural frequency and falls away from it",
    "one maximum, at the natural frequency",
)
def _acceleration_near_resonance() -> Outcome:
    """ω²|q| of mode 6 at 0.90 to 1.10 of its natural frequency rises, then falls."""
    natural_hz = natural_frequency_hz(coverage.BEAM, 6)
    frequencies = natural_hz * np.array([0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1])
    displacement = modal_displacement_m(coverage.BEAM, 6, 100.0, frequencies)
    acceleration = (2 * math.pi * frequencies) ** 2 * displacement
    rises = np.diff(acceleration) > 0
    return outcome(
        [rises[:3].all(), not rises[3:].any()],
        frequency_hz=frequencies,
        acceleration_m_s2=acceleration,
    )


def _top_rung_edges_m(drive: Drive) -> FloatArray:
    """Return the zone edges of the beam that the top rung computes for a drive."""
    pattern = rung_field(TOP_RUNG, coverage.BEAM, drive).pattern
    assert isinstance(pattern, MotionPattern)
    return pattern.edges_m


def _zones_of_modes() -> dict[int, int]:
    return {mode: _top_rung_edges_m(Drive(mode=mode)).size - 1 for mode in (5, 6, 7)}


@CLAIMS.add(
    "Section 2",
    "a change of the frequency changes the vibration mode",
    "another number",
    remark="2% is the study's own change of frequency; up to 10% off, the mode is the same and "
    "its zones only shift",
)
def _frequency_changes_mode() -> Outcome:
    """Top rung: the number of zones 2% off the resonance, and at the adjacent resonances."""
    resonance_hz = rung_resonance_hz(TOP_RUNG, coverage.BEAM, 6)
    ratios = (0.9, 0.98, 1.0, 1.02, 1.1)
    edges_m = {
        ratio: _top_rung_edges_m(Drive(frequency_hz=ratio * resonance_hz)) for ratio in ratios
    }
    counts = {f"zones_at_{ratio:g}_of_resonance": here.size - 1 for ratio, here in edges_m.items()}
    modes, same = _zones_of_modes(), edges_m[1.0].size - 1
    detuned = counts["zones_at_0.98_of_resonance"], counts["zones_at_1.02_of_resonance"]
    shifts = edges_m[0.98][1:-1] - edges_m[1.02][1:-1]
    return outcome(
        [any(count != same for count in detuned), modes[5] != same != modes[7]],
        **counts,
        **{f"zones_of_mode_{mode}": count for mode, count in modes.items()},
        largest_shift_within_2_percent_m=np.abs(shifts).max(),
    )


@CLAIMS.add(
    "Section 2",
    "near the next natural frequency the distribution of directions is different",
    "three different numbers",
)
def _next_mode_other_distribution() -> Outcome:
    """Top rung: the number of zones at the resonances of modes 5, 6 and 7."""
    counts = _zones_of_modes()
    different = len(set(counts.values())) == 3
    return outcome(different, **{f"zones_of_mode_{mode}": n for mode, n in counts.items()})


@CLAIMS.add("Section 2, Fig 5", "friction varies periodically as the finger travels", "equal gaps")
def _periodic_variation(law: str) -> Outcome:
    """At least three troughs along the beam, with gaps equal to within 5%."""
    troughs = coverage.trough_places_m(coverage.local_curve(law, coverage.local_scene()))
    gaps = np.diff(troughs)
    spread = float(gaps.std() / gaps.mean()) if gaps.size > 1 else math.nan
    periodic = troughs.size >= 3 and spread < 0.05
    return outcome(periodic, troughs_m=troughs, relative_spread_of_gaps=spread)
