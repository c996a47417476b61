"""Claims about the device: what is not testable, and what damping and load decide."""

import numpy as np
import pytest

from analysis.claims import coverage, hardware
from device.beam.beam import Beam
from device.friction.laws import LAWS
from tests.analysis.claims.conftest import Find


def test_the_place_of_the_sheets_is_not_testable(find: Find) -> None:
    found = find("patch-on-peak")
    assert found.verdict == "not testable"
    apart = found.computed["strongest_drive_at_m"] - found.computed["fifth_peak_m"]
    assert abs(apart) < 1e-3


def test_the_drive_is_near_a_resonance_of_the_bare_beam_alone(find: Find) -> None:
    needed = find("drive-near-natural-frequency").computed["damping_ratio_needed"]
    assert needed["mode"] < 0.005 < needed["euler-patched"] < 0.012
    assert min(needed["timoshenko"], needed["timoshenko-patched"]) > 0.12
    sliding = find("sliding-drive-near-resonance").computed["damping_ratio_needed"]
    assert min(sliding.values()) == pytest.approx(0.0376, abs=1e-4)
    same = find("sliding-same-drive").computed["apart"]
    assert 0.042 < same < 2 * 0.022


def test_the_load_and_the_mass_hold_in_another_reading(find: Find) -> None:
    load = find("body-load")
    assert load.verdict == "fails"
    assert load.computed["tip_deflection_m"] == pytest.approx(9.14e-3, rel=1e-3)
    other = load.computed["with_20_n_in_all"]
    # F L³ / (8 E I) and F L / 2 · h/2 / I, I = W h³ / 12
    inertia = 5e-3**4 / 12
    assert other["tip_deflection_m"] == pytest.approx(20 * 0.1**3 / (8 * 105e9 * inertia))
    assert other["stress_at_clamp_pa"] == pytest.approx(20 * 0.05 * 2.5e-3 / inertia)
    assert other["tip_deflection_m"] < 1e-3
    assert other["stress_at_clamp_pa"] < 350e6
    mass = find("body-mass").computed
    assert mass["bodies_kg_if_per_metre"] < mass["beam_kg"] < mass["bodies_kg"]
    assert find("sliding-same-load").computed["ratio_to_20_n"] < 0.5


@pytest.mark.parametrize(
    ("young_gpa", "density_kg_m3", "verdict"),
    [(105, 8500, "fails"), (117, 8940, "holds"), (117, 8500, "partly")],
)
def test_the_beam_of_table_1_is_not_of_copper(
    find: Find,
    monkeypatch: pytest.MonkeyPatch,
    young_gpa: float,
    density_kg_m3: float,
    verdict: str,
) -> None:
    beam = Beam(youngs_modulus_pa=young_gpa * 1e9, density_kg_m3=density_kg_m3)
    monkeypatch.setattr(hardware, "BEAM", beam)
    assert find("mu-of-copper").verdict == verdict
    if verdict == "fails":
        assert find("mu-of-copper").computed["in_range_of_brass"] == [True, True]


def test_more_damping_leaves_the_sliding_experiment_open(find: Find) -> None:
    found = {law: find("sliding-matches-theory", law) for law in LAWS}
    assert [of.verdict for of in found.values()] == ["not testable", "fails", "fails"]
    for law in ("consistent", "coulomb"):
        assert found[law].computed["share_of_fig12"] < 0.16
        assert found[law].computed["share_with_damping_ratio_0_03"] > 0.5


def test_errors_at_troughs_and_peaks_need_a_theory_that_has_them(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    for law in LAWS:
        found = find("sliding-errors-at-peaks", law)
        assert found.verdict == "not testable"
        assert found.computed["troughs_m"].size == 4
        assert found.computed["peaks_m"].size == 3

    monkeypatch.setattr(coverage, "local_curve", lambda *_: np.full(2001, 0.4))
    assert find("sliding-errors-at-peaks", "consistent").verdict == "fails"


def test_bodies_outrun_the_finger_below_56_mm_per_second(find: Find) -> None:
    found = find("bodies-outrun-the-finger").computed
    assert found["tip_speed_m_s"] == pytest.approx(0.0565, abs=1e-4)
    assert found["finger_m_s"] == pytest.approx(0.0399, abs=1e-4)
