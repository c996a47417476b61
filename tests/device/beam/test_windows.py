"""Zone edges and windows against 50 digits, down to windows of a nanometre."""

import mpmath as mp
import numpy as np
import pytest

from device.beam.windows import mode_window, window_width
from device.beam.zones import zones
from tests.device.beam import beam_reference as reference

LENGTH_M = 0.1


@pytest.mark.parametrize("order", [2, 3, 6, 13, 31, 60])
def test_zone_edges_are_right_to_2_ulp(order: int) -> None:
    exact = [edge * mp.mpf(LENGTH_M) for edge in reference.edges(order)]
    for ours, edge in zip(zones(order, LENGTH_M).edges_m, exact, strict=True):
        assert abs(mp.mpf(float(ours)) - edge) <= 2 * np.spacing(ours)


@pytest.mark.parametrize("contact_m", [1e-9, 1e-7, 1e-5, 3e-4, 1e-3, 5e-3, 1e-2, 3e-2, 0.1])
@pytest.mark.parametrize("order", [1, 2, 6, 27, 60])
def test_fractions_and_integrals_are_right_at_every_edge(order: int, contact_m: float) -> None:
    ends = np.concatenate([zones(order, LENGTH_M).edges_m[1:], [1e-10, 3.7e-4, 0.0414, 0.0777]])
    if order > 20:
        ends = ends[:: order // 10]
    width = window_width(ends, contact_m)
    ours = mode_window(order, LENGTH_M, ends, width)
    for k, end in enumerate(ends.tolist()):
        right, area = reference.window(order, LENGTH_M, end, contact_m)
        fraction_error = max(1e-13, 4 * float(np.spacing(end)) / contact_m)
        assert abs(mp.mpf(float(ours.right[k])) - right) <= fraction_error
        covered = min(mp.mpf(contact_m), mp.mpf(end)) / mp.mpf(LENGTH_M)
        assert abs(mp.mpf(float(ours.mean[k])) * covered / area - 1) < 1e-12


def test_the_window_at_the_clamp_is_all_left_with_zero_motion() -> None:
    window = mode_window(6, LENGTH_M, np.zeros(1), np.zeros(1))
    assert (window.right[0], window.left[0], window.mean[0]) == (0.0, 1.0, 0.0)


def test_window_fractions_are_continuous_in_x() -> None:
    places = np.linspace(0.0, LENGTH_M, 20_001)
    right = mode_window(6, LENGTH_M, places, window_width(places, 0.01)).right
    assert np.abs(np.diff(right)).max() <= 5e-6 / 0.01 * 1.5


def test_mode_2000_has_its_zones_and_a_window_over_all_of_them() -> None:
    here = zones(2000, LENGTH_M)
    assert here.edges_m.size == 2 * 1999 + 2
    assert (np.diff(here.edges_m) > 0).all()
    whole = mode_window(2000, LENGTH_M, np.array([LENGTH_M]), np.array([LENGTH_M]))
    assert whole.right[0] == pytest.approx(0.5, abs=1e-3)
    assert whole.mean[0] == pytest.approx(2 * np.sqrt(2) / np.pi, abs=1e-3)


def test_the_whole_beam_in_mode_6_moves_right_on_0_4489_of_its_length() -> None:
    whole = mode_window(6, LENGTH_M, np.array([LENGTH_M]), np.array([LENGTH_M]))
    assert whole.right[0] == pytest.approx(0.4489, abs=5e-5)
