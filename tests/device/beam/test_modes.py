"""Mode shapes against 50 digits and against the laws that define them."""

import mpmath as mp
import numpy as np
import pytest

from device.beam.modes import mode_constants, mode_integral, mode_shape, mode_slope
from tests.device.beam import beam_reference as reference

INTERIOR = np.array([1e-6, 0.003, 0.11, 0.25, 0.4142, 0.5, 0.618, 0.77, 0.93, 0.999, 1.0])


@pytest.mark.parametrize("order", [*range(1, 13), 20, 33, 47, 60])
def test_shape_is_right_to_5e_14_of_the_tip(order: int) -> None:
    exact = [float(reference.shape(order, mp.mpf(float(xi)))) for xi in INTERIOR]
    assert np.abs(mode_shape(order, INTERIOR) - exact).max() < 2 * 5e-14


@pytest.mark.parametrize("order", [1, 2, 6, 27, 60])
def test_slope_and_integral_are_right(order: int) -> None:
    xis = [mp.mpf(float(xi)) for xi in INTERIOR]
    slopes = [float(reference.slope(order, xi)) for xi in xis]
    integrals = [float(reference.integral(order, xi)) for xi in xis]
    root = mode_constants(order).root
    assert np.abs(mode_slope(order, INTERIOR) - slopes).max() < 1e-13 * root
    assert np.abs(mode_integral(order, INTERIOR) - integrals).max() < 1e-13 / root


@pytest.mark.parametrize("order", range(1, 61))
def test_root_solves_the_frequency_equation(order: int) -> None:
    exact = float(reference.root(order))
    assert mode_constants(order).root == pytest.approx(exact, rel=4e-16, abs=0)


def test_a_clamp_neither_moves_nor_turns_and_the_tip_is_two() -> None:
    for order in (1, 2, 6, 60):
        assert abs(float(mode_shape(order, 0.0))) < 1e-15
        assert abs(float(mode_slope(order, 0.0))) < 1e-15 * mode_constants(order).root
        assert abs(float(mode_shape(order, 1.0))) == pytest.approx(2.0, abs=1e-13)


def test_mode_2000_is_finite_and_still_normalised() -> None:
    xi = np.linspace(0.0, 1.0, 400_001)
    shape = mode_shape(2000, xi)
    assert np.trapezoid(shape**2, xi) == pytest.approx(1.0, abs=1e-4)
    assert np.abs(shape).max() == pytest.approx(2.0, abs=1e-9)


def test_float32_places_are_computed_in_double() -> None:
    xi = np.array([0.25, 0.5, 0.75], dtype=np.float32)
    assert mode_shape(40, xi).dtype == np.float64
    assert (mode_shape(40, xi) == mode_shape(40, xi.astype(np.float64))).all()


@pytest.mark.parametrize("order", [0, -1, 2.5, float("nan")])
def test_a_mode_that_is_not_a_positive_whole_number_is_refused(order: float) -> None:
    with pytest.raises(ValueError, match=f"mode must be a whole number of at least 1, got {order}"):
        mode_constants(order)
