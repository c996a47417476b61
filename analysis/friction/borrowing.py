"""Measured contrasts that borrow strength from the same person's and the same condition's others.

A single contrast is known as well as two seconds of jitter allow. A person's skin, however, is the
same in all trials, and a condition's change the same for all people.
"""

from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray, IntArray

ROUNDS = 30
SKIN_SD = 0.5
"""Prior SD of the factors of people, wide against what is known of skin."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BorrowedContrasts:
    """The best estimate of each trial's contrast and its standard error, shape (trials,)."""

    values: FloatArray
    errors: FloatArray


def borrowed_contrasts(
    subject: IntArray,
    condition: IntArray,
    level: FloatArray,
    measured: FloatArray,
    errors: FloatArray,
) -> BorrowedContrasts:
    """Return the posterior of each contrast by regression calibration (Carroll et al. 2006, ch. 4).

    true = s_i a_c + η, measured = true + e, with a factor s of each person (skin), the mean
    contrast a of each condition at each level, η of an SD for each condition (no two touches are
    alike), and e of each trial's own standard error. The factors are fitted by alternating weighted
    least squares and the variances of η by moments, at least as large as one standard error of
    them. A line on the posterior means has the slope of the line on the true contrasts; one on the
    measured contrasts would be flatter. No friction model enters.

    Parameters:
        subject, condition, level, measured, errors: shape (trials,); errors positive.
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
    return BorrowedContrasts(
        values=expected + kept * (measured - expected),
        errors=np.sqrt(kept * noise + (1 - kept) ** 2 * of_factors),
    )


def _factors(
    group: IntArray, slope: FloatArray, measured: FloatArray, weight: FloatArray, sd: float
) -> tuple[FloatArray, FloatArray]:
    """Return each group's factor and its precision, with a normal prior about 1."""
    # (8), mathematics/measured-contrast
    precision = np.bincount(group, weights=weight * slope**2) + sd**-2
    total = np.bincount(group, weights=weight * slope * measured) + sd**-2
    return np.asarray(total / precision), np.asarray(precision, dtype=np.float64)
