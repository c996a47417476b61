"""Whether responses follow the predicted contrasts: slopes over conditions, and within them.

Numbers of equations are those of docs/mathematics/response.md.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import permutations
from math import ceil

import numpy as np
from scipy.special import stdtr, stdtrit

from analysis.estimates import (
    LEVEL,
    UPPER,
    BoolArray,
    FloatArray,
    IntArray,
    Interval,
    NotEstimable,
)
from analysis.statistics.omnibus import SEED

MOST_CONDITIONS = 8
"""Up to this many, all orders of the contrasts are listed; of more, `SHUFFLES` are drawn."""
SHUFFLES = 20_000
FEWEST_CONDITIONS = 3
"""Two conditions have two orders, whose slopes differ in sign alone."""


@dataclass(frozen=True, kw_only=True)
class Slope:
    """Slope of mean responses on the conditions' predicted contrasts, common to all people.

    `value` is in points per unit of contrast. `p` is the share of the `assignments` of contrasts to
    conditions whose slope is at least as far from 0: of all of them, or of random ones, with the
    Monte Carlo `error`. `interval` has the slopes that the same test does not reject at 5%;
    `least_p` is the smallest p that these contrasts can have, whatever the responses: theirs is not
    the only order with the largest slope if contrasts are equal or evenly spaced.
    """

    value: float
    interval: Interval | NotEstimable
    p: float
    error: float
    assignments: int
    conditions: int
    people: int
    least_p: float


def slope(responses: FloatArray, contrasts: FloatArray) -> Slope | NotEstimable:
    """Return the slope with its test, or why there is none.

    (1): the slope is the least-squares one about each person's own mean. That conditions differ is
    no evidence for it: under the hypothesis the contrasts belong to the conditions in any order, so
    that (2) each order of the contrasts is as likely as theirs. (3): a slope is in the interval if
    what it leaves of the responses passes the test. p is two-sided: without a question nothing is
    expected of the sign.

    Args:
        responses: mean responses, shape (people, conditions), NaN where there is none.
        contrasts: predicted ones, shape (conditions,), NaN where nothing is predicted.

    >>> round(slope(np.array([[1.0, 2, 4], [0, 2, 3]]), np.array([0.1, 0.2, 0.3])).value, 9)
    15.0
    """
    kept = np.isfinite(contrasts) & ~np.isnan(responses).all(axis=0)
    responses, contrasts = responses[:, kept], contrasts[kept]
    given = ~np.isnan(responses)
    compared = given.sum(axis=1) > 1
    responses, given = responses[compared], given[compared]
    if len(contrasts) < FEWEST_CONDITIONS:
        return NotEstimable(
            f"at least {FEWEST_CONDITIONS} conditions with a predicted contrast are needed, got "
            f"{len(contrasts)}"
        )
    if np.ptp(contrasts) < 1e-9:
        return NotEstimable("the same contrast is predicted of all conditions")
    if not len(responses):
        return NotEstimable("nobody answered two conditions")
    orders = _orders(tuple(contrasts.tolist()))
    with_responses, with_itself, with_first = _products(orders, responses, given)
    if with_itself[0] < 1e-12:
        return NotEstimable("nobody answered two conditions with different contrasts")
    if not (np.nanmax(responses, axis=1) - np.nanmin(responses, axis=1) > 1e-9).any():
        return NotEstimable("everybody's responses are the same in all conditions")
    # Relative to the spread in each order, so that an order is not larger because somebody lacks a
    # condition that has the extreme contrast there.
    scale = np.sqrt(np.maximum(with_itself, 1e-300) * with_itself[0])
    slopes, likeness = with_responses / scale, with_first / scale
    extreme = np.abs(slopes) >= abs(slopes[0]) * (1 - 1e-9) - 1e-12
    p = float(extreme.mean())
    exact = len(contrasts) <= MOST_CONDITIONS
    return Slope(
        value=float(slopes[0]),
        interval=_interval(slopes, likeness),
        p=p,
        error=0.0 if exact else float(np.sqrt(p * (1 - p) / len(orders))),
        assignments=len(orders),
        conditions=len(contrasts),
        people=len(responses),
        least_p=float((np.abs(likeness) > _ALIKE).mean()),
    )


@lru_cache(maxsize=8)
def _orders(contrasts: tuple[float, ...]) -> FloatArray:
    """Return the contrasts in each order, or in random ones, shape (orders, conditions).

    The first order is theirs.
    """
    if len(contrasts) <= MOST_CONDITIONS:
        return np.array(list(permutations(contrasts)))
    rows = np.tile(np.array(contrasts), (SHUFFLES, 1))
    # Theirs is one of them, so that no p is 0 (Phipson and Smyth 2010).
    rows[1:] = np.random.default_rng(SEED).permuted(rows[1:], axis=1)
    return rows


def _products(
    orders: FloatArray, responses: FloatArray, given: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return of each order its sum of products with responses, with itself, and with the first.

    All are about people's own means, over the conditions that each has; shape (orders,). `orders`
    has shape (orders, conditions), `responses` and `given` (people, conditions).
    """
    patterns, pattern_of_person = np.unique(given, axis=0, return_inverse=True)
    with_responses, with_itself, with_first = np.zeros((3, len(orders)))
    for number, pattern in enumerate(patterns):
        answers = responses[pattern_of_person.ravel() == number][:, pattern]
        centred = orders[:, pattern] - orders[:, pattern].mean(axis=1, keepdims=True)
        with_responses += centred @ (answers - answers.mean(axis=1, keepdims=True)).sum(axis=0)
        with_itself += len(answers) * (centred**2).sum(axis=1)
        with_first += len(answers) * (centred @ centred[0])
    return with_responses, with_itself, with_first


_ALIKE = 1 - 1e-9
"""Contrasts whose likeness is beyond it are equal, or mirror images, but for rounding."""


def _interval(slopes: FloatArray, likeness: FloatArray) -> Interval | NotEstimable:
    """Return the slopes that the test does not reject.

    (4): an order counts against a slope b where |s - b l| >= |s_1 - b|, with the order's own slope
    s and its likeness l to the first one: between (s_1 - s) / (1 - l) and (s_1 + s) / (1 + l).
    """
    first = slopes[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(first - slopes) / (1 - likeness), (first + slopes) / (1 + likeness)])
    # The same order of contrasts, or the reverse one, leaves every slope as likely as it was.
    alike = np.abs(likeness) > _ALIKE
    low = np.where(alike, -np.inf, ends.min(axis=0))
    high = np.where(alike, np.inf, ends.max(axis=0))
    # A slope of which p is .05 itself is not rejected, as in the test.
    outside = ceil(LEVEL * len(slopes) - 1e-9) - 1
    low_end, high_end = np.sort(low)[outside], np.sort(high)[len(high) - 1 - outside]
    if not np.isfinite([low_end, high_end]).all():
        return NotEstimable("these contrasts have too few orders for an interval")
    return float(low_end), float(high_end)


# Levels: the same question within each condition, where no condition's own nature enters.


@dataclass(frozen=True, kw_only=True)
class LevelSlope:
    """Slope of responses on contrasts within conditions, common to all people, by a t test."""

    value: float
    interval: Interval | NotEstimable
    p: float
    people: int


def level_slope(
    responses: FloatArray, contrasts: FloatArray, person: IntArray, condition: IntArray
) -> LevelSlope | NotEstimable:
    """Return the slope within conditions, or why there is none.

    (5): the least-squares slope about each person's means of each condition, so that a person
    counts by how far the own contrasts are apart; its error is that of people's departures from it.
    With the same contrasts it is the mean of people's slopes, with their t test. Arrays have shape
    (trials,), of trials with a response and a prediction.

    >>> level_slope(np.array([1.0, 3, 2, 5]), np.array([0.1, 0.2, 0.1, 0.2]),
    ...             np.array([0, 0, 1, 1]), np.zeros(4, np.int64)).people
    2
    """
    people = int(person.max(initial=-1)) + 1
    cell = condition * people + person
    size = np.maximum(np.bincount(cell), 1)
    x, y = (values - (np.bincount(cell, values) / size)[cell] for values in (contrasts, responses))
    spread, products = np.bincount(person, x**2, people), np.bincount(person, x * y, people)
    count = int((spread > 1e-12).sum())
    if count < 2:
        return NotEstimable(
            "at least 2 people with several levels of a condition, and contrasts of them, are "
            f"needed, got {count}"
        )
    value = float(products.sum() / spread.sum())
    departures = products - value * spread
    error = float(np.sqrt(count / (count - 1) * (departures**2).sum()) / spread.sum())
    if error < 1e-12:
        return NotEstimable("everybody has the same slope")
    half = float(stdtrit(count - 1, UPPER)) * error
    return LevelSlope(
        value=value,
        interval=(value - half, value + half),
        p=float(2 * stdtr(count - 1, -abs(value / error))),
        people=count,
    )


# Gains of single people, by their own trials alone.


def own_gains(
    responses: FloatArray, contrasts: FloatArray, person: IntArray, people: int
) -> FloatArray:
    """Return each person's least-squares slope of responses on contrasts, shape (people,).

    It is NaN where contrasts do not vary. Nothing is borrowed from other people, as the gains of
    a model are, which would draw groups of people together. Arrays have shape (trials,), of trials
    with a response and a prediction.

    >>> own_gains(np.array([1.0, 3, 4]), np.array([0.0, 1, 1]), np.array([0, 0, 1]), people=2)
    array([ 2., nan])
    """

    def total(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(person, values, people), np.float64)

    count, x, xx = total(np.ones_like(contrasts)), total(contrasts), total(contrasts**2)
    spread = count * xx - x**2
    known = spread > 1e-12 * count * xx
    products = count * total(contrasts * responses) - x * total(responses)
    gains = np.full(people, np.nan)
    gains[known] = products[known] / spread[known]
    return gains
