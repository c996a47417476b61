"""Zones and windows of one mode against the closed form in 50 digits."""

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest

from device.beam.beam import Beam
from device.beam.driven import Fineness
from device.beam.fields import one_mode
from device.beam.pattern import Patterns
from device.beam.spectral import Mesh
from tests.device.beam import beam_reference as reference

LENGTH_M = 0.1
FINE = Fineness(Mesh(16, 3.5), 40, 0.1)


def _pattern(order: int, fineness: Fineness = FINE) -> Patterns:
    """Return the pattern of a mode of the paper's bare beam."""
    pattern = one_mode(Beam(), order, fineness, built=False).shape.patterns
    return replace(pattern, of=np.zeros(1, dtype=np.intp))


def _edges_m(pattern: Patterns) -> list[float]:
    """Return where the direction turns."""
    start_m, moves_right = pattern.pieces[:, 0], pattern.pieces[:, 1]
    turns = np.flatnonzero(np.diff(moves_right)) + 1
    return [float(edge) for edge in start_m[turns]]


@pytest.mark.parametrize("order", [1, 2, 3, 6, 13, 31])
def test_zones_turn_at_nodes_and_antinodes(order: int) -> None:
    exact = [float(edge) * LENGTH_M for edge in reference.edges(order)[1:-1]]
    np.testing.assert_allclose(_edges_m(_pattern(order)), exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("contact_m", [1e-9, 1e-7, 1e-5, 3e-4, 1e-3, 5e-3, 1e-2, 3e-2, 0.1])
@pytest.mark.parametrize("order", [1, 2, 6, 27])
def test_fractions_and_integrals_are_right_at_every_edge(order: int, contact_m: float) -> None:
    edges = np.array([float(edge) * LENGTH_M for edge in reference.edges(order)[1:]])
    ends = np.concatenate([edges, [1e-10, 3.7e-4, 0.0414, 0.0777]])
    if order > 20:
        ends = ends[:: order // 10]
    ours = _pattern(order).window(ends, contact_m)
    for k, end in enumerate(ends.tolist()):
        right, area = reference.window(order, LENGTH_M, end, contact_m)
        covered_m = min(contact_m, end)
        rounding = 3e-12 / covered_m  # of the place of an edge
        assert abs(float(ours.right[k]) - right) <= 1e-12 + min(rounding, 1.0) * (end > 1e-9)
        mean = area / (mp.mpf(covered_m) / mp.mpf(LENGTH_M))
        assert abs(float(ours.mean[k]) - mean) < 1e-10 + 1e-16 / covered_m


def test_the_window_at_the_clamp_is_all_left_with_zero_motion() -> None:
    window = _pattern(6).window(np.zeros(1), 0.01)
    assert (window.right[0], window.left[0], window.mean[0]) == (0.0, 1.0, 0.0)


def test_window_fractions_are_continuous_in_x() -> None:
    places = np.linspace(0.0, LENGTH_M, 20_001)
    window = _pattern(6).window(places, 0.01)
    assert np.abs(np.diff(window.right)).max() <= 5e-6 / 0.01 * 1.5
    assert (window.right + window.left == 1.0).all()


def test_the_whole_beam_in_mode_6_moves_right_on_0_4489_of_its_length() -> None:
    pattern = _pattern(6)
    assert pattern.whole().right[0] == pytest.approx(0.4489, abs=5e-5)
    over_all = pattern.window(np.array([LENGTH_M]), LENGTH_M)
    assert pattern.whole().mean[0] == over_all.mean[0]
    exact = reference.window(6, LENGTH_M, LENGTH_M, LENGTH_M)
    assert pattern.whole().mean[0] == pytest.approx(float(exact[1]), rel=1e-11)


@pytest.mark.parametrize("parts", [3, 40])
def test_windows_side_by_side_add_up(parts: int) -> None:
    pattern, ends = _pattern(4), np.linspace(0.0, LENGTH_M, parts + 1)[1:]
    window = pattern.window(ends, np.diff(ends, prepend=0.0))
    whole = pattern.whole()
    assert window.right.mean() == pytest.approx(whole.right[0], abs=1e-12)
    assert window.mean.mean() == pytest.approx(whole.mean[0], rel=1e-12)


def test_the_tip_of_a_cantilever_moves_by_twice_the_rms() -> None:
    for order in (1, 6, 20):
        assert one_mode(Beam(), order, built=False).peak_ratio == pytest.approx(2.0, rel=1e-9)
