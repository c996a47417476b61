"""Contrasts that borrow from others: smaller errors, honest ones, and slopes that are not flat."""

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.friction.measured_contrast import borrowed_contrasts

PEOPLE, MEANS = 20, np.repeat([0.05, 0.1, 0.2, 0.4, 0.1], 4)
CONDITION = np.repeat(np.arange(5), 4)
LEVEL = np.tile([0.25, 0.6, 1.2, 2.0], 5)


def drawn(
    seed: int, error: float, scatter: float = 0.005
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """True and measured contrasts of people whose skin differs, and whose trials these are."""
    rng = np.random.default_rng([9, seed])
    skin = np.exp(rng.normal(0, 0.35, PEOPLE))
    true = np.outer(skin, MEANS * (0.5 + LEVEL)).ravel()
    true += rng.normal(0, scatter, true.size)
    return true, true + rng.normal(0, error, true.size), np.repeat(np.arange(PEOPLE), len(MEANS))


def borrowed(
    measured: FloatArray, subject: np.ndarray, error: float
) -> tuple[FloatArray, FloatArray]:
    return borrowed_contrasts(
        subject,
        np.tile(CONDITION, PEOPLE),
        np.tile(LEVEL, PEOPLE),
        measured,
        np.full(measured.size, error),
    )


@pytest.mark.parametrize("error", [0.012, 0.05])
def test_borrowing_makes_errors_smaller_and_states_them(error: float) -> None:
    rows = []
    for seed in range(10):
        true, measured, subject = drawn(seed, error)
        values, errors = borrowed(measured, subject, error)
        rows.append([((values - true) ** 2).mean(), (((values - true) / errors) ** 2).mean()])
    square, score = np.mean(rows, axis=0)
    assert np.sqrt(square) < 0.7 * error
    # The least scatter is what the trials could not show, so that stated errors are too large.
    assert 0.6 < np.sqrt(score) < 1.2


def test_a_line_on_borrowed_contrasts_is_not_flatter() -> None:
    slopes = []
    for seed in range(10):
        true, measured, subject = drawn(seed, 0.1)
        values, _ = borrowed(measured, subject, 0.1)
        slopes.append([np.polyfit(x, true, 1)[0] for x in (measured, values)])
    flat, right = np.mean(slopes, axis=0)
    assert flat < 0.9
    assert right == pytest.approx(1.0, abs=0.04)


def test_one_person_has_nobody_to_borrow_from() -> None:
    true, measured, _ = drawn(1, 0.012)
    chosen = slice(0, len(MEANS))
    values, _ = borrowed_contrasts(
        np.zeros(len(MEANS), dtype=np.int64),
        CONDITION,
        LEVEL,
        measured[chosen],
        np.full(len(MEANS), 0.012),
    )
    assert np.abs(values - measured[chosen]).max() < 0.012
    assert np.sqrt(((values - true[chosen]) ** 2).mean()) < 0.02
