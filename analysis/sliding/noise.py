"""The noise of friction along a pass: jitter that is correlated in time, sensor noise, and drift.

The variance of a pass's bins about the true friction m is

    m m' σ² e(|t - t'|) + diag(w²/n) + z² + d² t t'

Stick-slip jitter is relative, with standard deviation σ and correlation e^{-|t|/τ}; e is its mean
over the two bins. Sensor noise w is that of one sample of n. The force channel's zero is uncertain
by z after the tare and drifts by d. A fit that ignored τ would claim intervals that are too narrow:
neighbouring bins share their jitter.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize

from analysis.estimates import FloatArray
from analysis.sliding.passes import Course

ZERO_N = 1e-3
"""Standard error of the zero when the block begins to move: noise of the tare, and drift since."""
DRIFT_N_PER_S = 10e-3 / 60
"""Standard deviation of the zero's drift: 10 mN a minute."""
_LEAST_MU = 0.02
"""Least friction to which jitter is taken in proportion."""
_STEPS = 200


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Jitter relative to friction, its correlation time, and sensor noise per sample, in μ."""

    jitter: float = 0.05
    correlation_s: float = 0.02
    sensor: float = 0.02

    def covariance(self, one: Course, mu: FloatArray) -> FloatArray:
        """Return the covariance of the bins of a pass about friction `mu`, shape (bins, bins)."""
        width = one.count * one.spacing_s / self.correlation_s
        # (5), mathematics/sliding: means of e^{-|t|} over a bin and over two bins that do not
        # overlap.
        within = 2 * (width + np.expm1(-width)) / width**2
        half = np.minimum(width, 40.0) / 2
        spread = np.sinh(half) / half
        apart = np.abs(one.t_s[:, None] - one.t_s) / self.correlation_s
        shared = np.exp(-apart) * spread[:, None] * spread
        np.fill_diagonal(shared, within)
        size = self.jitter * np.maximum(np.abs(mu), _LEAST_MU)
        load_n, t_s = one.setting.load_n, one.t_s
        found = np.minimum(shared, 1.0) * size[:, None] * size
        found += (ZERO_N / load_n) ** 2 + (DRIFT_N_PER_S / load_n) ** 2 * t_s[:, None] * t_s
        found[np.diag_indices_from(found)] += self.sensor**2 / one.count
        return np.asarray(found)

    def factor(self, one: Course, mu: FloatArray) -> FloatArray:
        """Return the lower Cholesky factor of `covariance`."""
        return np.asarray(cholesky(self.covariance(one, mu), lower=True, check_finite=False))


def whitened(factor: FloatArray, values: FloatArray) -> FloatArray:
    """Return values, shape (bins,) or (bins, k), in units in which their noise is independent."""
    return np.asarray(solve_triangular(factor, values, lower=True, check_finite=False))


def fitted_noise(courses: Sequence[Course], means: Sequence[FloatArray]) -> Noise:
    """Return the noise under which the passes are likeliest about their means.

    What a mean leaves unexplained counts as noise, correlated as it is.
    """

    def noise(logs: FloatArray) -> Noise:
        jitter, correlation_s, sensor = np.exp(np.clip(logs, -12.0, 2.0)).tolist()
        return Noise(jitter=jitter, correlation_s=correlation_s, sensor=sensor)

    def deviance(logs: FloatArray) -> float:
        total = 0.0
        for one, mean in zip(courses, means, strict=True):
            factor = noise(logs).factor(one, mean)
            residual = whitened(factor, one.mu - mean)
            total += float(residual @ residual) + 2 * float(np.log(np.diag(factor)).sum())
        return total

    nominal = Noise()
    start = np.log([nominal.jitter, nominal.correlation_s, nominal.sensor])
    found = minimize(
        deviance,
        start,
        method="Nelder-Mead",
        options={
            "maxfev": _STEPS,
            "xatol": 0.02,
            "fatol": 0.05,
            "initial_simplex": _simplex(start),
        },
    )
    return noise(np.asarray(found.x))


def _simplex(start: FloatArray) -> FloatArray:
    return np.concatenate([start[None], start + 0.5 * np.eye(start.size)])
