"""Precision by session length: how precisely a session estimates one person's sensitivity.

Sensitivity is the slope g of `score = a + g contrast + error`, fitted by least squares to one
person's scores. The half-width of its interval is t(n - 2) s / sqrt(sum (x - mean x)^2): four
times the trials halve it, and so does twice the spread of the contrasts.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import atan, cos, inf, pi, sin, sqrt

from protocol.preview.session_length import SessionLength
from protocol.study.rating import PAPERS_SCALE, Rating

RESIDUAL_SD = 0.971825
"""SD of a score about its row and column effects in the paper's Table 4 (32 df)."""


@dataclass(frozen=True, kw_only=True)
class Precision(SessionLength):
    """A session and the precision it gives, from the scores of `trials` trials.

    `half_width` is in score points per unit of predicted contrast; `relative` is its share of the
    gain that would use the whole scale, from no contrast to the largest. Both are infinite if the
    trials do not determine a slope.
    """

    trials: int
    half_width: float
    relative: float


def residual_sd(rating: Rating) -> float:
    """Return the SD that a score has about the line, on a scale of another length accordingly."""
    return RESIDUAL_SD * (rating.span / PAPERS_SCALE.span)


def precisions(
    contrasts: Sequence[float], repeats: int, sessions: Iterable[SessionLength], rating: Rating
) -> list[Precision]:
    """Return the precision of each of `sessions`, assuming the same spread of contrasts.

    `contrasts` are those predicted for the scored trials of a session of `repeats` repeats.
    """
    largest, spread = max(map(abs, contrasts), default=0.0), squared_spread(contrasts)

    def precision(session: SessionLength) -> Precision:
        share = session.repeats / repeats
        trials = round(share * len(contrasts))
        half = half_width(spread * share, trials, residual_sd(rating))
        return Precision(
            **vars(session),
            trials=trials,
            half_width=half,
            relative=half * largest / rating.span if half < inf else inf,
        )

    return [precision(session) for session in sessions]


def squared_spread(contrasts: Sequence[float]) -> float:
    """Return the sum of squared deviations from the mean."""
    if not contrasts:
        return 0.0
    mean = sum(contrasts) / len(contrasts)
    return sum((contrast - mean) ** 2 for contrast in contrasts)


def half_width(spread: float, trials: int, sd: float = RESIDUAL_SD) -> float:
    """Return half the width of the 95 % interval of a slope, infinite if it is undetermined.

    `spread` is the sum of squared deviations of the contrasts of `trials` trials with a score, and
    `sd` that of a score about the line.
    """
    if trials < 3 or spread <= 1e-12:
        return inf
    return t_quantile(0.975, trials - 2) * sd / sqrt(spread)


def t_quantile(probability: float, df: int) -> float:
    """Return the quantile of Student's t with `df` degrees of freedom, by bisection.

    >>> round(t_quantile(0.975, 18), 4)
    2.1009
    """
    low, high = 0.0, 1e6
    for _ in range(200):
        middle = (low + high) / 2
        if 0.5 + _central(middle, df) / 2 < probability:
            low = middle
        else:
            high = middle
    return (low + high) / 2


def _central(t: float, df: int) -> float:
    """Return the probability within [-t, t].

    Source: the finite sums of Abramowitz and Stegun, 26.7.3 and 26.7.4. Written here because
    loading scipy only for this would slow `touchbeam check` down by 0.2 s.
    """
    angle, odd = atan(t / sqrt(df)), df % 2
    squared = cos(angle) ** 2
    term = total = cos(angle) if odd else 1.0
    for k in range(2 + odd, df - 1, 2):
        term *= squared * (k - 1) / k
        total += term
    if not odd:
        return sin(angle) * total
    return 2 / pi * (angle + (sin(angle) * total if df > 1 else 0.0))
