"""Friction from a table: between its knots, beyond them, and tables that are refused."""

from collections.abc import Sequence
from itertools import product

import numpy as np
import pytest

from device.arrays import FloatArray
from device.friction.surfaces import FrictionTable, friction_table
from protocol.errors import BadInput

At = dict[str, FloatArray | str]
PLACES = np.linspace(0.01, 0.08, 8)


def _friction(voltage_v: float, place_m: float, direction: str) -> float:
    """Friction of which the logarithm is linear along each number."""
    slope = -2.0 if direction == "left" else -1.0
    return float(0.4 * np.exp(slope * voltage_v / 100 * (0.2 + place_m)))


def _rows() -> list[list[str]]:
    grid = product((0.0, 50.0, 100.0), PLACES, ("left", "right"))
    rows = [[f"{v}", f"{x}", d, f"{_friction(v, x, d)}"] for v, x, d in grid]
    return [["voltage_v", "place_m", "direction", "friction"], *rows]


def _table(rows: Sequence[Sequence[str]]) -> FrictionTable:
    return friction_table(rows, "friction.csv", "digest")


def test_friction_between_knots_is_linear_in_its_logarithm() -> None:
    table = _table(_rows())
    for voltage_v, direction in ((0.0, "left"), (25.0, "right"), (100.0, "left")):
        at: At = {"voltage_v": np.array(voltage_v), "place_m": PLACES, "direction": direction}
        exact = [_friction(voltage_v, x, direction) for x in PLACES]
        assert table.friction(at) == pytest.approx(exact, rel=1e-12)


def test_friction_beyond_the_table_is_not_known() -> None:
    table, places = _table(_rows()), np.array([0.009, 0.01, 0.08, 0.0801])
    at: At = {"voltage_v": np.array(50.0), "place_m": places, "direction": "left"}
    assert np.isnan(table.friction(at)).tolist() == [True, False, False, True]
    assert np.isnan(table.friction({**at, "voltage_v": np.array(101.0)})).all()
    assert np.isnan(table.friction({**at, "direction": "up"})).all()


def test_a_column_that_is_not_there_has_no_effect_and_one_of_one_value_is_exact() -> None:
    table = _table([["force_n", "friction"], ["0.5", "0.3"]])
    at = {"force_n": np.array([0.5, 0.6]), "voltage_v": np.array(1e3)}
    np.testing.assert_allclose(table.friction(at), [0.3, np.nan], rtol=1e-12)
    assert float(_table([["friction"], ["0.3"]]).friction({})[0]) == pytest.approx(0.3)


def test_the_error_of_every_second_knot_is_that_of_the_table_without_it() -> None:
    places = (0.0, 0.1, 0.2, 0.3, 0.4)
    rows = [["place_m", "friction"], *([f"{x}", f"{np.exp(x * x)}"] for x in places)]
    # A parabola lies d² below the chord of its neighbours at distance d.
    assert _table(rows).left_out_error() == {"place_m": pytest.approx(0.01)}


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([], "line 1: a column friction is due, got none"),
        ([["place_m"]], "line 1: a column friction is due, got place_m"),
        ([["friction", "colour"]], "line 1: unknown column 'colour'; known: friction, voltage_v"),
        ([["friction", "friction"]], "line 1: column 'friction' stands twice"),
        ([["friction"]], "must have 1 to 1,000,000 rows of friction, got 0"),
        ([["friction"], ["0"]], "line 2, column friction: must lie in [0.001, 10], got 0"),
        ([["friction"], ["much"]], "line 2, column friction: a number is due, got 'much'"),
        ([["friction"], ["1e300"]], "line 2, column friction: must lie in [0.001, 10], got 1e+300"),
        ([["friction"], ["0,4"]], "a number is due, got '0,4'; write a point, not a comma"),
        ([["a;friction"], ["0;1"]], "is due, got a;friction; separate cells by commas"),
        ([["friction", "direction"], ["1", "Right"]], "must be right or left, got 'Right'"),
        ([["friction", "voltage_v"], ["1", "-5"]], "voltage_v: must lie in [0, 200], got -5"),
        ([["friction", "resonance_hz"], ["1", "0"]], "must lie in [20, 100000], got 0"),
        ([["friction"], ["nan"]], "line 2, column friction: a number is due, got 'nan'"),
        ([["friction", "beam"], ["1"]], "line 2: 2 cells are due, got 1"),
        (
            [["friction", "voltage_v"], ["1", "5"], ["2", "5"]],
            "line 3: voltage_v 5 stands twice",
        ),
        (
            [["friction", "voltage_v", "beam"], ["1", "5", "a"], ["2", "6", "b"]],
            "voltage_v 5, beam b is missing; every combination of values is due",
        ),
        (
            [["friction", "place_m", "resonance_hz"], ["1", "0", "90"], ["1", "1", "91"]],
            "column resonance_hz: must hold one value, got 2",
        ),
    ],
)
def test_a_table_with_a_mistake_is_refused_in_one_line(rows: list[list[str]], said: str) -> None:
    with pytest.raises(BadInput) as error:
        _table(rows)
    assert str(error.value).startswith("friction.csv")
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_small_table_of_a_vast_grid_is_refused_before_the_grid_is_made() -> None:
    names = ["voltage_v", "frequency", "place_m", "force_n", "speed_m_s"]
    rows = [[f"{0.1 + n / 1e4:.5f}"] * len(names) + ["0.4"] for n in range(2000)]
    with pytest.raises(BadInput, match="is missing; every combination of values is due"):
        _table([[*names, "friction"], *rows])
