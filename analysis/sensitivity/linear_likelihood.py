"""The likelihood of partially pooled straight lines, from sums per subject."""

from dataclasses import dataclass

import numpy as np

from analysis.scores import FloatArray
from analysis.sensitivity.ratings import IntArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSums:
    """What a straight line per subject needs to know of the trials.

    `counts` (subjects,) trials; `gram` (subjects, 2, 2) = Z'Z and `products` (subjects, 2) = Z'y
    with rows Z = (1, x); `squares` (subjects,) = y'y.
    """

    counts: FloatArray
    gram: FloatArray
    products: FloatArray
    squares: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class LinePosterior:
    """Given variance components: log marginal likelihood and what is known of the lines.

    `log_likelihood` (points,), the population's line integrated out; `profile` (points,), at the
    best population line instead. `means` (points, subjects, 2) and `covariances` (points,
    subjects, 2, 2) are of each subject's intercept and slope; `population` (points, 2) and
    `population_covariance` (points, 2, 2) of the population's.
    """

    log_likelihood: FloatArray
    profile: FloatArray
    means: FloatArray
    covariances: FloatArray
    population: FloatArray
    population_covariance: FloatArray


def line_sums(subject: IntArray, subjects: int, x: FloatArray, y: FloatArray) -> LineSums:
    """Return the sums of trials (subject, x, y) per subject."""

    def total(values: FloatArray) -> FloatArray:
        return np.bincount(subject, weights=values, minlength=subjects).astype(np.float64)

    ones = np.ones_like(x)
    gram = np.array([[total(ones), total(x)], [total(x), total(x * x)]])
    return LineSums(
        counts=total(ones),
        gram=np.moveaxis(gram, -1, 0),
        products=np.stack([total(y), total(x * y)], axis=-1),
        squares=total(y * y),
    )


def line_posterior(sums: LineSums, residual_sd: FloatArray, between: FloatArray) -> LinePosterior:
    """Return likelihood and lines at given variance components.

    y = Z (β + u_s) + ε, u_s ~ N(0, T), ε ~ N(0, σ²), β flat. With A = Z'Z/σ² and c = Z'y/σ²:
    Z'V⁻¹Z = A (I + T A)⁻¹, Z'V⁻¹y = (I + A T)⁻¹ c and y'V⁻¹y = y'y/σ² - c' (I + T A)⁻¹ T c
    (Woodbury), so that each subject costs a few products of 2 x 2 matrices.

    Parameters:
        sums: of the trials.
        residual_sd: shape (points,), σ.
        between: shape (points, 2, 2), T.
    """
    variance = residual_sd[:, None] ** 2
    a = sums.gram / variance[..., None, None]
    c = sums.products / variance[..., None]
    t = between[:, None]
    keep = np.linalg.inv(np.eye(2) + t @ a)
    shift = keep @ t
    info = (a @ keep).sum(axis=1)
    score = (np.swapaxes(keep, -1, -2) @ c[..., None])[..., 0].sum(axis=1)
    covariance = np.linalg.inv(info)
    population = (covariance @ score[..., None])[..., 0]
    own = (shift @ c[..., None])[..., 0]
    quadratic = (sums.squares / variance - (c * own).sum(-1)).sum(1) - (score * population).sum(-1)
    log_det = (sums.counts * np.log(variance) - np.linalg.slogdet(keep)[1]).sum(axis=1)
    profile = -(log_det + quadratic + sums.counts.sum() * np.log(2 * np.pi)) / 2
    return LinePosterior(
        log_likelihood=profile - np.linalg.slogdet(info)[1] / 2,
        profile=profile,
        means=own + (keep @ population[:, None, :, None])[..., 0],
        covariances=shift + keep @ covariance[:, None] @ np.swapaxes(keep, -1, -2),
        population=population,
        population_covariance=covariance,
    )
