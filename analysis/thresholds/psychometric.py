"""Psychometric functions: threshold, slope and lapse rate of a person, with credible intervals."""

import math
import re
from dataclasses import dataclass
from typing import Any, Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import bdtr, xlogy

from analysis.estimates import ENDS, LOWER, UPPER, FloatArray, Interval
from analysis.thresholds.answer_curve import Curve, LevelAnswers, Shape
from analysis.thresholds.curve_posterior import posterior
from protocol.errors import BadInput
from protocol.study.track import GUESS_RATE

DRAWS = 400
"""Sets of answers from the posterior, with which the real ones are compared."""
MOST_LEVELS = 1000
"""Of one fit, whose time grows with them."""
ENOUGH_LEVELS = 3
POOR_FIT = 0.025
WORSE = 0.025
"""p of a binomial test, one-sided, that there are fewer right answers than by chance."""
FAR_BELOW = 0.001
"""p of such tests of the lowest levels, over all numbers of them: yes and no is answered so."""
BELOW_CHANCE = "below chance at low levels"
RISES = 1.645
"""z of a trend that is expected to rise: one-sided 5%."""
LIMITS = np.array([LOWER, 0.5, UPPER])
NOTHING = (math.nan, math.nan)


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """A psychometric function fitted to one person's answers in one track.

    All numbers are of one posterior: medians, and intervals that hold its middle 95%. Where the
    levels have no range there are none, and where the threshold lies beyond them it, its interval
    and the JND are missing: NaN or None; `reason` then says so.

    Attributes:
        threshold: in the unit of the levels.
        threshold_at: the share correct that defines it, of a person who does not lapse; in
            yes-no the share of the curve between false alarms and lapses.
        slope: 1/SD of a normal curve, per unit of the levels; the exponent of a Weibull curve.
        jnd: the distance of the level at 75% of the curve from its midpoint; None but in yes-no.
        guess: the share correct of guesses; in yes-no that of yes without a stimulus.
        scatter: SD of the share correct from one time to the next, over that of a single answer.
        deviance_p: how often answers of this function deviate from it as much as the real ones.
        reason: why there is no threshold, such as "above 8", which is the highest level.
        flags: what to look at before this is believed.
        band: the 95% interval of the curve at each level that was asked for.
        likelihood: of thresholds between neighbours of the places that were asked for, all else
            integrated out; only its shape matters.
    """

    threshold: float = math.nan
    threshold_at: float
    threshold_ci: Interval = NOTHING
    slope: float = math.nan
    slope_ci: Interval = NOTHING
    jnd: float | None = None
    lapse: float = math.nan
    lapse_ci: Interval = NOTHING
    guess: float = math.nan
    scatter: float = math.nan
    deviance_p: float = math.nan
    trials: int
    reason: str | None = None
    flags: tuple[str, ...] = ()
    band: tuple[Interval, ...] = ()
    likelihood: tuple[float, ...] = ()


FREE: Final = "free"
"""A guess rate that is estimated."""
Guess = float | Literal["free"] | None
MOST_ALTERNATIVES = 26


def guess_rate(task: str, guess: Guess = None) -> float | None:
    """Return the share correct by chance; None where it is estimated, as in yes-no.

    >>> guess_rate("2AFC"), guess_rate("4AFC"), guess_rate("yes or no"), guess_rate("2AFC", 0.4)
    (0.5, 0.25, None, 0.4)

    Raises:
        BadInput: there is no such task, or the rate does not lie in [0, 0.9].
    """
    many = re.fullmatch(r"(\d{1,2})[ -]?(?:AFC|IFC)", task, re.IGNORECASE)
    known = GUESS_RATE.get(task)  # type: ignore[call-overload]
    if many and 2 <= int(many[1]) <= MOST_ALTERNATIVES:
        known = 1 / int(many[1])
    if known is None:
        raise BadInput(
            f"task must be one of {', '.join(GUESS_RATE)}, or 2AFC to {MOST_ALTERNATIVES}AFC, got "
            f"{task!r}"
        )
    if guess is None:
        return known or None
    if guess == FREE:
        return None
    if not isinstance(guess, int | float) or not 0 <= guess <= 0.9:
        raise BadInput(f"the guess rate must lie in [0, 0.9] or be {FREE}, got {guess}")
    return float(guess)


def curve_share(
    threshold_at: float | None, task: str, lapse: float | None = None, guess: Guess = None
) -> float:
    """Return the share of the curve that a share correct is without lapses; the midpoint of None.

    (3): (share - chance) / (1 - chance).

    >>> curve_share(0.75, "two intervals"), curve_share(None, "yes or no")
    (0.5, 0.5)

    Raises:
        BadInput: the share is not above chance and below what lapses leave of 1, the lapse rate
            does not lie in [0, 0.5) or leaves nothing beside chance, or there is no such task.
    """
    chance = guess_rate(task, guess) or 0
    if lapse is not None and not 0 <= lapse < 0.5:
        raise BadInput(f"the lapse rate must lie in [0, 0.5), got {lapse:g}")
    if chance + (lapse or 0) >= 1:
        raise BadInput(
            f"guess rate plus lapse rate must be below 1, got {chance:g} + {lapse:g}: the curve "
            "would not rise"
        )
    most = 1 - (lapse or 0)
    if threshold_at is None:
        return 0.5
    if not chance < threshold_at < most:
        raise BadInput(
            f"the share correct that defines the threshold must lie above {chance:.3g}, which is "
            f"chance in {task}, and below {most:.3g}{', which lapses leave' if lapse else ''}, "
            f"got {threshold_at:g}"
        )
    return (threshold_at - chance) / (1 - chance)


def fitted(  # noqa: PLR0913 - what papers state of a fit
    levels: ArrayLike,
    trials: ArrayLike,
    correct: ArrayLike,
    *,
    task: str = "two intervals",
    shape: Shape = "weibull",
    threshold_at: float | None = None,
    lapse: float | None = None,
    guess: Guess = None,
    span: Interval | None = None,
    band_at: ArrayLike = (),
    likelihood_at: ArrayLike = (),
    seed: int = 1,
) -> Threshold:
    """Return threshold, slope and lapse rate of one person's answers, by (1) to (9).

    Args:
        levels: shape (n,), in any order; a level may come again.
        trials: shape (n,), answers at each level.
        correct: shape (n,), how many of them were correct; in yes-no how many were "yes".
        task: what was asked, also as 2AFC to 26AFC. It fixes the guess rate at 1/2, 1/3, ...; in
            yes-no it is estimated.
        shape: `normal` is a curve of the level as given, `weibull` one of its logarithm; at a
            level of 0 nothing is felt then.
        threshold_at: the share correct that defines the threshold. Without it the curve's
            midpoint: 0.75 in two intervals, 0.667 in three, 0.5 in yes-no.
        lapse: the lapse rate if it is known, and in yes-no the share of false alarms; 0 gives the
            threshold and slope of a probit regression.
        guess: the guess rate, if it is another one; `free` if it is to be estimated.
        span: the lowest and the highest level that could be asked. Without it those that were:
            the priors of threshold and slope follow from it, and no threshold is told beyond it.
        band_at: shape (points,), levels at which the band of the curve is wanted.
        likelihood_at: shape (places,), rising levels between which the likelihood of thresholds is.
        seed: of the draws for `deviance_p`.

    Raises:
        BadInput: an array or a word is wrong.
    """
    if shape not in get_args(Shape):
        raise BadInput(f"shape must be one of {', '.join(get_args(Shape))}, got {shape!r}")
    share = curve_share(threshold_at, task, lapse, guess)
    asked, number, right = _pooled(levels, trials, correct)
    if shape == "weibull" and asked[0] < 0:
        raise BadInput(
            f"a level must be at least 0 for the shape weibull, got {asked[0]:g}; use normal"
        )
    known = guess_rate(task, guess)
    chance = known or 0
    defined = chance + (1 - chance) * share
    axis = _axis(asked, shape)
    felt = axis[np.isfinite(axis)]
    ends = _axis(np.array(span), shape) if span else felt[[0, -1]] if felt.size else np.zeros(2)
    low, unit = float(ends[0]), float(ends[1] - ends[0])
    if not 0 < unit < math.inf:
        of_one = "all answers at one level"
        return Threshold(
            threshold_at=defined, trials=int(number.sum()), reason=of_one, flags=(of_one,)
        )
    answers = LevelAnswers(
        (axis - low) / unit,
        number,
        right,
        lapse,
        lapse if known is None and guess is None else known,
    )
    curve = Curve(shape, share)
    found = posterior(answers, curve)
    places = found.quantiles(0, LIMITS) * unit + low
    thresholds = places if shape == "normal" else np.exp(places)
    slopes = curve.width / (np.exp(found.quantiles(1, LIMITS)) * unit)
    # The mass of a cell is spread evenly, also beyond the highest rate that there can be.
    lapses = np.minimum(found.quantiles(2, LIMITS), answers.limits[2][1])
    low_lapse, lapse_rate, high_lapse = lapses.tolist()
    reason = _beyond(float(places[1]), ends, shape)
    rng = np.random.default_rng(seed)
    drawn = found.draws(DRAWS, rng)[:, :, None]
    p = _deviance_p(answers, drawn, curve, rng)
    at, edges = (
        (_axis(np.asarray(each, dtype=np.float64), shape) - low) / unit
        for each in (band_at, likelihood_at)
    )
    # The density before is that of the levels' axis.
    likelihood = np.maximum(np.diff(found.below(0, edges)), 0.0) / np.diff(edges)
    band = np.quantile(curve.share_correct(at, list(drawn)), ENDS, axis=0)
    told: dict[str, Any] = {"reason": reason}
    if reason is None:
        told = {"threshold": float(thresholds[1])}
        told["threshold_ci"] = float(thresholds[0]), float(thresholds[2])
        if task == "yes or no":
            told["jnd"] = _jnd(float(places[1]), float(slopes[1]), curve)
    return Threshold(
        **told,
        threshold_at=defined,
        slope=float(slopes[1]),
        slope_ci=(float(slopes[2]), float(slopes[0])),
        lapse=lapse_rate,
        lapse_ci=(low_lapse, high_lapse),
        guess=float(found.quantiles(3, np.array(0.5))),
        scatter=found.scatter,
        deviance_p=p,
        trials=int(number.sum()),
        flags=_flags(answers, chance, thresholds, asked[np.isfinite(axis)], reason, p),
        band=tuple(zip(*band.tolist(), strict=True)),
        likelihood=tuple(likelihood.tolist()),
    )


def _beyond(place: float, ends: FloatArray, shape: Shape) -> str | None:
    """Return in words beyond which end of the levels a threshold lies."""
    low, high = ends if shape == "normal" else np.exp(ends)
    if place < ends[0]:
        return f"below {low:.4g}"
    return f"above {high:.4g}" if place > ends[1] else None


def _axis(levels: FloatArray, shape: Shape) -> FloatArray:
    """Return the levels on the axis on which the curve is one of place and width."""
    with np.errstate(divide="ignore"):
        return levels if shape == "normal" else np.log(levels)


def _pooled(
    levels: ArrayLike, trials: ArrayLike, correct: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return each level once, rising, with its trials and its correct ones."""
    at, number, right = (
        np.asarray(values, dtype=np.float64) for values in (levels, trials, correct)
    )
    if not at.ndim == 1 or not at.shape == number.shape == right.shape:
        raise BadInput(
            "levels, trials and correct must be lists of the same length, got "
            f"{at.shape}, {number.shape} and {right.shape}"
        )
    whole = (number == np.floor(number)) & (right == np.floor(right))
    valid = np.isfinite(at) & whole & (right >= 0) & (right <= number) & (number < 2**31)
    if not valid.all():
        wrong = int(np.argmin(valid))
        raise BadInput(
            "a level must be a number, and correct a whole number from 0 to trials, got level "
            f"{at[wrong]:g} with {right[wrong]:g} of {number[wrong]:g}"
        )
    at, number, right = at[number > 0], number[number > 0], right[number > 0]
    if not at.size:
        raise BadInput("there must be at least one answer, got none")
    each, place = np.unique(at, return_inverse=True)
    if each.size > MOST_LEVELS:
        raise BadInput(
            f"there must be at most {MOST_LEVELS} different levels, got {each.size}; round them"
        )
    totals = [np.bincount(place, counts).astype(np.float64) for counts in (number, right)]
    return each, totals[0], totals[1]


def _jnd(threshold: float, slope: float, curve: Curve) -> float:
    """Return (7): how far the level at 75% of the curve lies above the midpoint."""
    middle, upper = (
        threshold + (curve.place(part) - curve.place(curve.share)) / slope for part in (0.5, 0.75)
    )
    return upper - middle if curve.shape == "normal" else math.exp(upper) - math.exp(middle)


def _deviance_p(
    answers: LevelAnswers, drawn: FloatArray, curve: Curve, rng: np.random.Generator
) -> float:
    """Return (8) and (9), the posterior predictive p of the deviance, of draws from it."""
    p = curve.share_correct(answers.at, list(drawn))
    again = rng.binomial(answers.trials.astype(np.int64), p).astype(np.float64)
    more = _deviance(again, answers.trials, p) >= _deviance(answers.correct, answers.trials, p)
    return float(more.mean())


def _deviance(right: FloatArray, number: FloatArray, p: FloatArray) -> FloatArray:
    wrong = number - right
    each = xlogy(right, right / (number * p)) + xlogy(wrong, wrong / (number * (1 - p)))
    return np.asarray(2 * each.sum(axis=-1))


def _flags(
    answers: LevelAnswers,
    chance: float,
    thresholds: FloatArray,
    asked: FloatArray,
    reason: str | None,
    p: float,
) -> tuple[str, ...]:
    """Return in a few words each what speaks against believing the estimate."""
    right, total = int(answers.correct.sum()), int(answers.trials.sum())
    trend = _trend(answers)
    found = {
        f"worse than chance: {right} of {total} right": chance > 0
        and bdtr(right, total, chance) < WORSE,
        "all right: the threshold may be lower than any level": right == total,
        "all wrong: the threshold may be higher than any level": not right,
        BELOW_CHANCE: trend >= RISES and _is_below(answers, chance),
        "too few levels": asked.size < ENOUGH_LEVELS,
        "does not rise with the level": trend < RISES,
        "interval beyond the levels": reason is None
        and not asked[0] <= thresholds[0] <= thresholds[2] <= asked[-1],
        "poor fit": p < POOR_FIT,
    }
    return tuple(name for name, holds in found.items() if holds)


def _is_below(answers: LevelAnswers, chance: float) -> bool:
    """Return whether answers are far below chance at the lowest levels, and above at the highest.

    The lowest are as many as speak most against chance (Bonferroni).
    """
    right, trials = answers.correct, answers.trials
    p = bdtr(np.cumsum(right), np.cumsum(trials).astype(np.int64), chance).min()
    return bool(p * right.size < FAR_BELOW and right[-1] > chance * trials[-1])


def _trend(answers: LevelAnswers) -> float:
    """Return z of the Cochran-Armitage test that the share correct rises from level to level."""
    total = answers.trials.sum()
    share = answers.correct.sum() / total
    place = np.arange(answers.at.size) - (np.arange(answers.at.size) @ answers.trials) / total
    spread = math.sqrt(share * (1 - share) * (answers.trials @ place**2))
    return float((answers.correct @ place) / spread) if spread else 0.0


SD_PRIOR: Final = 0.7
"""Scale of the half-normal prior of people's SD, in logarithms: 6 dB."""
_SDS = 48
_QUANTILES = np.array((ENDS[0], 0.5, ENDS[1]))


@dataclass(frozen=True, kw_only=True)
class Mixed:
    """The geometric mean of people's thresholds and their SD in logarithms, with 95% intervals."""

    threshold: float
    threshold_interval: Interval
    sd: float
    sd_interval: Interval


def mixed(likelihood: FloatArray, thresholds: FloatArray) -> Mixed:
    """Return the posterior medians of mean and SD, (10) and (11) of mathematics/thresholds.

    Logarithms of thresholds are normal over people. Unlike the mean of single estimates this
    knows how well each is known: one that its answers leave open counts less.

    Args:
        likelihood: of each person's answers by threshold, all else integrated out, shape
            (people, thresholds); only its shape over the thresholds matters.
        thresholds: shape (thresholds,), in equal ratios.
    """
    logs = np.log(thresholds)
    step, span = logs[1] - logs[0], logs[-1] - logs[0]
    # An SD below the grid's step could not be told from none.
    sds = np.geomspace(step / 2, max(span, 4 * SD_PRIOR), _SDS)
    scaled = (logs[:, np.newaxis] - logs) / sds[:, np.newaxis, np.newaxis]
    kernel = np.exp(-(scaled**2) / 2)
    kernel /= kernel.sum(axis=2).max(axis=1)[:, np.newaxis, np.newaxis]
    told = np.log(kernel @ likelihood.T + 1e-300).sum(axis=2)
    told += (np.log(sds) - (sds / SD_PRIOR) ** 2 / 2)[:, np.newaxis]
    mass = np.exp(told - told.max())
    middle, spread = mass.sum(axis=0), mass.sum(axis=1)
    low, mean, high = np.exp(_quantiles(middle, logs))
    least, sd, most = np.exp(_quantiles(spread, np.log(sds)))
    return Mixed(
        threshold=float(mean),
        threshold_interval=(float(low), float(high)),
        sd=float(sd),
        sd_interval=(float(least), float(most)),
    )


def _quantiles(mass: FloatArray, at: FloatArray) -> FloatArray:
    below = np.cumsum(mass) - mass / 2
    return np.asarray(np.interp(_QUANTILES, below / mass.sum(), at))
