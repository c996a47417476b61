"""Recordings of touches as forces in newtons: averages of short blocks, on the session's clock.

Numbers of equations are those of docs/mathematics/measured-contrast.md.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from analysis.estimates import BoolArray, FloatArray, NotEstimable
from protocol.journal.records import CHANNELS, FULL_SCALE, LIFTED_N, DamagedSamplesError, Recording
from protocol.study.rig_settings import TARE_S

BLOCK_S = 0.025
"""Length of a block: one millimetre of the paper's path, and as long as what counts in friction
(20 ms: Monnoyer et al. 2023)."""
WINDOW_BLOCKS = 4
"""Blocks over which stick-slip is told from what changes slowly."""
LEAST_BLOCKS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchForces:
    """Forces and place while the finger moved, each a mean over a block; zero offsets taken off.

    Parameters:
        t_s: shape (blocks,), middle of each block after the movement began.
        position_m: shape (blocks,), right edge of the finger.
        tangential_n, normal_n: shape (blocks,).
        vector_n: shape (blocks,), amplitude of the vector of both forces.
        moved_s: how long the finger moved, as planned.
        noise_n2: variance that the sensor's noise gives a block's tangential force.
        tare_n2: variance of the tangential zero.
        zero_n: the zero that was taken off, None if it was not measured.
        zero_s: when the zero was measured, on the session's clock.
        touched_s: the middle of the touch on that clock.
        stick_slip: SD of the tangential force within a tenth of a second, about its trend there
            and without the sensor's noise, over its mean.
        saturated: samples at a sensor's limit.
    """

    t_s: FloatArray
    position_m: FloatArray
    tangential_n: FloatArray
    normal_n: FloatArray
    vector_n: FloatArray
    moved_s: float
    noise_n2: float
    tare_n2: float
    zero_n: float | None
    zero_s: float
    touched_s: float
    stick_slip: float
    saturated: int

    @property
    def friction(self) -> FloatArray:
        """Logarithm of the friction coefficient, ln(tangential / normal), by block."""
        return np.asarray(np.log(self.tangential_n / self.normal_n))

    @property
    def noise(self) -> FloatArray:
        """Variance that the sensor's noise gives `friction`, by block: (1)."""
        return np.asarray(self.noise_n2 / self.tangential_n**2)

    @property
    def tare(self) -> FloatArray:
        """What a tangential zero one SD too low adds to `friction`, by block: (1)."""
        return np.asarray(np.sqrt(self.tare_n2) / self.tangential_n)

    def with_drift(self, drift_n_per_s: float) -> "TouchForces":
        """Return the forces if the zero has drifted since it was measured."""
        moved_n = drift_n_per_s * (self.touched_s + self.t_s - self.moved_s / 2 - self.zero_s)
        tangential_n = self.tangential_n - moved_n
        return self if (tangential_n <= 0).any() else replace(self, tangential_n=tangential_n)


def decoded(
    recording: Recording, zero_n: Sequence[float] | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times, the sensors' counts and forces and place of each sample, less the zero.

    Shapes (samples,), on the session's clock, and (channels, samples) twice, as `CHANNELS` are.

    Raises:
        DamagedSamplesError: the samples are not those recorded.
    """
    # Samples are stored as the sensor counts them, 16 bits, channel by channel.
    counts = np.frombuffer(recording.counts(), "<i2").reshape(len(CHANNELS), -1).astype(np.float64)
    t_s = recording.first_s + recording.clock_offset_s
    zero = np.zeros((len(CHANNELS), 1))
    zero[:2, 0] = zero_n or 0.0  # of the forces alone
    return (
        t_s + np.arange(recording.count) / recording.rate_hz,
        counts,
        counts * np.array(recording.scale)[:, None] - zero,
    )


def reduced(recording: Recording) -> TouchForces | NotEstimable:
    """Return the forces of a recording while the finger moved, or why they say nothing.

    A block counts if the finger was on the beam, both forces were positive and no sensor was at
    its limit.
    """
    try:
        t_s, counts, found = decoded(recording, recording.tare_n)
    except DamagedSamplesError as error:
        return NotEstimable(str(error))
    size = max(round(BLOCK_S * recording.rate_hz), 1)
    began_s, over_s = recording.moved_s
    moving = slice(*np.searchsorted(t_s, [began_s, over_s]))
    length = (moving.stop - moving.start) // size * size
    chosen = slice(moving.start, moving.start + length)
    if length < LEAST_BLOCKS * size:
        return NotEstimable("the finger moved for less than 0.2 s of the recording")
    at_limit = np.abs(counts[:2, chosen]).max(axis=0) >= FULL_SCALE
    tangential_n, normal_n, position_m = found[:, chosen]
    noise_n2 = float(np.mean(np.diff(tangential_n) ** 2)) / 2

    def averaged(values: FloatArray) -> FloatArray:
        return np.asarray(values.reshape(-1, size).mean(axis=1))

    means = {
        "position_m": averaged(position_m),
        "tangential_n": averaged(tangential_n),
        "normal_n": averaged(normal_n),
        "vector_n": averaged(np.hypot(tangential_n, normal_n)),
    }
    counted = (
        (means["normal_n"] > LIFTED_N)
        & (means["tangential_n"] > 0)
        & ~at_limit.reshape(-1, size).any(axis=1)
    )
    if counted.sum() < max(LEAST_BLOCKS, len(counted) / 2):
        return NotEstimable(_why_not(means["normal_n"], at_limit))
    return TouchForces(
        t_s=(averaged(t_s[chosen]) - began_s)[counted],
        **{name: values[counted] for name, values in means.items()},
        moved_s=over_s - began_s,
        noise_n2=noise_n2 / size,
        tare_n2=noise_n2 / (TARE_S * recording.rate_hz),
        zero_n=None if recording.tare_n is None else recording.tare_n[0],
        zero_s=float(t_s[0]) - TARE_S / 2,
        touched_s=(began_s + over_s) / 2,
        stick_slip=_stick_slip(tangential_n, size, counted, noise_n2),
        saturated=recording.saturated,
    )


def _why_not(normal_n: FloatArray, at_limit: BoolArray) -> str:
    if (normal_n <= LIFTED_N).sum() > len(normal_n) / 2:
        return "no finger was on the beam"
    if at_limit.mean() > 0.1:
        return "a sensor was at its limit"
    return "the tangential force was not positive"


def _stick_slip(tangential_n: FloatArray, size: int, counted: BoolArray, noise_n2: float) -> float:
    """Return the SD within windows about a straight line, without the noise, over the mean."""
    long, whole = size * WINDOW_BLOCKS, len(counted) // WINDOW_BLOCKS
    windows = tangential_n[: whole * long].reshape(whole, long)
    windows = windows[counted[: whole * WINDOW_BLOCKS].reshape(whole, -1).all(axis=1)]
    if long < 8 or not len(windows):
        return np.nan
    time = np.arange(long) - (long - 1) / 2
    away = windows - windows.mean(axis=1, keepdims=True)
    away -= np.outer(away @ time, time) / (time @ time)
    variance = (away**2).sum(axis=1) / (long - 2)
    return float(np.sqrt(max(variance.mean() - noise_n2, 0.0)) / windows.mean())


def zero_drift_n_per_s(touches: list[TouchForces]) -> float:
    """Return how fast the tangential zero drifts: the median over neighbouring touches.

    0 with fewer than four zeros. Touches an hour apart, or of clocks that began anew, tell nothing.
    """
    zeros = [(each.zero_s, each.zero_n) for each in touches if each.zero_n is not None]
    rates = [
        (zero - before) / (at - earlier)
        for (earlier, before), (at, zero) in pairwise(zeros)
        if 0 < at - earlier < 600
    ]
    return float(np.median(rates)) if len(rates) >= 3 else 0.0


# Jitter of friction while nothing changes, and the variance that it gives to averages.

LAGS = 12
"""Blocks, 0.3 s, over which jitter may be correlated."""
FEWEST_BLOCKS = 40
FREQUENCIES, LEAST_SPECTRUM, ROUNDS = 999, 0.1, 50


@dataclass(frozen=True, kw_only=True, eq=False)
class Jitter:
    """Autocovariances of the jitter of ln μ between blocks, shape (lags + 1,); without noise."""

    autocovariances: FloatArray

    def covariance(self, weights: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the covariance of weighted sums of a touch's blocks: (2), but for the zero.

        `weights` has shape (sums, blocks), and `noise` (blocks,) the variance of each block by the
        sensor's noise.
        """
        spread = weights * (self.autocovariances[0] + noise)
        for lag, value in enumerate(self.autocovariances[1 : weights.shape[1]], start=1):
            spread[:, lag:] += value * weights[:, :-lag]
            spread[:, :-lag] += value * weights[:, lag:]
        return np.asarray(spread @ weights.T)


def jitter_of(held: Iterable[TouchForces]) -> Jitter | NotEstimable:
    """Return the jitter of touches at one place under a constant drive.

    The mean of each touch is taken off, and what that hides is put back: the autocovariances about
    a touch's mean are too small by the variance of that mean (Priestley 1981, section 5.3).
    """
    sums, counts, blocks, noise = np.zeros(LAGS + 1), np.zeros(LAGS + 1), [], []
    for touch in held:
        away = touch.friction - touch.friction.mean()
        lags = min(LAGS + 1, len(away))
        sums[:lags] += [away[lag:] @ away[: len(away) - lag] for lag in range(lags)]
        counts[:lags] += len(away) - np.arange(lags)
        blocks.append(len(away))
        noise.append(touch.noise.mean())
    if sum(blocks) < FEWEST_BLOCKS:
        return NotEstimable("no touch at one place under a constant drive shows the jitter")
    found = sums / np.maximum(counts, 1)
    length = float(np.mean(blocks))
    share = np.where(np.arange(LAGS + 1) > 0, 2.0, 1.0) * (1 - np.arange(LAGS + 1) / length)
    hidden = 0.0  # (3)
    for _ in range(ROUNDS):
        hidden = max(float(share @ (found + hidden)) / length, 0.0)
    covariances = found + hidden
    covariances[0] = max(covariances[0] - float(np.mean(noise)), 0.0)
    return Jitter(autocovariances=_positive(covariances))


def _positive(covariances: FloatArray) -> FloatArray:
    """Return the covariances with a spectrum above 0, which sampling errors may make negative.

    A tenth of what uncorrelated blocks would have is the least at any frequency. Cutting the
    spectrum adds covariances at longer lags and leaving those out lowers the spectrum again, so
    that both are done in turn.
    """
    padding, least = np.zeros(FREQUENCIES), LEAST_SPECTRUM * covariances[0]
    for _ in range(ROUNDS):
        both = np.concatenate([covariances, padding, covariances[:0:-1]])
        spectrum = np.maximum(np.fft.rfft(both).real, least)
        covariances = np.fft.irfft(spectrum)[: len(covariances)]
    return np.asarray(covariances)


# What a touch measured: friction over the path, and one number for each of its properties.


def mean_variance(touch: TouchForces, jitter: Jitter) -> float:
    """Return the variance of the touch's mean ln μ: jitter, noise and the error of the zero."""
    weights = np.full((1, len(touch.t_s)), 1 / len(touch.t_s))
    return float(jitter.covariance(weights, touch.noise)[0, 0] + touch.tare.mean() ** 2)


@dataclass(frozen=True, kw_only=True)
class TouchMeasures:
    """One touch in numbers.

    - `friction`: coefficient, the geometric mean over time; `friction_error`: standard error.
    - `normal_n`, `vector_n`: mean normal force, and mean amplitude of the vector of both forces.
    - `speed_m_s`: median of the finger's speed.
    - `rate_n_per_s`: rms rate of change of the tangential force from block to block.
    - `stick_slip`: see `TouchForces`.
    """

    friction: float
    friction_error: float
    normal_n: float
    vector_n: float
    speed_m_s: float
    rate_n_per_s: float
    stick_slip: float


def touch_measures(touch: TouchForces, jitter: Jitter) -> TouchMeasures:
    friction = float(np.exp(touch.friction.mean()))
    steps_s = np.diff(touch.t_s)
    rate = np.mean((np.diff(touch.tangential_n) / steps_s) ** 2)
    by_noise = 2 * touch.noise_n2 * np.mean(steps_s**-2)
    return TouchMeasures(
        friction=friction,
        friction_error=friction * float(np.sqrt(mean_variance(touch, jitter))),
        normal_n=float(touch.normal_n.mean()),
        vector_n=float(touch.vector_n.mean()),
        speed_m_s=float(np.median(np.abs(np.diff(touch.position_m) / steps_s))),
        rate_n_per_s=float(np.sqrt(max(rate - by_noise, 0.0))),
        stick_slip=touch.stick_slip,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Averages of ln μ(x) in bins of a touch's path, and their covariance.

    `bins` numbers them from the clamp.
    """

    bins: FloatArray
    values: FloatArray
    covariance: FloatArray

    def at(self, bins: FloatArray) -> "Profile":
        """Return the averages in some of the bins."""
        chosen = np.isin(self.bins, bins)
        return Profile(
            bins=self.bins[chosen],
            values=self.values[chosen],
            covariance=self.covariance[np.ix_(chosen, chosen)],
        )


def profile(touch: TouchForces, width_m: float, jitter: Jitter) -> Profile:
    """Return ln μ(x) in bins of `width_m`."""
    bins, which = np.unique(np.floor(touch.position_m / width_m), return_inverse=True)
    weights = (which == np.arange(len(bins))[:, None]).astype(np.float64)
    weights /= weights.sum(axis=1, keepdims=True)
    tare = weights @ touch.tare
    return Profile(
        bins=bins,
        values=np.asarray(weights @ touch.friction),
        covariance=jitter.covariance(weights, touch.noise) + np.outer(tare, tare),
    )
