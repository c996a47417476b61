"""Detection: changes reported with a signal (hits) and without (false alarms), d′ and criterion.

Equations (1) to (6) of docs/mathematics/detection.md. Both rates count the same event, a reported
change, because a false alarm has no direction that it could be right about.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv, betaln, ndtr, ndtri, stdtrit

from analysis.estimates import ENDS, UPPER, FloatArray, IntArray, Interval, NotEstimable, central

_STEPS = 128
_Z = ndtri((np.arange(_STEPS) + 0.5) / _STEPS)
"""Equally probable standard normal values: pairs of them stand for a joint distribution."""
_OF_TWO = NotEstimable("two people do not tell how hits and false alarms go together")
_WIDE = np.linspace(-1.5, 1.5, 3 * _STEPS) * _Z[-1]


@dataclass(frozen=True, kw_only=True)
class Rate:
    """Trials on which a change was reported, and their share with its 95% interval."""

    reported: int
    trials: int
    share: float
    share_interval: Interval


@dataclass(frozen=True, kw_only=True)
class Detection:
    """How well changes are told from no change, by one person or by several together.

    Of several people d′ and criterion are those of the average rates. `p` is of the exact test that
    nobody reports a change more often with a signal than without. How the rates of two people go
    together is not known from two, so that d′ and criterion have no interval then.
    """

    people: int
    hits: Rate
    false_alarms: Rate
    d_prime: float
    d_prime_interval: Interval | NotEstimable
    criterion: float
    criterion_interval: Interval | NotEstimable
    p: float


def detection(hits: IntArray, alarms: IntArray) -> Detection | NotEstimable:
    """Return d′, criterion, their intervals and the test, or why they are not estimable.

    People without trials of both kinds are left out, because they cannot be compared with
    themselves.

    `hits` has shape (people, 2), reported changes and trials with a signal; `alarms` the same of
    catch trials.

    >>> found = detection(np.array([[18, 20]]), np.array([[1, 4]]))
    >>> round(found.d_prime, 3), round(found.criterion, 3), round(found.p, 4)
    (1.704, -0.328, 0.0184)
    """
    both = (hits[:, 1] > 0) & (alarms[:, 1] > 0)
    hits, alarms = hits[both], alarms[both]
    if not both.any():
        return NotEstimable("nobody answered both trials with a signal and catch trials")
    people = len(hits)
    counts = np.array([hits.sum(axis=0), alarms.sum(axis=0)], dtype=np.float64)
    # (1): never 0 or 1, so that z is finite.
    z_hit, z_alarm = ndtri((counts[:, 0] + 0.5) / (counts[:, 1] + 1)).tolist()
    share, effective, together = _spread(np.stack([hits, alarms]), counts)
    # (4): Jeffreys's posterior of each rate, whose mean is (1) where one person answered.
    a, b = share * effective + 0.5, (1 - share) * effective + 0.5
    x = _z_of_rate(a[0], b[0], _Z)[:, None]
    # (5): the two rates of a cohort go together as those of its people do.
    w = together * _Z[:, None] + np.sqrt(1 - together**2) * _Z
    y = np.interp(w, _WIDE, _z_of_rate(a[1], b[1], _WIDE))
    ends = betaincinv(a[:, None], b[:, None], ENDS).tolist()
    rates = [
        Rate(
            reported=int(told),
            trials=int(trials),
            share=float(told / trials),
            # It holds a share of 0 or 1 (Brown, Cai and DasGupta 2001, section 4.1.1).
            share_interval=(0.0 if told == 0 else low, 1.0 if told == trials else high),
        )
        for (told, trials), (low, high) in zip(counts, ends, strict=True)
    ]
    return Detection(
        people=people,
        hits=rates[0],
        false_alarms=rates[1],
        d_prime=z_hit - z_alarm,
        d_prime_interval=_OF_TWO if people == 2 else central(x - y),
        criterion=-(z_hit + z_alarm) / 2,
        criterion_interval=_OF_TWO if people == 2 else central(-(x + y) / 2),
        p=float(noticed_p(hits[None], alarms[None])[0]),
    )


def _spread(each: IntArray, counts: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return the shares, how many independent trials they are worth, and how they go together.

    `each` has shape (2, people, 2): hits and false alarms.
    """
    told, trials = counts.T
    share, people = told / trials, each.shape[1]
    if people == 1:
        return share, trials, 0.0
    # (2): people differ, so that their trials together are worth less than as many of one person.
    off = (each[:, :, 0] - share[:, None] * each[:, :, 1]) / trials[:, None]
    variance = off @ off.T * people / (people - 1)
    own = np.where(np.diag(variance) > 0, np.diag(variance), share * (1 - share) / trials)
    known = own > 0
    effective = np.divide(share * (1 - share), own, out=trials.copy(), where=known)
    # Rounding can take a perfect correlation beyond 1.
    together = float(np.clip(variance[0, 1] / np.sqrt(own.prod()), -1, 1)) if known.all() else 0.0
    # (3): the spread of few people is itself uncertain, which t allows for (Korn and Graubard).
    return share, effective * float((ndtri(UPPER) / stdtrit(people - 1, UPPER)) ** 2), together


def _z_of_rate(a: float, b: float, z: FloatArray) -> FloatArray:
    """Return the normal deviates of a beta distribution's quantiles at those of `z`."""
    # From the nearer end, so that a rate close to 1 keeps its digits.
    low, high = ndtri(betaincinv(a, b, ndtr(z))), -ndtri(betaincinv(b, a, ndtr(-z)))
    return np.asarray(np.where(z < 0, low, high))


def noticed_p(hits: IntArray, alarms: IntArray) -> FloatArray:
    """Return p of the test that nobody reports a change more often with a signal, one-sided.

    (6): within each person every choice of the trials that had a signal is equally likely, so that
    the number of hits is hypergeometric; the cohort's is a sum of these. Exact. Counts are as for
    `detection`, for each of many studies: shape (studies, people, 2).
    """
    sums = np.ones((len(hits), 1))
    chances = _chances(hits[..., 1], alarms[..., 1], hits[..., 0] + alarms[..., 0])
    for person, most in enumerate(hits[..., 1].max(axis=0, initial=0).tolist()):
        sums = _added(sums, chances[:, person, : most + 1])
    at_least = np.arange(sums.shape[1]) >= hits[..., 0].sum(axis=1)[:, None]
    return np.asarray(np.minimum(np.where(at_least, sums, 0.0).sum(axis=1), 1.0))


def _chances(trials: IntArray, catches: IntArray, reports: IntArray) -> FloatArray:
    """Return the probability of 0, 1, … hits of so many reports, shape (studies, people, hits)."""
    x = np.arange(int(trials.max(initial=0)) + 1)
    n, m, k = trials[..., None], catches[..., None], reports[..., None]
    possible = (x <= n) & (x <= k) & (k - x <= m)
    x = np.where(possible, x, np.maximum(k - m, 0))
    chosen = _log_choose(n, x) + _log_choose(m, k - x) - _log_choose(n + m, k)
    return np.where(possible, np.exp(chosen), 0.0)


def _log_choose(of: IntArray, some: IntArray) -> FloatArray:
    return np.asarray(-np.log1p(of) - betaln(of - some + 1, some + 1))


def _added(sums: FloatArray, own: FloatArray) -> FloatArray:
    """Return the distribution of a sum of two independent counts, study by study."""
    made = np.zeros((len(sums), sums.shape[1] + own.shape[1] - 1))
    # Where catch trials are few, so are the numbers of hits that a person's reports allow.
    for count in np.flatnonzero(own.any(axis=0)):
        made[:, count : count + sums.shape[1]] += own[:, [count]] * sums
    return made
