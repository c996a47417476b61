"""The measured counterpart of a trial's predicted contrast.

A sensor's gain multiplies all forces of a session and cancels in every contrast of logarithms.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.friction import recorded
from analysis.friction.recorded import Jitter, TouchForces
from protocol.study.study_question import Effect

BINS_OF_CONTACT = 8
"""Bins of a path in one length of contact. A bin is little longer than the path of one block; with
fewer bins the averages would cut off the troughs of friction."""
FEWEST_BINS = 4
DEGREE = 3
"""Of the polynomial in time that is fitted to a ramp or sweep. The course that the model expects is
that of the nominal damping, and would bias the contrast on a rig with another one."""

TINY = 1e-24
"""A mean square that is nothing, and may stand below a fraction."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchPair:
    """What a trial compares.

    `effect` and `contrary` are as in `Change`. `before` is the first touch, None where the change
    is from the resting beam or within `after`, the last one. `along_path` is whether places along a
    path are compared, and not means; `within` whether the drive changes within `after`.
    """

    effect: Effect
    contrary: bool
    before: TouchForces | None
    after: TouchForces
    along_path: bool
    contact_m: float
    within: bool


@dataclass(frozen=True, kw_only=True)
class Rest:
    """Logarithm of the resting beam's friction in a session, and its variance."""

    friction: float
    variance: float


@dataclass(frozen=True, kw_only=True)
class MeasuredContrast:
    """A measured contrast and its standard error."""

    value: float
    error: float


def rest_of(unforced: Sequence[TouchForces], jitter: Jitter) -> Rest | NotEstimable:
    """Return the friction of touches without a drive, each touch counting alike."""
    if not unforced:
        return NotEstimable("the session has no recorded touch of the resting beam")
    variances = [recorded.mean_variance(touch, jitter) for touch in unforced]
    return Rest(
        friction=float(np.mean([touch.friction.mean() for touch in unforced])),
        variance=float(np.sum(variances)) / len(variances) ** 2,
    )


def measured_contrast(
    compared: TouchPair, jitter: Jitter, rest: Rest | NotEstimable
) -> MeasuredContrast | NotEstimable:
    """Return the contrast of a trial as it was measured, positive when it is the expected one.

    - `friction`: difference of mean ln μ between the touches; within one touch, the difference
      between the ends of a polynomial in time, by least squares.
    - `places`: rms over the path of the difference of ln μ(x).
    - `depth`: growth of the rms of ln μ(x) about the resting beam's.

    An rms of noise is positive: its expected square is taken off. The error has the jitter with its
    autocorrelation, the sensor's noise, and the error of the zeros.
    """
    found: MeasuredContrast | NotEstimable
    if compared.within and (compared.along_path or compared.before is not None):
        return NotEstimable("the drive changes along the path or after another touch")
    if compared.within:
        found = _within(compared.after, jitter)
    elif compared.before is None and isinstance(rest, NotEstimable):
        return rest
    elif compared.along_path:
        found = _over_path(compared, rest, jitter)
    else:
        found = _between(compared.before, compared.after, rest, jitter)
    if isinstance(found, NotEstimable) or not compared.contrary:
        return found
    return replace(found, value=-found.value)


def _within(touch: TouchForces, jitter: Jitter) -> MeasuredContrast:
    share = touch.t_s / touch.moved_s
    # (4): from 0 to 1 a power grows by 1, so that the fitted growth is the sum of the coefficients.
    weights = -np.linalg.pinv(np.vander(share, DEGREE + 1))[:-1].sum(axis=0)
    variance = jitter.covariance(weights[None], touch.noise)[0, 0] + (weights @ touch.tare) ** 2
    return _measured(float(weights @ touch.friction), float(variance))


def _between(
    before: TouchForces | None, after: TouchForces, rest: Rest | NotEstimable, jitter: Jitter
) -> MeasuredContrast:
    variance = recorded.mean_variance(after, jitter)
    if before is not None:
        start = float(before.friction.mean())
        variance += recorded.mean_variance(before, jitter)
    else:
        assert isinstance(rest, Rest)
        start = rest.friction
        variance += rest.variance
    return _measured(start - float(after.friction.mean()), variance)


def _measured(value: float, variance: float) -> MeasuredContrast:
    return MeasuredContrast(value=value, error=float(np.sqrt(variance)))


def _over_path(
    compared: TouchPair, rest: Rest | NotEstimable, jitter: Jitter
) -> MeasuredContrast | NotEstimable:
    width_m = compared.contact_m / BINS_OF_CONTACT
    after = recorded.profile(compared.after, width_m, jitter)
    if compared.before is None:
        assert isinstance(rest, Rest)
        before = _resting(after.bins, rest)
    else:
        before = recorded.profile(compared.before, width_m, jitter)
    both = np.intersect1d(before.bins, after.bins)
    if len(both) < FEWEST_BINS:
        return NotEstimable("the finger did not go along the same path twice")
    before, after = before.at(both), after.at(both)
    if compared.effect == "depth":
        return rest if isinstance(rest, NotEstimable) else _depth(before, after, rest)
    steps, covariance = after.values - before.values, before.covariance + after.covariance
    if compared.effect == "friction":
        return _measured(-float(steps.mean()), float(covariance.mean()))
    size = _root_mean_square(steps, covariance)
    return _measured(size.value, size.variance)


def _resting(bins: FloatArray, rest: Rest) -> recorded.Profile:
    """Return the profile of the resting beam, where friction is the same at all places."""
    return recorded.Profile(
        bins=bins,
        values=np.full(len(bins), rest.friction),
        covariance=np.full((len(bins), len(bins)), rest.variance),
    )


def _depth(before: recorded.Profile, after: recorded.Profile, rest: Rest) -> MeasuredContrast:
    first, last = (
        _root_mean_square(each.values - rest.friction, each.covariance) for each in (before, after)
    )
    # (7): both swings are about the same resting friction, so that its error partly cancels.
    of_rest = (last.mean_share - first.mean_share) ** 2 * rest.variance
    return _measured(last.value - first.value, first.variance + last.variance + of_rest)


@dataclass(frozen=True, kw_only=True)
class _Size:
    """A root mean square, its variance, and by how much it grows with a common offset."""

    value: float
    variance: float
    mean_share: float


def _root_mean_square(values: FloatArray, covariance: FloatArray) -> _Size:
    """Return √(mean square − mean variance), at least 0, by the delta method.

    Var(mean square) = (4 v'Σv + 2 tr Σ²) / n² for normal errors; near 0 the root is no better known
    than the fourth root of that.
    """
    # (5) and (6), mathematics/measured-contrast
    count = len(values)
    square = float(np.mean(values**2) - np.trace(covariance) / count)
    blur = 2 * float((covariance**2).sum()) / count**2
    size = np.sqrt(max(square, np.sqrt(blur), TINY))
    slope = values / (count * size)
    return _Size(
        value=float(np.sqrt(max(square, 0.0))),
        variance=float(slope @ covariance @ slope + blur / (4 * size**2)),
        mean_share=float(slope.sum()),
    )


# Measured contrasts that borrow strength from the same person's and the same condition's others.
#
# A single contrast is known as well as two seconds of jitter allow. A person's skin, however, is
# the same in all trials, and a condition's change the same for all people.

ROUNDS = 30
SKIN_SD = 0.5
"""Prior SD of the factors of people, wide against what is known of skin."""


def borrowed_contrasts(
    subject: IntArray,
    condition: IntArray,
    level: FloatArray,
    measured: FloatArray,
    errors: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return the best estimate of each trial's contrast and its standard error, (trials,) each.

    It is the posterior by regression calibration (Carroll et al. 2006, ch. 4).

    true = s_i a_c + η, measured = true + e, with a factor s of each person (skin), the mean
    contrast a of each condition at each level, η of an SD for each condition (no two touches are
    alike), and e of each trial's own standard error. The factors are fitted by alternating weighted
    least squares and the variances of η by moments, at least as large as one standard error of
    them. A line on the posterior means has the slope of the line on the true contrasts; one on the
    measured contrasts would be flatter. No friction model enters.

    All have shape (trials,), and errors are positive.
    """
    people, subject = np.unique(subject, return_inverse=True)
    names, condition = np.unique(condition, return_inverse=True)
    cells, cell = np.unique(np.stack([condition, level]), axis=1, return_inverse=True)
    noise, skin, scatter = errors**2, np.ones(len(people)), np.zeros(len(names))
    free = (len(people) + cells.shape[1]) / len(measured)
    for _ in range(ROUNDS):
        weight = 1 / (noise + scatter[condition])
        mean, mean_known = _factors(cell, skin[subject], measured, weight, np.inf)
        skin, skin_known = _factors(subject, mean[cell], measured, weight, SKIN_SD)
        expected = skin[subject] * mean[cell]
        # (9). Fitted factors follow the data, so that residuals are too small.
        squares = (measured - expected) ** 2 / max(1 - free, 1 / len(measured))
        counts = np.bincount(condition)
        known = np.sqrt(2 / counts) * np.bincount(condition, noise) / counts
        scatter = np.maximum(np.bincount(condition, squares - noise) / counts, known)
    # (10), mathematics/measured-contrast
    spread = scatter[condition]
    kept = spread / (spread + noise)
    of_factors = mean[cell] ** 2 / skin_known[subject] + skin[subject] ** 2 / mean_known[cell]
    errors = np.sqrt(kept * noise + (1 - kept) ** 2 * of_factors)
    return expected + kept * (measured - expected), errors


def _factors(
    group: IntArray, slope: FloatArray, measured: FloatArray, weight: FloatArray, sd: float
) -> tuple[FloatArray, FloatArray]:
    """Return each group's factor and its precision, with a normal prior about 1."""
    # (8), mathematics/measured-contrast
    precision = np.bincount(group, weights=weight * slope**2) + sd**-2
    total = np.bincount(group, weights=weight * slope * measured) + sd**-2
    return np.asarray(total / precision), np.asarray(precision, dtype=np.float64)
