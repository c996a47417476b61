"""Posteriors of linear combinations of the latent parameters, with their skewness."""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.sensitivity.curvature import Curvature, EdgeSlopes, edge_slopes
from analysis.sensitivity.integration import Marginals
from analysis.sensitivity.laplace import LatentModes, LatentTrials

# Skewness varies little between points, so that it is computed at a few and interpolated.
FEWEST_SKEW_POINTS, MOST_SKEW_POINTS = 16, 200
SKEW_EVALUATIONS = 8_000
# Limits beyond which a first-order correction means nothing; rounding may reach them where almost
# no noise is left.
MOST_SHIFT, MOST_SKEW = 1.0, 1.5
LEAST_VARIANCE = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Skewness:
    """What the third derivatives add to a normal approximation, shape (points, quantities).

    `shift` is that of the mean, in SDs.
    """

    shift: FloatArray
    skew: FloatArray


def marginals(
    trials: LatentTrials,
    modes: LatentModes,
    points: FloatArray,
    weights: FloatArray,
    residual_sd: FloatArray,
    combinations: FloatArray,
) -> Marginals:
    """Return mean, SD and skewness of combinations of the parameters at each point.

    They are those of Laplace's approximation to first order in the third derivatives of the log
    posterior (Tierney, Kass and Kadane, Journal of the American Statistical Association 84, 1989).

    Parameters:
        trials: whose posterior it is.
        modes: at the points.
        points: shape (points, dimensions).
        weights: shape (points,).
        residual_sd: shape (points,), σ.
        combinations: shape (quantities, parameters).
    """
    sds = standard_deviations(modes.curvature, combinations)
    known = SKEW_EVALUATIONS // len(trials.x)
    known = min(max(known, FEWEST_SKEW_POINTS), MOST_SKEW_POINTS)
    few = np.arange(len(points)) < known
    found = skewness(trials, modes.at(few), residual_sd[few], combinations)
    everywhere = _interpolated(points, weights, np.concatenate([found.shift, found.skew], axis=1))
    shift, skew = np.split(everywhere, 2, axis=1)
    return Marginals(
        means=modes.parameters @ combinations.T + shift * sds,
        sds=sds,
        skews=skew,
    )


def standard_deviations(curvature: Curvature, combinations: FloatArray) -> FloatArray:
    """Return the SD of each combination of the parameters, shape (points, quantities)."""
    size = curvature.whole.shape[-1]
    of_shared, of_own = combinations[:, :size], combinations[:, size:]
    response = curvature.response.reshape(len(curvature.response), -1, size)
    reach = of_shared - of_own @ response
    variance = ((reach @ np.linalg.inv(curvature.shared_precision)) * reach).sum(axis=2)
    own = of_own.reshape(len(of_own), -1, 2)
    squares = np.stack([own[..., 0] ** 2, 2 * own[..., 0] * own[..., 1], own[..., 1] ** 2])
    blocks = curvature.own_covariance
    for square, (row, column) in zip(squares, ((0, 0), (0, 1), (1, 1)), strict=True):
        variance += blocks[..., row, column] @ square.T
    return np.asarray(np.sqrt(np.maximum(variance, LEAST_VARIANCE)))


# A far point's derivatives may overflow; it then has no shift and no skewness.
@np.errstate(over="ignore", invalid="ignore")
def skewness(
    trials: LatentTrials, modes: LatentModes, residual_sd: FloatArray, combinations: FloatArray
) -> Skewness:
    """Return shift and skewness of each combination at each point."""
    upper, lower = trials.loadings
    covariance = np.linalg.inv(_whole(modes.curvature))
    slopes = edge_slopes(*trials.bounds(modes.shared, modes.own, residual_sd))
    thirds = third_derivatives(slopes) * (trials.weight[:, None] / residual_sd**3)
    spread = combinations @ covariance
    sds = np.sqrt(np.maximum((spread * combinations).sum(axis=2), LEAST_VARIANCE))
    shift, skew = np.empty_like(sds), np.empty_like(sds)
    # Point by point, because the arrays of one point fit into the processor's cache.
    for point, (each, by_sd) in enumerate(zip(covariance, spread / sds[..., None], strict=True)):
        a, b, c, d = thirds[..., point]
        up, down = by_sd @ upper.T, by_sd @ lower.T  # (quantities, trials)
        by_upper, by_lower = upper @ each, lower @ each
        pairs = ((by_upper, upper), (by_upper, lower), (by_lower, lower))
        uu, ul, ll = (np.einsum("ij,ij->i", one, other) for one, other in pairs)
        pull_up, pull_down = a * uu + 2 * b * ul + c * ll, b * uu + 2 * c * ul + d * ll
        shift[point] = (up @ pull_up + down @ pull_down) / 2
        cubes = (a * up + 3 * b * down) * up**2 + (3 * c * up + d * down) * down**2
        skew[point] = cubes.sum(axis=1)
    return Skewness(
        shift=np.clip(np.nan_to_num(shift), -MOST_SHIFT, MOST_SHIFT),
        skew=np.clip(np.nan_to_num(skew), -MOST_SKEW, MOST_SKEW),
    )


def third_derivatives(slopes: EdgeSlopes) -> FloatArray:
    """Return third derivatives of log P by edges: upper³, upper² lower, upper lower², lower³."""
    u, v, a, b = slopes.upper, slopes.lower, slopes.up, slopes.down
    return np.stack(
        [
            a * ((u * u - 1) + a * (3 * u + 2 * a)),
            a * b * (u + 2 * a),
            a * b * (v + 2 * b),
            b * ((v * v - 1) + b * (3 * v + 2 * b)),
        ]
    )


def _whole(curvature: Curvature) -> FloatArray:
    """Return the whole curvature as one matrix per point, the subjects' own parameters last."""
    points, subjects, _, size = curvature.cross.shape
    cross = curvature.cross.reshape(points, -1, size)
    own = np.zeros((points, subjects, 2, subjects, 2))
    each = np.arange(subjects)
    own[:, each, :, each] = np.swapaxes(curvature.own_precision, 0, 1)
    square = own.reshape(points, 2 * subjects, 2 * subjects)
    whole = [[curvature.whole, np.swapaxes(cross, 1, 2)], [cross, square]]
    return np.asarray(np.block(whole), dtype=np.float64)


def _interpolated(points: FloatArray, weights: FloatArray, values: FloatArray) -> FloatArray:
    """Return at all points the plane through values at the first few, within their range."""
    few = len(values)
    root = np.sqrt(weights[:few, None])
    design = np.column_stack([np.ones(len(points)), points])
    plane = np.linalg.lstsq(root * design[:few], root * values, rcond=1e-6)[0]
    return np.asarray(np.clip(design @ plane, values.min(axis=0), values.max(axis=0)))
