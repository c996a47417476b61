"""Claims about a single finger: what they assume of the sheets, the load and the rung."""

import pytest

from analysis.claims.coverage import PLACES_M, trough_places_m
from device.friction.coefficient import friction_coefficient
from device.friction.laws import LAWS
from device.friction.prediction import LawChoice
from device.friction.scenes import Drive, Scene
from tests.analysis.claims.conftest import Find


@pytest.mark.parametrize("law", LAWS)
def test_four_troughs_rest_on_the_sheets_at_the_fifth_peak(find: Find, law: str) -> None:
    found = find("fig12-four-troughs", law)
    assert found.verdict == "holds"
    left = [found.computed[f"troughs_m_with_sheets_at_{mm}_mm"].size for mm in (13, 32, 50, 68, 86)]
    assert left == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("law", LAWS)
def test_the_last_trough_is_near_sheets_that_begin_before_86_mm(find: Find, law: str) -> None:
    gap_m = find("fig12-fourth-trough", law).computed["last_trough_to_patch_m"]
    assert 0.081 - gap_m + 0.010 > 0.086


@pytest.mark.parametrize("law", LAWS)
def test_the_third_printed_trough_is_the_second_of_every_law(find: Find, law: str) -> None:
    found = find("fig12-troughs", law)
    assert found.scope == (False, False, False)
    assert found.computed["troughs_m"][1] == pytest.approx(0.0422, abs=1e-3)


def test_the_range_of_fig_12_rests_on_the_rung(find: Find) -> None:
    found = find("fig12-range", "consistent").computed
    assert abs(found["lowest"] - 0.2) < 0.02 < abs(found["lowest_on_top_rung"] - 0.2)


@pytest.mark.parametrize("law", LAWS)
def test_pressure_is_weak_under_a_finger_too(find: Find, law: str) -> None:
    found = find("pressure-weak", law)
    assert found.verdict == "holds"
    assert found.computed["finger_load_over_place"] < 0.1


@pytest.mark.parametrize("law", LAWS)
def test_the_counts_of_troughs_are_the_same_at_100_v(find: Find, law: str) -> None:
    counts = [*find("fewer-peaks-at-lower-frequency", law).computed.values()]
    choice = LawChoice(name=law, ratio="mode")
    at_100_v = [
        trough_places_m(
            friction_coefficient(Scene(drive=Drive(mode=mode)), law=choice, x_m=PLACES_M)
        ).size
        for mode in (6, 5, 4)
    ]
    assert counts == at_100_v == [5, 4, 3]
