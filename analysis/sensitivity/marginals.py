"""Posteriors of linear combinations of the latent parameters, with their skewness.

Numbers of equations are those of docs/mathematics/marginals.md.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import FloatArray, IntArray
from analysis.sensitivity.curvature import Curvature, EdgeSlopes, LatentTrials, edge_slopes
from analysis.sensitivity.integration import Marginals
from analysis.sensitivity.laplace import LatentModes

# Skewness varies little between points, so that it is computed at a few and interpolated: at as
# many as make 8,000 points times trials, and at least 16, as (16) has up to six coefficients.
FEWEST_SKEW_POINTS, MOST_SKEW_POINTS = 16, 64
SKEW_EVALUATIONS = 8_000
# Limits beyond which a first-order correction means nothing; rounding may reach them where almost
# no noise is left.
MOST_SHIFT, MOST_SKEW = 1.0, 1.5
LEAST_VARIANCE = 1e-12
# Points times quantities, and trials, whose arrays are in memory at once: those of the former fit
# into the cache.
CELLS, TRIALS_AT_ONCE = 5_000, 500
# So many trials times quantities, of all points at once, have a number each.
MOST_NUMBERS = 100_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Combinations:
    """Linear combinations of the latent parameters, each of few of them.

    `shared` (quantities, G) multiplies the shared parameters, `own` (quantities, 2) those of
    `subject` (quantities,) and `common` (quantities, 2) the mean of the own parameters over
    subjects with the weights `mean` (subjects,).
    """

    shared: FloatArray
    subject: IntArray
    own: FloatArray
    common: FloatArray
    mean: FloatArray

    def of(self, shared: FloatArray, own: FloatArray) -> FloatArray:
        """Return the combinations (2) of parameters (points, G) and (points, subjects, 2)."""
        mean = np.einsum("s,psi->pi", self.mean, own)
        each = np.einsum("pqi,qi->pq", own[:, self.subject], self.own)
        return np.asarray(shared @ self.shared.T + mean @ self.common.T + each)

    def times(self, factor: float) -> "Combinations":
        """Return the combinations times `factor`."""
        parts = {name: factor * getattr(self, name) for name in ("shared", "own", "common")}
        return replace(self, **parts)

    def shared_only(self, shared: FloatArray) -> "Combinations":
        """Return combinations of the shared parameters alone."""
        none = np.zeros((len(shared), 2))
        subject = np.zeros(len(shared), dtype=np.int64)
        return replace(self, shared=shared, subject=subject, own=none, common=none)

    def followed_by(self, *others: "Combinations") -> "Combinations":
        """Return these combinations and then others, of the same mean."""
        names = ("shared", "subject", "own", "common")
        every = [self, *others]
        parts = {name: np.concatenate([getattr(one, name) for one in every]) for name in names}
        return replace(self, **parts)


def marginals(
    trials: LatentTrials,
    modes: LatentModes,
    points: FloatArray,
    weights: FloatArray,
    residual_sd: FloatArray,
    combinations: Combinations,
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
        combinations: of the parameters.
    """
    sds = standard_deviations(modes.curvature, combinations)
    known = SKEW_EVALUATIONS // len(trials.x)
    known = min(max(known, FEWEST_SKEW_POINTS), MOST_SKEW_POINTS)
    few = np.arange(len(points)) < known
    found = skewness(trials, modes.at(few), residual_sd[few], combinations)
    shift, skew = np.split(_interpolated(points, weights, np.concatenate(found, axis=1)), 2, axis=1)
    beyond = (np.abs(found[0]) >= MOST_SHIFT) | (np.abs(found[1]) >= MOST_SKEW)
    return Marginals(
        means=combinations.of(modes.shared, modes.own) + shift * sds,
        sds=sds,
        skews=skew,
        limited=weights[few] @ beyond / weights[few].sum(),
    )


def standard_deviations(curvature: Curvature, combinations: Combinations) -> FloatArray:
    """Return the SD of each combination of the parameters, shape (points, quantities)."""
    own, common, mean = combinations.own, combinations.common, combinations.mean
    subject = combinations.subject
    at_once, points = max(CELLS // len(subject), 1), curvature.whole.shape[-1]
    found = []
    for first in range(0, points, at_once):
        part = curvature.at(slice(first, first + at_once))
        blocks, reach = part.own_covariance, _reach(part, combinations)
        variance = np.einsum("pqg,pqg->pq", reach @ part.shared_covariance, reach)
        of_mean = np.einsum("s,psij->pij", mean**2, blocks)
        variance += np.einsum("qi,pij,qj->pq", common, of_mean, common)
        # (4): a combination's own subject is also part of the mean.
        both = own + 2 * mean[subject, None] * common
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            variance += blocks[:, subject, i, j] * (own[:, i] * both[:, j])
        found.append(np.sqrt(np.maximum(variance, LEAST_VARIANCE)))
    return np.concatenate(found)


def _reach(curvature: Curvature, combinations: Combinations) -> FloatArray:
    """Return (3), how combinations depend on the shared parameters, (points, quantities, G)."""
    response = curvature.response
    mean = np.einsum("s,psig->pig", combinations.mean, response)
    reach = combinations.shared - combinations.common @ mean
    for i in range(2):
        of = np.flatnonzero(combinations.own[:, i])
        reach[:, of] -= combinations.own[of, [[i]]].T * response[:, combinations.subject[of], i]
    return np.asarray(reach)


def skewness(
    trials: LatentTrials, modes: LatentModes, residual_sd: FloatArray, combinations: Combinations
) -> tuple[FloatArray, FloatArray]:
    """Return what third derivatives add to a normal approximation, (points, combinations) each.

    These are the shift of the mean, in SDs, and the skewness: (6) with (7), as (11) to (15).
    """
    curvature, common, departures = modes.curvature, combinations.common, modes.own
    sds, reach = standard_deviations(curvature, combinations), _reach(curvature, combinations)
    own_quantities, own_trials = _own_pairs(trials, combinations)
    mean, own = combinations.mean[trials.subject, None], combinations.own[own_quantities]
    shift, skew = np.empty_like(sds), np.empty_like(sds)
    cells = len(trials.x) * sds.shape[1]
    at_once = max(MOST_NUMBERS // cells, 1)
    for first in range(0, len(sds), at_once):
        part = slice(first, first + at_once)
        noise = residual_sd[part]
        slopes = edge_slopes(*trials.bounds(modes.shared[part], departures[part], noise))
        thirds = third_derivatives(slopes) * (trials.weight[:, None] / noise**3)
        third = np.ascontiguousarray(np.moveaxis(thirds, 2, 1))
        covariance = curvature.shared_covariance[part]
        by_own = curvature.own_covariance[part, trials.subject]
        response = curvature.response[part, trials.subject]
        # (11): covariances of an edge and a combination are the product of `along` and `by_shared`,
        # and of `departs` and the combination's own part for the subject's own trials.
        by_shared = reach[part] @ covariance
        by_shared = np.dstack([by_shared, np.broadcast_to(common, (len(by_shared), *common.shape))])
        along, departs, pairs = [], [], []
        for of_shared in trials.loadings:
            of_own = of_shared[:, trials.line_columns]
            bias, gain = of_own.T[..., None]
            free = of_shared - bias * response[:, :, 0] - gain * response[:, :, 1]
            departs.append(bias * by_own[:, :, 0] + gain * by_own[:, :, 1])
            along.append(np.dstack([free, mean * departs[-1]]))
            pairs.append((free, of_own))
        # (12)
        var_upper, cov_edges, var_lower = (
            np.einsum("ptg,ptg->pt", pairs[one][0] @ covariance, pairs[other][0])
            + np.einsum("pti,ti->pt", departs[one], pairs[other][1])
            for one, other in ((0, 0), (0, 1), (1, 1))
        )
        uuu, uul, ull, lll = third
        # (13)
        pulls = (
            uuu * var_upper + 2 * uul * cov_edges + ull * var_lower,
            uul * var_upper + 2 * ull * cov_edges + lll * var_lower,
        )
        of_own_trials = [np.einsum("pri,ri->pr", each[:, own_trials], own) for each in departs]
        if cells <= MOST_NUMBERS:
            up, down = (each @ np.swapaxes(by_shared, 1, 2) for each in along)
            for each, of_own in zip((up, down), of_own_trials, strict=True):
                each[:, own_trials, own_quantities] += of_own
            # (14) and (15)
            shift[part] = (pulls[0][:, None] @ up + pulls[1][:, None] @ down)[:, 0]
            skew[part] = _cube(third[..., None], up, down).sum(axis=1)
        else:
            shift[first], skew[first] = _summed(
                [each[0] for each in along],
                third[:, 0],
                [each[0] for each in pulls],
                by_shared[0],
                (own_quantities, own_trials),
                [each[0] for each in of_own_trials],
            )
    return (
        np.clip(shift / (2 * sds), -MOST_SHIFT, MOST_SHIFT),
        np.clip(skew / sds**3, -MOST_SKEW, MOST_SKEW),
    )


def _summed(
    along: list[FloatArray],
    third: FloatArray,
    pulls: list[FloatArray],
    by_shared: FloatArray,
    pairs: tuple[IntArray, IntArray],
    of_own_trials: list[FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return the sums of (14) and (15) without a number for each trial and quantity."""
    (quantities, trials), (own_up, own_down) = pairs, of_own_trials
    total = by_shared @ sum(pull @ part for pull, part in zip(pulls, along, strict=True))
    up, down = ((part[trials] * by_shared[quantities]).sum(axis=1) for part in along)
    pulled = own_up * pulls[0][trials] + own_down * pulls[1][trials]
    # The own trials' cubes with all of (11), less those that `_all_cubes` has already
    more = _cube(third[:, trials], up + own_up, down + own_down) - _cube(third[:, trials], up, down)
    return (
        total + np.bincount(quantities, pulled, len(total)),
        _all_cubes(along, third, by_shared) + np.bincount(quantities, more, len(total)),
    )


def _own_pairs(trials: LatentTrials, combinations: Combinations) -> tuple[IntArray, IntArray]:
    """Return each combination of a subject's own parameters with each trial of that subject."""
    quantities = np.flatnonzero(combinations.own.any(axis=1))
    counts = np.bincount(trials.subject, minlength=len(combinations.mean))
    first = np.cumsum(counts) - counts
    subject = combinations.subject[quantities]
    sizes = counts[subject]
    place = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.repeat(quantities, sizes), np.repeat(first[subject], sizes) + place


def _cube(thirds: FloatArray, up: FloatArray, down: FloatArray) -> FloatArray:
    """Return the third derivative of the log likelihood along these changes of the edges."""
    uuu, uul, ull, lll = thirds
    return np.asarray((uuu * up + 3 * uul * down) * up**2 + (3 * ull * up + lll * down) * down**2)


def _all_cubes(along: list[FloatArray], thirds: FloatArray, by_shared: FloatArray) -> FloatArray:
    """Return the sum of `_cube` over all trials, for each combination."""
    size = by_shared.shape[1]
    sums = np.zeros((size * (size + 1) // 2, size))
    for first in range(0, len(along[0]), TRIALS_AT_ONCE):
        part = slice(first, first + TRIALS_AT_ONCE)
        up, down = (each[part] for each in along)
        uuu, uul, ull, lll = thirds[:, part, None]
        sums += _products(up) @ (uuu * up + 3 * uul * down)
        sums += _products(down) @ (3 * ull * up + lll * down)
    one, other = np.triu_indices(size)
    sums[one != other] *= 2
    return np.asarray(((_products(by_shared).T @ sums) * by_shared).sum(axis=1))


def _products(rows: FloatArray) -> FloatArray:
    """Return the products of two values of each row, each pair once, (pairs, rows)."""
    one, other = np.triu_indices(rows.shape[1])
    columns = np.ascontiguousarray(rows.T)
    return np.asarray(columns[one] * columns[other])


def third_derivatives(slopes: EdgeSlopes) -> FloatArray:
    """Return third derivatives of log P by edges: upper³, upper² lower, upper lower², lower³."""
    upper, lower, up, down = slopes.upper, slopes.lower, slopes.up, slopes.down
    # (8) to (10)
    return np.stack(
        [
            up * ((upper * upper - 1) + up * (3 * upper + 2 * up)),
            up * down * (upper + 2 * up),
            up * down * (lower + 2 * down),
            down * ((lower * lower - 1) + down * (3 * lower + 2 * down)),
        ]
    )


def _interpolated(points: FloatArray, weights: FloatArray, values: FloatArray) -> FloatArray:
    """Return at all points the plane (16) through values at the first few, within their range."""
    few = len(values)
    root = np.sqrt(weights[:few, None])
    design = np.column_stack([np.ones(len(points)), points])
    plane = np.linalg.lstsq(root * design[:few], root * values, rcond=1e-6)[0]
    return np.asarray(np.clip(design @ plane, values.min(axis=0), values.max(axis=0)))
