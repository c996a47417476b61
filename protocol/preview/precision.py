"""Precision by session length: how precisely a session determines each person's sensitivity.

The forecast is of the intervals that M2 reports (see docs/report.md), for N people of n scored
trials each. With v = s² / Σ(x - mean x)², the variance of the slope of one person's scores about
their own line, and τ the SD of gains between people, the variance of a gain relative to the
group's mean is

    (1 - 1/N) v [1 - ((N - 3)/(N - 1))² v / (v + τ²)],

as in a hierarchical model whose prior is flat in τ² (Morris and Tang, Statistical Science 26, 2011,
271-287). Everybody shares what a condition adds beside its predicted contrast, so that it does not
affect relative gains.

It does affect the gains themselves, through their mean. The C condition means scatter about the
group's line with the variance d² + s²/(N r), where r repeats do not reduce d, the spread of the
conditions off the line; t has C - 2 degrees of freedom. Only differences of contrast within a
condition, from graded levels, are free of d.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import atan, cos, hypot, inf, pi, sin, sqrt

from protocol.preview.session_length import SessionLength
from protocol.study.rating import PAPERS_SCALE, Forecast, Rating

PAPERS_PARTICIPANTS = 9
_NEGLIGIBLE = 1e-12

Contrasts = Mapping[str, Sequence[float]]
"""The predicted contrasts of a participant's scored trials, by condition."""


@dataclass(frozen=True, kw_only=True)
class Precision(SessionLength):
    """A session and the precision it gives, from the scores of `trials` trials a person.

    `half_width` is that of the 95% interval of a gain relative to the group's mean, and
    `gain_half_width` that of the gain itself, in score points per unit of predicted contrast;
    `relative` is the share of `half_width` in the gain that would use the whole scale, from no
    contrast to the largest. They are infinite if the trials do not determine them.
    """

    trials: int
    half_width: float
    gain_half_width: float
    relative: float


@dataclass(frozen=True, kw_only=True)
class Cohort:
    """The number of participants, and the SDs of their scores and gains, in points of the scale."""

    participants: int
    residual_sd: float
    off_the_line_sd: float
    gain_sd: float


def cohort(participants: int, forecast: Forecast, rating: Rating) -> Cohort:
    """Return the cohort that a study file assumes, whose SDs are on the paper's scale."""
    points = rating.span / PAPERS_SCALE.span
    return Cohort(
        participants=participants if participants > 1 else PAPERS_PARTICIPANTS,
        residual_sd=points * forecast.residual_sd,
        off_the_line_sd=points * forecast.off_the_line_sd,
        gain_sd=points * forecast.gain_sd,
    )


def precisions(
    contrasts: Contrasts,
    repeats: int,
    sessions: Iterable[SessionLength],
    rating: Rating,
    people: Cohort,
) -> list[Precision]:
    """Return the precision of each of `sessions`, assuming the same spread of contrasts.

    `contrasts` are those of a session of `repeats` repeats.
    """
    every = [contrast for own in contrasts.values() for contrast in own]
    largest = max(map(abs, every), default=0.0)

    def precision(session: SessionLength) -> Precision:
        share = session.repeats / repeats
        half = relative_gain_half_width(contrasts, share, people)
        return Precision(
            **vars(session),
            trials=round(share * len(every)),
            half_width=half,
            gain_half_width=hypot(half, _mean_gain_half_width(contrasts, share, people)),
            relative=half * largest / rating.span if half < inf else inf,
        )

    return [precision(session) for session in sessions]


def relative_gain_half_width(contrasts: Contrasts, share: float, people: Cohort) -> float:
    """Return half the 95% interval of a gain less the group's mean, infinite if undetermined.

    A participant has `share` times the trials of `contrasts`.
    """
    every = [contrast for own in contrasts.values() for contrast in own]
    spread, trials = share * squared_spread(every), round(share * len(every))
    if trials < 3 or spread <= _NEGLIGIBLE:
        return inf
    count, variance = people.participants, people.residual_sd**2 / spread
    pooled = (max(count - 3, 0) / (count - 1)) ** 2 * variance / (variance + people.gain_sd**2)
    sd = sqrt((1 - 1 / count) * variance * (1 - pooled))
    return t_quantile(0.975, (count - 1) * (trials - 2)) * sd


def _mean_gain_half_width(contrasts: Contrasts, share: float, people: Cohort) -> float:
    """Return half the 95% interval of the group's mean gain, infinite if it is undetermined."""
    groups = [own for own in contrasts.values() if own]
    means = [sum(own) / len(own) for own in groups]
    between, within = squared_spread(means), sum(squared_spread(own) for own in groups)
    information = 0.0
    if len(means) > 2 and between > _NEGLIGIBLE:
        ratings = people.participants * share * len(groups[0])
        off_sd = hypot(people.off_the_line_sd, people.residual_sd / sqrt(ratings))
        information += between / (t_quantile(0.975, len(means) - 2) * off_sd) ** 2
    if within > _NEGLIGIBLE:
        scatter = t_quantile(0.975, 1000) * people.residual_sd
        information += people.participants * share * within / scatter**2
    return 1 / sqrt(information) if information else inf


def confounded(contrasts: Contrasts) -> bool:
    """Return whether each condition has one contrast, so that the two are confounded."""
    return all(squared_spread(own) <= _NEGLIGIBLE for own in contrasts.values())


def squared_spread(contrasts: Sequence[float]) -> float:
    """Return the sum of squared deviations from the mean."""
    if not contrasts:
        return 0.0
    mean = sum(contrasts) / len(contrasts)
    return sum((contrast - mean) ** 2 for contrast in contrasts)


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
