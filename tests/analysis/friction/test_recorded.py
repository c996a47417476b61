"""Recordings as forces: blocks of the movement, zeros taken off, and reasons for none."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.friction.recorded import TouchForces, reduced, zero_drift_n_per_s
from protocol.journal.records import Recording

SCALE = (1e-4, 2e-4, 1e-5)
COUNT = 3000


def recording(
    tangential_n: FloatArray, normal_n: FloatArray, position_m: FloatArray, **changed: Any
) -> Recording:
    """Three seconds at 1 kHz, in the last two of which the finger moved."""
    values = np.stack([tangential_n, normal_n, position_m]) / np.array(SCALE)[:, None]
    known: dict[str, Any] = {
        "source": "board",
        "rate_hz": 1000.0,
        "first_s": 50.0,
        "scale": SCALE,
        "clock_offset_s": 100.0,
        "clock_error_s": 0.001,
        "moved_s": (151.0, 153.0),
        "tare_n": (0.02, -0.01),
        "saturated": 0,
    }
    counts = np.clip(np.round(values), -32_767, 32_767).astype("<i2").tobytes()
    return Recording.packed(counts, **{**known, **changed})


def steady(**changed: Any) -> Recording:
    one = np.ones(COUNT)
    return recording(0.22 * one, 0.49 * one, np.linspace(0.01, 0.04, COUNT), **changed)


def forces(found: Recording) -> TouchForces:
    known = reduced(found)
    assert isinstance(known, TouchForces)
    return known


def test_blocks_are_of_the_movement_with_the_zeros_taken_off() -> None:
    found = forces(steady())
    assert found.t_s[[0, -1]] == pytest.approx([0.012, 1.987])
    assert found.tangential_n == pytest.approx(np.full(80, 0.2))
    assert found.normal_n == pytest.approx(np.full(80, 0.5))
    assert found.vector_n == pytest.approx(np.full(80, np.hypot(0.2, 0.5)))
    assert found.friction == pytest.approx(np.full(80, np.log(0.4)))
    assert found.position_m[[0, -1]] == pytest.approx([0.0201, 0.0399], abs=1e-4)
    assert (found.zero_n, found.moved_s) == (0.02, 2.0)


def test_without_a_tare_forces_are_as_recorded() -> None:
    assert forces(steady(tare_n=None)).tangential_n[0] == pytest.approx(0.22)
    assert forces(steady(tare_n=None)).zero_n is None


def test_blocks_of_a_lifted_finger_and_of_a_sensor_at_its_limit_do_not_count() -> None:
    one = np.ones(COUNT)
    normal_n, tangential_n = 0.49 * one, 0.22 * one
    normal_n[1100:1150] = 0.0
    tangential_n[1200] = 10.0
    found = forces(recording(tangential_n, normal_n, 0.02 * one))
    assert len(found.t_s) == 77
    assert found.tangential_n == pytest.approx(np.full(77, 0.2))


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"moved_s": (152.9, 155.0)}, "moved for less than 0.2 s"),
        ({"tare_n": (0.02, 0.49)}, "no finger was on the beam"),
        ({"tare_n": (0.3, -0.01)}, "the tangential force was not positive"),
        ({"sha256": "0" * 64}, "samples differ from their digest"),
    ],
)
def test_a_recording_that_says_nothing_has_a_reason(changed: dict[str, Any], why: str) -> None:
    found = reduced(replace(steady(), **changed))
    assert isinstance(found, NotEstimable)
    assert why in found.reason


def test_a_sensor_at_its_limit_is_the_reason() -> None:
    one = np.ones(COUNT)
    found = reduced(recording(10 * one, 0.49 * one, 0.02 * one))
    assert found == NotEstimable("a sensor was at its limit")


def test_noise_and_stick_slip_are_told_apart() -> None:
    rng = np.random.default_rng(1)
    one, noise = np.ones(COUNT), rng.normal(0, 0.01, COUNT)
    slip = 0.02 * np.sin(2 * np.pi * 40 * np.arange(COUNT) / 1000)
    plain = forces(recording(0.22 + noise, 0.49 * one, 0.02 * one))
    assert np.sqrt(plain.noise_n2 * 25) == pytest.approx(0.01, rel=0.05)
    assert plain.stick_slip < 0.01
    slipping = forces(recording(0.22 + noise + slip, 0.49 * one, 0.02 * one))
    assert slipping.stick_slip == pytest.approx(0.02 / np.sqrt(2) / 0.2, rel=0.1)


def test_a_steady_drift_of_the_zeros_is_found_and_taken_off() -> None:
    one = np.ones(COUNT)
    drift = 0.0002
    touches = []
    for number in range(6):
        at_s = 100.0 + 10 * number
        zero = drift * (at_s - 0.25)
        held = 0.2 + drift * (at_s + np.arange(COUNT) / 1000)
        known = {"clock_offset_s": at_s - 50, "moved_s": (at_s + 1, at_s + 3)}
        touches.append(forces(recording(held, 0.5 * one, 0.02 * one, tare_n=(zero, 0.0), **known)))
    found = zero_drift_n_per_s(touches)
    assert found == pytest.approx(drift, rel=1e-3)
    assert touches[0].tangential_n.mean() > 0.2003
    # From the beginning of a touch to its end, or a ramp would be too large or too small.
    assert touches[0].with_drift(found).tangential_n == pytest.approx(0.2, abs=6e-5)
    assert zero_drift_n_per_s(touches[:3]) == 0.0
