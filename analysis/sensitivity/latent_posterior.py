"""Posterior of latent parameters, integrated over variance components."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.sensitivity import integration
from analysis.sensitivity.curvature import LatentTrials
from analysis.sensitivity.laplace import LARGE, Components, LatentField, LatentModes
from analysis.sensitivity.marginals import Combinations, marginals

# A study of few trials leaves the variance components uncertain, so that it needs more points to
# integrate over them; each costs less.
FEWEST_POINTS, MOST_POINTS = 400, 1000
POINTS_BY_TRIALS = 3.5e7
# The evidence alone, an average over fewer components, needs fewer points than limits far out: with
# these its logarithm is off by .02 at most.
EVIDENCE_PILOT, EVIDENCE_POINTS, EVIDENCE_EFFECTIVE = 60, 120, 50.0
# Of many trials laws differ by far more than this error of .3.
LARGE_EVIDENCE_PILOT, LARGE_EVIDENCE_POINTS, LARGE_EVIDENCE_EFFECTIVE = 20, 40, 12.0
# A proposal from so near the mode serves as well, because it adapts to its points. From farther off
# (2) its first points are too far apart in some studies, whose halves then disagree.
MODE_RISE = 0.5
# From LARGE different trials on, the components are known so well that fewer points suffice.
LARGE_EFFECTIVE = 100.0
# Of more different trials, the search for their mode begins at that of about so many.
MODE_TRIALS = 2_000
# Modes are foreseen by a parabola, up to this distance from the middle of the known ones.
FARTHEST = 2.5


@dataclass(frozen=True, kw_only=True, eq=False)
class LatentPosterior:
    """Weighted points of the components, in logarithms, and the mode at each."""

    trials: LatentTrials
    points: integration.WeightedPoints
    modes: LatentModes

    def marginals(self, combinations: Combinations) -> integration.Marginals:
        """Return posteriors of combinations of the latent parameters."""
        return marginals(self.modes, combinations)

    def of_lines(self, of_line: FloatArray) -> Combinations:
        """Return of_line · line of each subject."""
        subjects, size = self.trials.subjects, len(self.trials.shared_start)
        shared = np.zeros((subjects, size))
        shared[:, self.trials.line_columns] = of_line
        rated = np.bincount(self.trials.subject, minlength=subjects) > 0
        return Combinations(
            shared=shared,
            subject=np.arange(subjects),
            own=np.tile(of_line, (subjects, 1)),
            common=np.zeros((subjects, 2)),
            mean=rated / rated.sum(),
        )


class _Density:
    """The log posterior of the components, which keeps the modes at its last points."""

    def __init__(
        self,
        field: LatentField,
        start: FloatArray,
        components: Callable[[FloatArray], Components],
        log_prior: integration.LogDensity,
    ) -> None:
        self._field, self._components, self._log_prior = field, components, log_prior
        first = self._field.modes(components(start[None]), self._field.start(1))
        self.known = start[None], first

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return the log posterior at each of the points."""
        foreseen = _foreseen(self._field, self.known, points)
        del self.known  # they take much memory
        modes = self._field.modes(self._components(points), foreseen)
        self.known = points, modes
        return modes.log_evidence + self._log_prior(points)


Known = tuple[_Density, FloatArray, FloatArray | float]
"""The density of the components, where the search for its mode begins, and steps along the axes."""


def integrated(
    field: LatentField,
    start: FloatArray,
    components: Callable[[FloatArray], Components],
    log_prior: integration.LogDensity,
    *,
    few: bool = False,
) -> Iterator[LatentPosterior]:
    """Yield the posterior of the field's parameters, integrated from `start` over `components`.

    The second one has twice as many points, for `settled`. It has `few` points if it is one of many
    that are put together.
    """
    density, start, step = _known(field, start, components, log_prior)
    wanted = int(POINTS_BY_TRIALS / len(field.trials.x) ** 2)
    wanted = min(max(wanted, FEWEST_POINTS), MOST_POINTS)
    least = LARGE_EFFECTIVE if len(field.trials.x) > LARGE else None
    pilot = integration.PILOT
    if few and len(field.trials.x) > LARGE:
        pilot, wanted = LARGE_EVIDENCE_PILOT, LARGE_EVIDENCE_POINTS
        least = LARGE_EVIDENCE_EFFECTIVE
    elif few:
        pilot, wanted, least = EVIDENCE_PILOT, EVIDENCE_POINTS, EVIDENCE_EFFECTIVE
    for points, kept in integration.weighted_points(
        density, start, wanted, least, pilot=pilot, rise=MODE_RISE, step=step
    ):
        # The last evaluation was at the returned points, so these are their modes. Hardly any is
        # left out, and a copy of the others would take much memory.
        density.known = points.points, density.known[1].kept(kept)
        yield LatentPosterior(
            trials=field.trials,
            points=points,
            modes=density.known[1],
        )


def log_evidence(
    field: LatentField,
    start: FloatArray,
    components: Callable[[FloatArray], Components],
    log_prior: integration.LogDensity,
) -> float:
    """Return the logarithm of the integral alone of which `integrated` gives the posterior."""
    density, start, step = _known(field, start, components, log_prior)
    points, _ = next(
        integration.weighted_points(
            density,
            start,
            EVIDENCE_POINTS,
            EVIDENCE_EFFECTIVE,
            pilot=EVIDENCE_PILOT,
            rise=MODE_RISE,
            step=step,
        )
    )
    return points.log_evidence


def _known(
    field: LatentField,
    start: FloatArray,
    components: Callable[[FloatArray], Components],
    log_prior: integration.LogDensity,
) -> Known:
    density, step = _Density(field, start, components, log_prior), integration.CURVATURE_STEP
    count = len(field.trials.x)
    if count <= MODE_TRIALS:
        return density, start, step
    few = LatentField(field.trials.some(-(-count // MODE_TRIALS)))
    start, spread = integration.mode_of(_Density(few, start, components, log_prior), start)
    # So many trials determine the components so well that over longer steps the density is no
    # parabola, and its mode and curvature would be missed.
    sds = np.sqrt(np.diag(spread) * len(few.trials.x) / count)
    return density, start, np.minimum(step, sds)


def _foreseen(
    field: LatentField, known: tuple[FloatArray, LatentModes], points: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return starts for the search of the modes at `points`, linear in those that are known."""
    fine = np.isfinite(known[1].value)
    if not fine.any():
        return field.start(len(points))
    places, modes = known[0][fine], known[1].parameters[fine]
    centre = places.mean(axis=0)
    design, wanted = (_polynomial(part - centre) for part in (places, points))
    columns = design.shape[1] if len(places) > 2 * design.shape[1] else 1 + points.shape[1]
    plane = np.linalg.lstsq(design[:, :columns], modes, rcond=1e-6)[0]
    found, size = wanted[:, :columns] @ plane, known[1].shared.shape[1]
    return found[:, :size], found[:, size:].reshape(len(points), -1, 2)


def _polynomial(away: FloatArray) -> FloatArray:
    """Return 1, the distances, limited, and their products of two."""
    near = np.clip(away, -FARTHEST, FARTHEST)
    one, other = np.triu_indices(near.shape[1])
    return np.column_stack([np.ones(len(near)), near, near[:, one] * near[:, other]])
