"""What a touch measured: friction over the path, and one number for each of its properties."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.friction.jitter import Jitter
from analysis.friction.recorded import TouchForces

FRICTION, TANGENTIAL, RATE, VECTOR = (
    "log friction coefficient",
    "tangential force",
    "rate of the tangential force",
    "amplitude of the force vector",
)
PREDICTORS = (FRICTION, TANGENTIAL, RATE, VECTOR)
"""What the literature proposes that people feel; contrasts are of the first."""
LOGARITHMS = (FRICTION, TANGENTIAL, VECTOR)


def logarithm(touch: TouchForces, name: str) -> FloatArray:
    """Return the logarithm of friction or of a force, by block."""
    if name == FRICTION:
        return touch.friction
    return np.asarray(np.log(touch.tangential_n if name == TANGENTIAL else touch.vector_n))


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
    """Return the measures of a touch."""
    friction = float(np.exp(touch.friction.mean()))
    steps_s = np.diff(touch.t_s)
    rate = np.mean((np.diff(touch.tangential_n) / steps_s) ** 2)
    by_noise = 2 * touch.noise_n2 * np.mean(steps_s**-2)
    return TouchMeasures(
        friction=friction,
        friction_error=friction * float(np.sqrt(mean_variance(touch, jitter))),
        normal_n=float(touch.normal_n.mean()),
        vector_n=float(touch.vector_n.mean()),
        speed_m_s=speed_m_s(touch),
        rate_n_per_s=float(np.sqrt(max(rate - by_noise, 0.0))),
        stick_slip=touch.stick_slip,
    )


def speed_m_s(touch: TouchForces) -> float:
    """Return the median speed of the finger."""
    return float(np.median(np.abs(np.diff(touch.position_m) / np.diff(touch.t_s))))


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """Averages of a touch in bins of its path: by name, and the covariance of ln μ(x).

    `bins` numbers them from the clamp; the rate is that along the path, at the finger's speed.
    """

    bins: FloatArray
    values: Mapping[str, FloatArray]
    covariance: FloatArray

    def at(self, bins: FloatArray) -> "Profile":
        """Return the averages in some of the bins."""
        chosen = np.isin(self.bins, bins)
        return Profile(
            bins=self.bins[chosen],
            values={name: value[chosen] for name, value in self.values.items()},
            covariance=self.covariance[np.ix_(chosen, chosen)],
        )


def profile(touch: TouchForces, width_m: float, jitter: Jitter) -> Profile:
    """Return ln μ(x), forces and rate in bins of `width_m`."""
    bins, which = np.unique(np.floor(touch.position_m / width_m), return_inverse=True)
    weights = (which == np.arange(len(bins))[:, None]).astype(np.float64)
    weights /= weights.sum(axis=1, keepdims=True)
    values = {name: weights @ logarithm(touch, name) for name in LOGARITHMS}
    force_n = weights @ touch.tangential_n
    slopes = np.gradient(force_n, bins * width_m) if len(bins) > 1 else np.zeros(len(bins))
    tare = weights @ touch.tare
    return Profile(
        bins=bins,
        values={**values, RATE: slopes * speed_m_s(touch)},
        covariance=jitter.covariance(weights, touch.noise) + np.outer(tare, tare),
    )
