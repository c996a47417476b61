"""Measured contrasts: exact without noise, honest errors with it, and reasons for none."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.estimates import FloatArray, NotEstimable
from analysis.friction.measured_contrast import (
    MeasuredContrast,
    Rest,
    TouchPair,
    measured_contrast,
    rest_of,
)
from analysis.friction.recorded import LAGS, Jitter, TouchForces, touch_measures
from protocol.study.study_question import Effect

QUIET = Jitter(autocovariances=np.zeros(LAGS + 1))
BLOCKS = 80
PATH_M = np.linspace(0.0105, 0.0805, BLOCKS)
NO_REST = NotEstimable("the session has no recorded touch of the resting beam")


def touch(
    friction: FloatArray, position_m: FloatArray | None = None, **changed: Any
) -> TouchForces:
    """A touch of 2 s with this ln μ by block, at a normal force of 0.5 N."""
    normal_n = np.full(BLOCKS, 0.5)
    tangential_n = normal_n * np.exp(friction)
    made = TouchForces(
        t_s=np.linspace(0.0125, 1.9875, BLOCKS),
        position_m=np.full(BLOCKS, 0.04) if position_m is None else position_m,
        tangential_n=tangential_n,
        normal_n=normal_n,
        vector_n=np.hypot(tangential_n, normal_n),
        moved_s=2.0,
        noise_n2=0.0,
        tare_n2=0.0,
        zero_n=0.0,
        zero_s=0.0,
        touched_s=3.0,
        stick_slip=0.0,
        saturated=0,
    )
    return replace(made, **changed)


def held(mu: float, **changed: Any) -> TouchForces:
    return touch(np.full(BLOCKS, np.log(mu)), **changed)


def compared(
    before: TouchForces | None,
    after: TouchForces,
    effect: Effect = "friction",
    *,
    along_path: bool = False,
    contrary: bool = False,
    within: bool = False,
) -> TouchPair:
    return TouchPair(
        effect=effect,
        contrary=contrary,
        before=before,
        after=after,
        along_path=along_path,
        contact_m=0.01,
        within=within,
    )


def contrast(
    what: TouchPair, jitter: Jitter = QUIET, rest: Rest | NotEstimable = NO_REST
) -> MeasuredContrast:
    found = measured_contrast(what, jitter, rest)
    assert isinstance(found, MeasuredContrast), found
    return found


def test_friction_at_a_place_is_compared_between_touches() -> None:
    first, last = held(0.4, tare_n2=1e-6), held(0.3)
    found = contrast(compared(first, last))
    assert found.value == pytest.approx(np.log(0.4 / 0.3))
    contrary = contrast(compared(first, last, contrary=True))
    assert (contrary.value, contrary.error) == (-found.value, found.error)


def test_harder_pressing_is_no_change_of_friction() -> None:
    harder = held(0.4)
    harder = replace(harder, tangential_n=1.5 * harder.tangential_n, normal_n=1.5 * harder.normal_n)
    found = contrast(compared(held(0.4), harder))
    assert found.value == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("effect", ["friction", "places", "depth"])
def test_the_gain_of_the_sensor_cancels(effect: Effect) -> None:
    swings = 0.3 * np.sin(700 * PATH_M), -0.2 * np.sin(700 * PATH_M)
    touches = [touch(np.log(0.4) + swing, PATH_M) for swing in swings]
    resting = held(0.4)
    found = []
    for gain in (1.0, 1.1):
        first, last, rest = (
            replace(it, tangential_n=gain * it.tangential_n) for it in (*touches, resting)
        )
        known = rest_of([rest], QUIET)
        found.append(contrast(compared(first, last, effect, along_path=True), rest=known).value)
    assert found[0] == pytest.approx(found[1])


def test_swapped_places_and_growth_of_a_swing_are_root_mean_squares_over_the_path() -> None:
    swing = np.sin(2 * np.pi * (PATH_M - PATH_M[0]) / (PATH_M[-1] - PATH_M[0]))
    first, last = (touch(np.log(0.4) + size * swing, PATH_M) for size in (0.1, -0.3))
    places = contrast(compared(first, last, "places", along_path=True))
    assert places.value == pytest.approx(0.4 / np.sqrt(2), rel=0.02)
    rest = rest_of([held(0.4)], QUIET)
    depth = contrast(compared(first, last, "depth", along_path=True), rest=rest)
    assert depth.value == pytest.approx(0.2 / np.sqrt(2), rel=0.02)
    alone = contrast(compared(None, last, "depth", along_path=True), rest=rest)
    assert alone.value == pytest.approx(0.3 / np.sqrt(2), rel=0.02)


MOMENTS: FloatArray = np.linspace(0.00625, 0.99375, BLOCKS)


@pytest.mark.parametrize("shape", [MOMENTS, MOMENTS**2, MOMENTS**3 - 4 * MOMENTS**2 + 4 * MOMENTS])
def test_a_ramp_is_measured_between_its_ends_whatever_its_shape(shape: FloatArray) -> None:
    ramp = touch(np.log(0.4) - 0.5 * shape)
    assert contrast(compared(None, ramp, within=True)).value == pytest.approx(0.5)


def test_the_error_of_a_ramp_is_that_of_repeated_measurements() -> None:
    rng = np.random.default_rng(6)
    jitter = Jitter(autocovariances=WHITE**2 * np.eye(LAGS + 1)[0])
    found = [
        contrast(compared(None, noisy(np.asarray(-0.3 * MOMENTS**2), rng), within=True), jitter)
        for _ in range(300)
    ]
    errors = np.array([it.value - 0.3 for it in found]) / np.array([it.error for it in found])
    assert errors.mean() == pytest.approx(0, abs=0.15)
    assert errors.std() == pytest.approx(1, abs=0.1)


def test_a_touch_of_its_own_is_compared_with_the_resting_beam() -> None:
    rest = rest_of([held(0.42), held(0.38)], QUIET)
    assert isinstance(rest, Rest)
    found = contrast(compared(None, held(0.3)), rest=rest)
    assert found.value == pytest.approx(np.log(np.sqrt(0.42 * 0.38) / 0.3))
    assert measured_contrast(compared(None, held(0.3)), QUIET, NO_REST) == NO_REST
    assert rest_of([], QUIET) == NO_REST


def test_what_cannot_be_compared_has_a_reason() -> None:
    ramp = compared(held(0.4), held(0.3), within=True)
    found = measured_contrast(ramp, QUIET, NO_REST)
    assert isinstance(found, NotEstimable)
    assert "after another touch" in found.reason
    apart = compared(
        touch(np.zeros(BLOCKS), PATH_M), touch(np.zeros(BLOCKS), PATH_M + 0.08), along_path=True
    )
    found = measured_contrast(apart, QUIET, NO_REST)
    assert isinstance(found, NotEstimable)
    assert "the same path twice" in found.reason
    path = compared(held(0.4), held(0.3), "depth", along_path=True)
    assert isinstance(measured_contrast(path, QUIET, NO_REST), NotEstimable)


WHITE = 0.05


def noisy(level: FloatArray, rng: np.random.Generator) -> TouchForces:
    return touch(np.log(0.4) + level + rng.normal(0, WHITE, BLOCKS), PATH_M)


@pytest.mark.parametrize("effect", ["friction", "places", "depth"])
def test_errors_are_those_of_repeated_measurements_and_squares_are_without_bias(
    effect: Effect,
) -> None:
    rng = np.random.default_rng(5)
    swing = np.sin(2 * np.pi * (PATH_M - PATH_M[0]) / (PATH_M[-1] - PATH_M[0]))
    jitter = Jitter(autocovariances=WHITE**2 * np.eye(LAGS + 1)[0])
    rest = rest_of([held(0.4)], QUIET)
    found = [
        contrast(
            compared(noisy(0.1 * swing, rng), noisy(-0.3 * swing, rng), effect, along_path=True),
            jitter,
            rest,
        )
        for _ in range(300)
    ]
    values = np.array([it.value for it in found])
    first, last = (touch(np.log(0.4) + size * swing, PATH_M) for size in (0.1, -0.3))
    true = contrast(compared(first, last, effect, along_path=True), rest=rest).value
    assert values.mean() == pytest.approx(true, abs=0.003)
    errors = np.array([it.error for it in found])
    assert np.sqrt((errors**2).mean()) == pytest.approx(values.std(), rel=0.15)


def test_a_zero_that_is_not_well_known_adds_to_the_error() -> None:
    first, last = held(0.4, tare_n2=1e-6), held(0.2, tare_n2=4e-6)
    found = contrast(compared(first, last))
    assert found.error == pytest.approx(np.hypot(0.001 / 0.2, 0.002 / 0.1))


def test_the_measures_of_a_touch() -> None:
    sliding = touch(np.full(BLOCKS, np.log(0.4)), np.linspace(0.01, 0.089, BLOCKS))
    found = touch_measures(sliding, Jitter(autocovariances=WHITE**2 * np.eye(LAGS + 1)[0]))
    assert found.friction == pytest.approx(0.4)
    assert found.friction_error == pytest.approx(0.4 * WHITE / np.sqrt(BLOCKS))
    assert found.speed_m_s == pytest.approx(0.04)
    assert found.normal_n == pytest.approx(0.5)
    assert found.vector_n == pytest.approx(np.hypot(0.2, 0.5))
    assert found.rate_n_per_s == pytest.approx(0.0)
    ramp = touch(np.log(0.4 + 0.1 * np.arange(BLOCKS) / BLOCKS))
    assert touch_measures(ramp, QUIET).rate_n_per_s == pytest.approx(0.05 / 2)
