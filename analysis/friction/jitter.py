"""Jitter of friction while nothing changes, and the variance that it gives to averages."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, NotEstimable
from analysis.friction.recorded import TouchForces

LAGS = 12
"""Blocks, 0.3 s, over which jitter may be correlated."""
FEWEST_BLOCKS = 40
FREQUENCIES, LEAST_SPECTRUM, ROUNDS = 999, 0.1, 50


@dataclass(frozen=True, kw_only=True, eq=False)
class Jitter:
    """Autocovariances of the jitter of ln μ between blocks, shape (lags + 1,); without noise."""

    autocovariances: FloatArray

    def covariance(self, weights: FloatArray, noise: FloatArray) -> FloatArray:
        """Return the covariance of weighted sums of a touch's blocks.

        Parameters:
            weights: shape (sums, blocks).
            noise: shape (blocks,), variance of each block by the sensor's noise.
        """
        # (2), mathematics/measured-contrast
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
    hidden = 0.0  # (3), mathematics/measured-contrast
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
