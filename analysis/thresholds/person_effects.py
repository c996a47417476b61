"""The thresholds of a cohort by a mixed model: psychometric functions with person effects."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.estimates import ENDS, FloatArray, Interval

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
