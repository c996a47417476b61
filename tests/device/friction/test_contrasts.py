"""The study's conditions: regression of the repaired law's changes at the smooth place."""

import re

import pytest

from device.friction.coefficient import friction_coefficient
from device.friction.contrasts import (
    CONDITIONS,
    condition_by_name,
    condition_contrast,
    reference_scene,
)

CHANGES = {
    "frequency": -0.050,
    "structure": -0.041,
    "voltage": -0.133,
    "direction": 0.326,
    "pressure": -0.015,
}


@pytest.mark.parametrize(("name", "change"), CHANGES.items())
def test_change_at_the_smooth_place(name: str, change: float) -> None:
    condition = condition_by_name(name, reference_scene())
    before, after = (friction_coefficient(s)[0] for s in (condition.before, condition.after))
    assert after - before == pytest.approx(change, abs=5e-4)


def test_the_repaired_law_orders_the_conditions() -> None:
    order = sorted(CHANGES, key=condition_contrast, reverse=True)
    assert order == ["direction", "voltage", "frequency", "structure", "pressure"]


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_condition_is_felt_as_expected_under_the_repaired_law(name: str) -> None:
    assert condition_contrast(name) > 0.04


def test_an_unknown_condition_is_refused() -> None:
    with pytest.raises(ValueError, match=re.escape("voltage, direction, pressure, got 'x'")):
        condition_contrast("x")
