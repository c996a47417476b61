"""The curve of the highest posterior density, by a descent from several places.

Many answers make the posterior so narrow that no cell of a coarse grid lies in it: the best cell
may be that of quite another curve. The answers are taken to scatter, by which a level has no more
weight than some hundred answers, so that the mode is that of all levels.
"""

from typing import Final, NamedTuple, Self

import numpy as np

from analysis.estimates import BoolArray, FloatArray
from analysis.thresholds.answer_curve import (
    LEAST_SHARE,
    RATE_PRIOR,
    Cells,
    Curve,
    LevelAnswers,
    log_density,
    log_prior,
    prior_gradient,
)

SCATTER = 0.005
"""It makes a level's answers worth n / (1 + (n - 1) scatter^2) of them."""
STARTS = 4
MOST_STEPS = 40
LEAST_STEPS = 5
RIVALS = 5.0
"""Places whose log density lies less below the highest may still become the highest."""
NODES = 48
NEAR = 1e-2
"""Standard deviations: a shorter step has arrived at the mode."""
AS_HIGH = 1e-6
"""Log densities that differ less differ by rounding: the first one counts as the highest."""
ROUNDING = 1e-13
FLAT: Final = np.array([4.0, 1.0, 100.0, 100.0])
"""Information where answers tell nothing: midpoint, log width and rates have SDs of about .5, 1
and .1 before."""


class Mode(NamedTuple):
    """Midpoint, log width, lapse and guess rate of the highest density, and their covariance.

    The covariance is that of a normal distribution of the same curvature. A parameter that ends
    at a limit, or is known, goes with no other.
    """

    place: FloatArray
    covariance: FloatArray


def highest_density(answers: LevelAnswers, curve: Curve, cells: Cells) -> Mode:
    """Return the mode of the density of midpoint, width and rates.

    The descents begin at the best cells of those widths that are best on a grid over the whole
    prior.
    """
    curve = curve._replace(share=0.5)
    weight = 1 / (1 + np.maximum(answers.trials - 1, 0) * SCATTER**2)
    least, most = np.array(answers.limits).T
    grid = np.ix_(
        *(
            low + (high - low) * (np.arange(n) + 0.5) / n
            for low, high, n in zip(least, most, cells, strict=True)
        )
    )
    every = [values[..., np.newaxis] for values in grid]
    found = log_density(every, np.array([SCATTER]), answers, curve, NODES)[..., 0]
    answers = answers._replace(trials=answers.trials * weight, correct=answers.correct * weight)
    by_width = np.moveaxis(found, 1, 0).reshape(cells[1], -1)
    first = np.argmax(by_width >= by_width.max(axis=1, keepdims=True) - AS_HIGH, axis=1)
    places = np.stack(np.broadcast_arrays(*grid), axis=-1)
    starts = np.moveaxis(places, 1, 0).reshape(cells[1], -1, 4)[np.arange(cells[1]), first]
    starts = starts[np.argsort(-by_width.max(axis=1).round(6), kind="stable")[:STARTS]]

    def held(points: _Points) -> BoolArray:
        """Return which parameters stay where they are, at a limit."""
        down, up = points.gradient < 0, points.gradient > 0
        at_end = (points.place <= least) & down | (points.place >= most) & up
        return np.asarray(at_end | (least == most))

    here = _Points.of(starts, answers, curve)
    damping = np.full(len(here.place), 1e-3)
    for step in range(MOST_STEPS):
        # Newton's steps, damped as Levenberg and Marquardt do.
        fixed = held(here)
        scale = np.where(fixed, 1.0, np.diagonal(here.information, axis1=1, axis2=2) + FLAT)
        metric = np.where(fixed[:, None] | fixed[:, :, None], 0.0, here.information)
        metric += np.eye(4) * (scale * np.where(fixed, 1.0, damping[:, None]))[:, None]
        move = np.linalg.solve(metric, np.where(fixed, 0.0, here.gradient)[..., None])[..., 0]
        there = _Points.of(np.minimum(np.maximum(here.place + move, least), most), answers, curve)
        better = there.height >= here.height - ROUNDING * abs(here.height)
        arrived = ((there.place - here.place) ** 2 * scale).sum(axis=1) < NEAR**2
        here = here.where(better, there)
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-9, 1e9)
        rivals = here.height > here.height.max() - RIVALS
        if step >= LEAST_STEPS and arrived[rivals].all():
            break
    top = int(np.argmax(here.height >= here.height.max() - AS_HIGH))
    alone = held(here)[top]
    information = here.information[top] + np.diag(FLAT)
    apart = (alone | alone[:, None]) & ~np.eye(4, dtype=bool)
    return Mode(here.place[top], np.linalg.inv(np.where(apart, 0.0, information)))


class _Points(NamedTuple):
    """Places, shape (places, 4), with log density, its gradient and information there.

    The information is the curvature, or what answers are expected to tell where that is no
    maximum's.
    """

    place: FloatArray
    height: FloatArray
    gradient: FloatArray
    information: FloatArray

    @classmethod
    def of(cls, place: FloatArray, answers: LevelAnswers, curve: Curve) -> Self:
        """Return what the density is like at these places."""
        middle, log_width, lapse, guess = columns = place.T[..., None]
        steepness, left = curve.width / np.exp(log_width), 1 - guess - lapse
        # The curve is flat beyond.
        z = np.minimum(np.maximum(steepness * (answers.at - middle), -700.0), 40.0)
        y = z + curve.place(0.5)
        height = curve.height(y)
        rise, bend = curve.slopes(y)
        p = np.minimum(np.maximum(guess + left * height, LEAST_SHARE), 1 - LEAST_SHARE)
        right, wrong = answers.correct, answers.trials - answers.correct
        by = np.stack([-left * rise * steepness, -left * rise * z, -height, 1 - height], axis=1)
        across = by.transpose(0, 2, 1)
        off = right / p - wrong / (1 - p)
        observed = by * (right / p**2 + wrong / (1 - p) ** 2)[:, None] @ across
        expected = by * (answers.trials / (p * (1 - p)))[:, None] @ across
        # What the second derivatives of p add.
        turn = left * (bend * z + rise)
        for one, other, second in (
            (0, 0, left * bend * steepness**2),
            (0, 1, turn * steepness),
            (1, 1, turn * z),
            *((0, rate, rise * steepness) for rate in (2, 3)),
            *((1, rate, rise * z) for rate in (2, 3)),
        ):
            observed[:, one, other] -= (off * second).sum(axis=1)
            observed[:, other, one] = observed[:, one, other]
        concave = np.linalg.eigvalsh(observed + np.diag(FLAT)).min(axis=1) > 0
        information = np.where(concave[:, None, None], observed, expected)
        information[:, [2, 3], [2, 3]] += RATE_PRIOR / (1 - place[:, 2:]) ** 2
        likelihood = (right * np.log(p) + wrong * np.log1p(-p)).sum(axis=1)
        return cls(
            place,
            likelihood + log_prior(list(columns[..., 0])),
            (by @ off[..., None])[..., 0] + prior_gradient(place),
            information,
        )

    def where(self, better: BoolArray, other: Self) -> Self:
        """Return the other's places where they are better."""
        pairs = zip(self, other, strict=True)
        return type(self)(
            *(np.where(better.reshape(-1, *[1] * (old.ndim - 1)), new, old) for old, new in pairs)
        )
