"""The paper's nine people: Table 4, its tests, and the contrasts that a law predicts."""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from scipy.special import chdtri, fdtrc, fdtri

from analysis.estimates import LEVEL, LOWER, UPPER, FloatArray, ScoreTable
from analysis.statistics.signed_rank import pairwise_signed_ranks
from device.friction.changes import CONDITIONS, predicted_contrast
from handbook.paper.claim import Outcome, judged

NAMES = ("frequency", "structure", "voltage", "direction", "pressure")
_ROWS = """
10  8 10 10  5
10 10 10  8  7
 8  8  8  7  4
10 10 10 10  8
 8  8 10  8  5
 8 10 10 10  7
 7 10  9  8  7
 7  8 10  7  8
 8  8 10  7  5
"""
SCORES = np.array([row.split() for row in _ROWS.strip().splitlines()], dtype=np.float64)
"""Table 4: subjects 1 to 9 in rows, the conditions in columns."""
TABLE = ScoreTable(subjects=tuple("123456789"), conditions=NAMES, scores=SCORES)
MEANS = dict(zip(NAMES, SCORES.mean(axis=0).tolist(), strict=True))
COMPREHENSIVE = SCORES.mean(axis=1)
PAIRS = pairwise_signed_ranks(TABLE)
P_HOLM: dict[frozenset[str], Any] = {frozenset((pair.a, pair.b)): pair.p_holm for pair in PAIRS}


def above(one: str, other: str) -> bool | None:
    """Return whether people scored a condition above another; None where p after Holm is .05."""
    # Means that contradict the claim need no test.
    if MEANS[one] <= MEANS[other]:
        return False
    return True if P_HOLM[frozenset((one, other))] < LEVEL else None


@cache
def contrasts(law: str) -> dict[str, float]:
    """Return a law's contrast of each condition, largest first."""
    by_name = {name: predicted_contrast(CONDITIONS[name], law) for name in NAMES}
    return dict(sorted(by_name.items(), key=lambda item: -item[1]))


def scored_above(law: str, tops: Sequence[str], others: Sequence[str], agrees: bool) -> Outcome:
    """Return whether people scored the `tops` above the `others`, and the law agrees."""
    pairs = [(top, other) for top in tops for other in others if top != other]
    p = {f"{top} > {other}": P_HOLM[frozenset((top, other))] for top, other in pairs}
    return judged([above(*pair) for pair in pairs], agrees, p_holm=p, contrasts=contrasts(law))


def as_printed(values: Sequence[float], printed: Sequence[float], digits: int) -> Outcome:
    """Return whether each of the values rounds to the printed one."""
    close = np.abs(np.round(np.add(values, 1e-9), digits) - printed) < 1e-9
    return judged(close, values=values)


def gain_spread(scores: FloatArray, x: FloatArray) -> dict[str, Any]:
    """Return the F test of equal gains, their mean, and the 95% interval of their SD.

    Gains are people's slopes on `x`, given effects of people and of conditions. Let S be the sum of
    squares of the slopes of the residuals, and Q = Σ(x - x̄)². With gains of SD τ and residuals of
    variance σ², F is 1 + τ²Q/σ² times an F variable. The limits of τ² are S(1 - q/F)/(Qc), q and c
    the same quantile of F and of chi-square, and 0 below that (Williams, Biometrika 49, 1962).
    """
    centred = x - x.mean()
    information = float(centred @ centred)
    residuals = scores - scores.mean(axis=0) - scores.mean(axis=1)[:, None] + scores.mean()
    squares = float(((residuals @ centred) ** 2).sum() / information)
    people, conditions = scores.shape
    df = people - 1, (people - 1) * (conditions - 2)
    f = squares / df[0] / ((float((residuals**2).sum()) - squares) / df[1])

    def limit(probability: float) -> float:
        part = squares * (1 - float(fdtri(*df, probability)) / f)
        return float(np.sqrt(max(0.0, part / information / chdtri(df[0], 1 - probability))))

    mean = float(scores.mean(axis=0) @ centred / information)
    p, interval = float(fdtrc(*df, f)), (limit(UPPER), limit(LOWER))
    return {"f": f, "df": df, "p": p, "mean": mean, "sd_interval": interval}


def gains_differ(spread: dict[str, Any]) -> bool | None:
    """Return whether the gains' SD is above 0, False below a quarter of the mean, None if open."""
    low, high = spread["sd_interval"]
    if low > 0:
        return True
    return False if high < abs(spread["mean"]) / 4 else None
