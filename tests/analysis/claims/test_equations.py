"""Claims about Eqs 3 to 12 against integrals and limits of their own."""

import numpy as np
import pytest
from scipy.integrate import quad

from analysis.claims import equations
from device.friction.laws import LAWS
from tests.analysis.claims.conftest import Find


def test_eq_3_follows_in_its_parts(find: Find) -> None:
    assert find("eq3-second-line").verdict == "holds"
    assert find("eq5-coefficient").verdict == "holds"
    gaps = find("eq4-static-load").computed["relative_gap_with_eq2_load"]
    # F of Eq 2 exceeds the static load uf by f_p, and so does the force.
    assert gaps == pytest.approx([2.8 / 400, 28 / 40, 0.5 / 200])


def test_eq_11_integrates_over_a_length_instead_of_half_a_period(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = find("eq11-inner-limit")
    assert found.verdict == "fails"
    period_s = 1 / 24105.149
    half, _ = quad(lambda t: abs(np.sin(2 * np.pi * t / period_s)), 0, period_s / 2)
    assert found.computed["integrals_s"]["t_half"] == pytest.approx(half, rel=1e-6)
    assert found.computed["ratio"] == pytest.approx(0.05 / (period_s / 2), rel=1e-3)
    # With a period of L seconds the two limits are the same.
    monkeypatch.setattr(equations, "natural_frequency_hz", lambda *_: 10.0)
    assert find("eq11-inner-limit").verdict == "holds"


def test_eq_12_divides_a_finger_by_a_hand(find: Find) -> None:
    found = find("eq12-local-load")
    assert found.verdict == "fails"
    assert found.computed["share"] == pytest.approx(0.01 / 0.1)


def test_the_coefficient_of_inertia_is_half_where_a_law_has_inertia(find: Find) -> None:
    found = {law: find("inertia-half", law) for law in LAWS}
    assert [of.verdict for of in found.values()] == ["holds", "partly", "fails"]
    assert [of.computed["eta_p"] for of in found.values()] == pytest.approx([0.5, 0.5, 0.0])
    # tanh(ln3/2 · V/100) at 50, 100 and 200 V
    assert found["consistent"].computed["eta_at_200_v"] == pytest.approx(0.8)
    assert found["consistent"].scope == (False, True, False)


def test_the_place_of_the_bodies_does_not_rescue_eq_8(find: Find) -> None:
    loads = find("eq9-from-eq8").computed
    assert loads["eq8_sum_n"] == pytest.approx(560, abs=1)
    assert loads["eq8_sum_with_bodies_at_spacing_ends_n"] == pytest.approx(606, abs=1)
    assert loads["eq9_n_m"] == pytest.approx(2.826, abs=1e-3)
