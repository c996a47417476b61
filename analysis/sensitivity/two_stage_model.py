"""M3: changes are noticed first, and rated if they were noticed."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from analysis.estimates import BoolArray, IntArray, NotEstimable
from analysis.sensitivity.latent_posterior import LatentPosterior
from analysis.sensitivity.lines import LineMixture
from analysis.sensitivity.noticing import (
    EXPECTED,
    OPPOSITE,
    SAME,
    ChangeDetection,
    Noticing,
    noticing,
)
from analysis.sensitivity.ordinal_model import (
    OrdinalSensitivity,
    PreparedTrials,
    fit_and_lines,
    latent_posterior,
    prepared_ratings,
)
from analysis.sensitivity.ratings import Ratings


@dataclass(frozen=True, kw_only=True, eq=False)
class AnsweredTrials:
    """Scored and catch trials with their answers.

    Parameters:
        ratings: contrasts are signed by the condition's expected direction.
        answer: shape (trials,), 1 the expected change, 0 the same, -1 the opposite change.
        two_sided: shape (trials,), whether the question offers the opposite change.

    Raises:
        ValueError: an invalid answer, or not one per trial.
    """

    ratings: Ratings
    answer: IntArray
    two_sided: BoolArray

    def __post_init__(self) -> None:
        count = len(self.ratings.rating)
        for name in ("answer", "two_sided"):
            if len(getattr(self, name)) != count:
                got = len(getattr(self, name))
                raise ValueError(f"{name} must have {count} trials, got {got}")
        other = self.answer[~np.isin(self.answer, [OPPOSITE, SAME, EXPECTED])]
        if other.size:
            raise ValueError(f"an answer must be -1, 0 or 1, got {other[0]}")

    @property
    def noticed(self) -> Ratings:
        """The trials with the sizes of their changes; scores only of changes that were noticed."""
        ratings, contrast = self.ratings, self.ratings.contrast
        noticed = (self.answer != SAME) & (self.answer == np.sign(contrast))
        return replace(
            ratings,
            contrast=np.abs(contrast),
            rating=np.where(noticed, ratings.rating, np.nan),
        )


@dataclass(frozen=True, kw_only=True)
class TwoStageSensitivity:
    """The fit of M3; d′ is at `reference_contrast`, the mean contrast of expected changes."""

    ratings: OrdinalSensitivity
    detection: tuple[ChangeDetection, ...]
    reference_contrast: float


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoStagePosterior:
    """Posteriors of both stages."""

    noticing: Noticing
    ready: PreparedTrials
    rating: LatentPosterior

    @cached_property
    def _rated(self) -> tuple[OrdinalSensitivity, LineMixture]:
        return fit_and_lines(self.ready, self.rating)

    @property
    def refusal(self) -> NotEstimable | None:
        """Why a stage is not known, or None."""
        return self.noticing.refusal or self._rated[1].refusal

    @property
    def summary(self) -> TwoStageSensitivity:
        """The estimates."""
        return TwoStageSensitivity(
            ratings=self._rated[0],
            detection=self.noticing.detection,
            reference_contrast=self.noticing.reference,
        )


def two_stage_sensitivity(trials: AnsweredTrials) -> TwoStageSensitivity | NotEstimable:
    """Return the estimates of `two_stage_posterior`, or why there are none."""
    posterior = two_stage_posterior(trials)
    if isinstance(posterior, NotEstimable):
        return posterior
    return posterior.refusal or posterior.summary


def two_stage_posterior(trials: AnsweredTrials) -> TwoStagePosterior | NotEstimable:
    """Return noticing and rating of changes, or why they are not estimable.

    The likelihood of a trial is that of the answer (`noticing`), times that of the score (M2, of
    the size of the change) if the change was noticed in its direction and scored. So a score that
    was withheld because the answer disagreed is an answer and not missing data. The stages have no
    parameter in common and are fitted one after the other. What was scored without a change, or
    after the wrong answer, tells nothing about the gain and is left out of the second stage.
    """
    if refusal := _refusal(trials):
        return refusal
    ready = prepared_ratings(trials.noticed)
    if isinstance(ready, NotEstimable):
        return NotEstimable(f"of the changes that were noticed, {ready.reason}")
    first = noticing(trials.ratings, trials.answer, trials.two_sided)
    return TwoStagePosterior(noticing=first, ready=ready, rating=latent_posterior(ready))


def _refusal(trials: AnsweredTrials) -> NotEstimable | None:
    contrast, answer = trials.ratings.contrast, trials.answer
    if not (contrast <= 0).any():
        return NotEstimable("the study has no catch or opposite trials with an answer")
    if not (contrast > 0).any():
        return NotEstimable("no trial has an expected change")
    if (answer == EXPECTED).all():
        return NotEstimable("every answer was the expected change, even without one")
    return None
