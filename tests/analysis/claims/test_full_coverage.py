"""Claims about a hand on the whole beam: verdicts that move with the friction."""

from collections.abc import Callable
from typing import Any

import pytest

from analysis.claims import coverage
from device.friction.laws import LAWS
from tests.analysis.claims.conftest import Find


def test_friction_that_rises_with_voltage_contradicts_the_claim(find: Find) -> None:
    found = {law: find("voltage-lowers-mu", law) for law in LAWS}
    assert [of.verdict for of in found.values()] == ["fails", "fails", "partly"]
    assert found["printed"].computed["per_volt"] == pytest.approx(2.826e-5, rel=1e-3)
    # η, but not the inertia, falls away where half of the bodies help: μ(1 + f_p/(uf)).
    assert found["printed"].computed["mu_at_0_50_100_150_200_v"][2] == pytest.approx(
        0.4 * (1 + 2.8264 / 400)
    )


def test_the_verdict_on_voltage_rests_on_a(find: Find) -> None:
    with_a_20 = {
        law: find("voltage-lowers-mu", law).computed["mu_at_0_and_200_v_with_a_20"] for law in LAWS
    }
    assert with_a_20["consistent"] == pytest.approx([0.4, 0.0856], abs=1e-4)
    assert with_a_20["printed"] == pytest.approx([0.2, 0.2057], abs=1e-4)


@pytest.mark.parametrize(
    ("mu", "verdict"),
    [
        (lambda v: 0.4 - v / 1000, "holds"),
        (lambda v: 0.4 / (1 + v / 100), "partly"),
        (lambda v: 0.4 + v / 1000, "fails"),
        (lambda v: 0.4, "fails"),
    ],
)
def test_falling_decides_and_straightness_is_a_detail(
    find: Find,
    monkeypatch: pytest.MonkeyPatch,
    mu: Callable[[float], float],
    verdict: str,
) -> None:
    monkeypatch.setattr(coverage, "full_coverage", lambda _, **given: mu(given["voltage_v"]))
    assert find("voltage-lowers-mu", "consistent").verdict == verdict


def test_the_best_drive_is_the_highest_unless_inertia_alone_acts(find: Find) -> None:
    found = {law: find("raise-a-and-voltage", law) for law in LAWS}
    assert [of.verdict for of in found.values()] == ["partly", "holds", "holds"]
    assert found["printed"].computed["best_voltage_v"] == 0.0
    assert found["consistent"].computed["lowest_mu"] == pytest.approx(0.4 * 0.2 + 0.00565, abs=1e-4)


def test_the_advice_fails_where_all_of_it_is_wrong(
    find: Find, monkeypatch: pytest.MonkeyPatch
) -> None:
    def mu(_: str, *, same_direction: float = 10, bodies: int = 20, voltage_v: float = 100) -> Any:
        return same_direction * 0.01 + voltage_v * 0.001 + 10.0 / bodies

    monkeypatch.setattr(coverage, "full_coverage", mu)
    assert find("raise-a-and-voltage", "consistent").scope == (False, False, False)


def test_other_parts_of_helping_bodies_leave_the_verdicts_on_frequency(find: Find) -> None:
    for law in LAWS:
        found = find("omega-raises-mu", law).computed
        rises = [found[f"with_a_20_rises_{side}_resonance"] for side in ("below", "above")]
        assert sorted(rises) == [False, True]
        effects = find("a-and-frequency-lead", law).computed["with_a_20"]
        assert effects["voltage"] > effects["frequency"]


def test_bodies_that_change_nothing_change_little(find: Find) -> None:
    found = {law: find("u-saturates", law) for law in LAWS}
    assert found["coulomb"].computed == {"from_4_to_20": 0.0, "from_20_to_40": 0.0}
    assert [of.verdict for of in found.values()] == ["holds"] * 3
