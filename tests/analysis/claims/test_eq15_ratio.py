"""Claims about Eqs 13 to 15: continuity, and the extremes of a/u."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.claims import equations
from tests.analysis.claims.conftest import Find


def test_two_jumps_contradict_a_steady_rise_and_fall(find: Find) -> None:
    found = find("eq15-continuous")
    assert found.verdict == "fails"
    jumps = found.computed["jumps"]
    assert jumps[[3, 5]] == pytest.approx([0.13, 0.26], abs=1e-6)
    assert np.delete(jumps, [3, 5]).max() < 1e-6


@pytest.mark.parametrize(("jump", "verdict"), [(0.0, "holds"), (0.01, "fails")])
def test_a_single_jump_decides(
    find: Find, monkeypatch: pytest.MonkeyPatch, jump: float, verdict: str
) -> None:
    def ratio(x_m: Any, *_: Any) -> Any:
        return np.asarray(x_m) + jump * (np.asarray(x_m) > 0.0231)

    monkeypatch.setattr(equations, "same_direction_ratio", ratio)
    assert find("eq15-continuous").verdict == verdict


def test_the_extremes_of_mode_6_are_those_of_its_own_wavelength(find: Find) -> None:
    largest, smallest = find("eq13-maximum"), find("eq14-minimum")
    assert largest.scope == (False, True)  # the first zone is longer than the later ones
    assert largest.details == smallest.details == (False,)  # 0.87 and 0.13
    assert smallest.scope == (True,)
    assert largest.computed["exact_for_mode_6"] == pytest.approx(
        {"first_segment": 0.9588, "from_30_to_81_mm": 0.9156}, abs=1e-4
    )


@pytest.mark.parametrize(
    ("swing", "largest", "smallest"), [(0.409, "partly", "partly"), (0.1, "fails", "fails")]
)
def test_the_verdict_on_the_extremes_moves_with_the_mode(
    find: Find, monkeypatch: pytest.MonkeyPatch, swing: float, largest: str, smallest: str
) -> None:
    def window(_: int, __: float, places_m: Any, *___: Any) -> Any:
        return SimpleNamespace(right=0.5 + swing * np.sin(2 * np.pi * places_m / 0.0182))

    monkeypatch.setattr(equations, "mode_window", window)
    assert find("eq13-maximum").verdict == largest
    assert find("eq13-maximum").scope == (largest != "fails",) * 2
    assert find("eq14-minimum").verdict == smallest


def test_the_range_of_fig_11_needs_the_higher_gamma(find: Find) -> None:
    found = find("fig11-range")
    assert found.verdict == "partly"
    assert found.computed["range_last"] == pytest.approx((0.0, 0.87), abs=1e-3)
    assert found.computed["range_first"][1] > 0.99
