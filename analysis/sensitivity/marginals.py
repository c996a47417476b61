"""Posteriors of linear combinations of the latent parameters.

Numbers of equations are those of docs/mathematics/sensitivity.md.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import FloatArray, IntArray
from analysis.sensitivity.curvature import Curvature
from analysis.sensitivity.integration import Marginals
from analysis.sensitivity.laplace import LatentModes

LEAST_VARIANCE = 1e-12
CELLS = 5_000
"""Points times quantities whose arrays are in memory at once: they fit into the cache."""


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
        """Return the combinations (14) of parameters (points, G) and (points, subjects, 2)."""
        mean = np.einsum("s,psi->pi", self.mean, own)
        each = np.einsum("pqi,qi->pq", own[:, self.subject], self.own)
        return np.asarray(shared @ self.shared.T + mean @ self.common.T + each)

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


def marginals(modes: LatentModes, combinations: Combinations) -> Marginals:
    """Return mean and SD of combinations of the parameters at each point, (points, quantities).

    They are those of Laplace's approximation. Its first-order corrections for skewness are beyond
    their limits where few trials tell little, and intervals without them hold the truth as often.
    """
    sds = standard_deviations(modes.curvature, combinations)
    return Marginals(means=combinations.of(modes.shared, modes.own), sds=sds)


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
        # (16): a combination's own subject is also part of the mean.
        both = own + 2 * mean[subject, None] * common
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            variance += blocks[:, subject, i, j] * (own[:, i] * both[:, j])
        found.append(np.sqrt(np.maximum(variance, LEAST_VARIANCE)))
    return np.concatenate(found)


def _reach(curvature: Curvature, combinations: Combinations) -> FloatArray:
    """Return (15), how combinations depend on the shared parameters, (points, quantities, G)."""
    response = curvature.response
    mean = np.einsum("s,psig->pig", combinations.mean, response)
    reach = combinations.shared - combinations.common @ mean
    for i in range(2):
        of = np.flatnonzero(combinations.own[:, i])
        reach[:, of] -= combinations.own[of, [[i]]].T * response[:, combinations.subject[of], i]
    return np.asarray(reach)
