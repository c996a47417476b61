"""Checks of the ratings: drift, carry-over, order effects, and answers to catch trials."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betaincinv, fdtrc, ndtri, stdtr, stdtrit

from analysis.estimates import FloatArray, IntArray, Interval, NotEstimable
from analysis.sensitivity.ratings import Ratings

_POOLED = NotEstimable(
    "trials of several subjects are pooled, and trials of one subject are not independent"
)


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Change of the rating per trial within subjects, adjusted for condition and subject."""

    points_per_trial: float
    interval: Interval
    df: int
    p: float


@dataclass(frozen=True, kw_only=True)
class FTest:
    """An F test of added effects."""

    f: float
    df: tuple[int, int]
    p: float


@dataclass(frozen=True, kw_only=True)
class Proportion:
    """A share of independent trials with its exact 95 % interval (Clopper and Pearson 1934)."""

    count: int
    trials: int
    share: float
    interval: Interval | NotEstimable


@dataclass(frozen=True, kw_only=True)
class Discrimination:
    """Changes reported with a signal (hits) and without, with d′ and criterion.

    Rates are (count + 0.5) / (trials + 1), which is never 0 or 1 (Hautus, Behavior Research
    Methods 27, 1995). d′ = z(hits) - z(false alarms), c = -(z(hits) + z(false alarms)) / 2.
    """

    hits: Proportion
    false_alarms: Proportion
    d_prime: float
    criterion: float


def drift(ratings: Ratings, position: IntArray) -> Drift | NotEstimable:
    """Return the slope of the rating on the trial's position, or why it is not estimable.

    Parameters:
        ratings: the trials.
        position: shape (trials,), place in the session, 1 for a subject's first trial.
    """
    scored = ~np.isnan(ratings.rating)
    trials, place = ratings.where(scored), position[scored].astype(np.float64)
    base = _fit(trials, _dummies(trials.condition))
    full = _fit(trials, np.column_stack([_dummies(trials.condition), place]))
    if full.rank == base.rank:
        return NotEstimable(
            "subject and condition determine the position, so drift cannot be separated"
        )
    if full.df < 1:
        return NotEstimable("there is no residual to test the drift against")
    slope = full.last_coefficient
    spread = np.sqrt(full.squares / full.df) / full.last_norm
    half = float(stdtrit(full.df, 0.975)) * spread
    p = 2 * stdtr(full.df, -abs(slope) / spread) if spread > 0 else 0.0
    ends = (slope - half, slope + half)
    return Drift(points_per_trial=slope, interval=ends, df=full.df, p=float(p))


def carry_over(ratings: Ratings, previous: IntArray) -> FTest | NotEstimable:
    """Return the test of the preceding trial's condition, or why it is not possible.

    Parameters:
        ratings: the trials.
        previous: shape (trials,), position of the preceding trial's condition; -1 for trials
            without a preceding one, which are left out.
    """
    followed = ~np.isnan(ratings.rating) & (previous >= 0)
    if not followed.any():
        return NotEstimable("no rated trial follows another")
    return _test_of(ratings.where(followed), previous[followed])


def order_effect(ratings: Ratings, position: IntArray) -> FTest | NotEstimable:
    """Return the test of the trial's position, as a factor, or why it is not possible."""
    scored = ~np.isnan(ratings.rating)
    if not scored.any():
        return NotEstimable("no trial was rated")
    return _test_of(ratings.where(scored), position[scored])


def proportion(count: int, trials: int) -> Proportion | NotEstimable:
    """Return the share of `count` in `trials` with its exact interval, or why it is undefined.

    Raises:
        ValueError: a count below 0 or above the number of trials.
    """
    if not 0 <= count <= trials:
        raise ValueError(f"count must lie in [0, {trials}], got {count}")
    if trials == 0:
        return NotEstimable("there were no such trials")
    low = float(betaincinv(count, trials - count + 1, 0.025)) if count > 0 else 0.0
    high = float(betaincinv(count + 1, trials - count, 0.975)) if count < trials else 1.0
    return Proportion(count=count, trials=trials, share=count / trials, interval=(low, high))


def discrimination(
    hits: tuple[int, int], false_alarms: tuple[int, int], *, people: int = 1
) -> Discrimination | NotEstimable:
    """Return d′ and criterion from (count, trials) of signal and of catch trials.

    Both count the same event: a change was reported. Trials pooled over several `people` have no
    intervals.

    >>> found = discrimination((18, 20), (1, 4))
    >>> round(found.d_prime, 3), round(found.criterion, 3)
    (1.704, -0.328)
    """
    hit, alarm = proportion(*hits), proportion(*false_alarms)
    if isinstance(hit, NotEstimable):
        return NotEstimable("there were no signal trials")
    if isinstance(alarm, NotEstimable):
        return NotEstimable("there were no catch trials")
    z_hit, z_alarm = (float(ndtri((p.count + 0.5) / (p.trials + 1))) for p in (hit, alarm))
    return Discrimination(
        hits=hit if people == 1 else replace(hit, interval=_POOLED),
        false_alarms=alarm if people == 1 else replace(alarm, interval=_POOLED),
        d_prime=z_hit - z_alarm,
        criterion=-(z_hit + z_alarm) / 2,
    )


@dataclass(frozen=True, kw_only=True)
class _Fit:
    squares: float
    rank: int
    df: int
    last_coefficient: float
    last_norm: float


def _test_of(trials: Ratings, group: IntArray) -> FTest | NotEstimable:
    """Return the test of `group` as a factor, adjusted for subject and condition."""
    condition = _dummies(trials.condition)
    without = _fit(trials, condition)
    with_effect = _fit(trials, np.column_stack([condition, _dummies(group)]))
    df = (with_effect.rank - without.rank, with_effect.df)
    if df[0] < 1:
        return NotEstimable("subject and condition determine the effect, so it cannot be separated")
    if df[1] < 1 or with_effect.squares <= 1e-20 * max(1.0, without.squares):
        return NotEstimable("there is no residual to test the effect against")
    f = (without.squares - with_effect.squares) / df[0] / (with_effect.squares / df[1])
    return FTest(f=f, df=df, p=float(fdtrc(*df, max(f, 0.0))))


def _dummies(group: IntArray) -> FloatArray:
    return np.asarray(group[:, None] == np.unique(group), dtype=np.float64)


def _fit(trials: Ratings, design: FloatArray) -> _Fit:
    """Return the least-squares fit of the design within subjects."""
    people, person, counts = np.unique(trials.subject, return_inverse=True, return_counts=True)
    values = np.column_stack([design, trials.rating])
    sums = np.zeros((len(people), values.shape[1]))
    np.add.at(sums, person, values)
    within = values - (sums / counts[:, None])[person]
    columns, y = within[:, :-1], within[:, -1]
    solution, _, rank, _ = np.linalg.lstsq(columns, y, rcond=1e-10)
    others = np.linalg.lstsq(columns[:, :-1], columns[:, -1], rcond=1e-10)[0]
    residual = y - columns @ solution
    last = columns[:, -1] - columns[:, :-1] @ others
    return _Fit(
        squares=float(residual @ residual),
        rank=int(rank),
        df=len(y) - int(rank) - len(people),
        last_coefficient=float(solution[-1]),
        last_norm=float(np.sqrt(last @ last)),
    )
