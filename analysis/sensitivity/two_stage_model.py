"""M3: changes are noticed first, and rated if they were noticed."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np
from scipy.special import expit

from analysis.estimates import BoolArray, IntArray, NotEstimable
from analysis.sensitivity import ordinal_model
from analysis.sensitivity.curvature import BEYOND, mills_ratio
from analysis.sensitivity.lines import Lines, Ratings
from analysis.sensitivity.noticing import (
    EXPECTED,
    OPPOSITE,
    SAME,
    ChangeDetection,
    Noticed,
    Noticing,
    noticing,
)

# The noise of people who hardly notice anything is known to be large, and not how large.
LEAST_D_PRIME = 0.1


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
            ratings, contrast=np.abs(contrast), rating=np.where(noticed, ratings.rating, np.nan)
        )


Fitting: TypeAlias = Callable[[ordinal_model.PreparedTrials], ordinal_model.OrdinalPosterior]
Kind = Literal["the change", "what was felt"]
"""What people score: the change, with other noise, or what they felt when they noticed it."""


@dataclass(frozen=True, kw_only=True)
class TwoStageSensitivity:
    """The fit of M3; d′ is at `reference_contrast`, the mean contrast of expected changes.

    `scored` is the kind of people under which the scores are more probable, with the posterior
    probability `scored_p` if both were equally probable before; `other_gain` is the group's gain if
    they are of the other kind, NaN if that cannot be told.
    """

    ratings: ordinal_model.OrdinalSensitivity
    detection: tuple[ChangeDetection, ...]
    reference_contrast: float
    scored: Kind
    scored_p: float
    other_gain: float

    @property
    def lines(self) -> Lines:
        """The subjects' lines in the ratings of noticed changes."""
        return self.ratings.lines


@dataclass(frozen=True, kw_only=True, eq=False)
class RatingStage:
    """The second stage for one kind of people: its trials and their posterior."""

    kind: Kind
    ratings: Ratings
    posterior: ordinal_model.OrdinalPosterior

    @property
    def log_evidence(self) -> float:
        """That of people of this kind."""
        return self.posterior.latent.points.log_evidence


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoStagePosterior:
    """Posteriors of the second stage; `rating` is that of the more probable kind of people."""

    noticed: Noticed
    rating: RatingStage
    other: RatingStage

    @cached_property
    def summary(self) -> TwoStageSensitivity | NotEstimable:
        """The estimates, or why the second stage tells none."""
        fit, other = self.rating.posterior.fit, self.other.posterior
        if isinstance(fit, NotEstimable):
            return fit
        unknown = other.refusal or other.lines.alone
        (gains,) = other.lines.gain.quantiles(other.latent.points.weights, 0.5)
        return TwoStageSensitivity(
            ratings=fit,
            detection=self.noticed.detection,
            reference_contrast=self.noticed.reference,
            scored=self.rating.kind,
            scored_p=float(expit(self.rating.log_evidence - self.other.log_evidence)),
            other_gain=math.nan if unknown else float(gains[-1]),
        )


def first_stage(trials: AnsweredTrials) -> Noticing | NotEstimable:
    """Return the noticing of changes, or why that and their rating are not estimable.

    The likelihood of a trial is that of the answer (`noticing`), times that of the score (M2) if
    the change was noticed in its direction and scored. So a score that was withheld because the
    answer disagreed is an answer and not missing data. The stages are fitted one after the other.
    """
    if refusal := _refusal(trials):
        return refusal
    ready = ordinal_model.prepared_ratings(trials.noticed)
    if isinstance(ready, NotEstimable):
        return NotEstimable(f"of the changes that were noticed, {ready.reason}")
    first = noticing(trials.ratings, trials.answer, trials.two_sided)
    return first.refusal or first


def two_stage_posterior(
    trials: AnsweredTrials, noticed: Noticed, fitted: Fitting = ordinal_model.posterior_of
) -> TwoStagePosterior:
    """Return the rating of changes, of which the first stage has told what was `noticed`.

    What was scored without a change, or after the wrong answer, tells nothing about the gain and is
    left out of the second stage. That is fitted twice: to the sizes of the changes, and to what
    those who notice feel of them (`felt_if_noticed`). The kind with the higher evidence is taken.
    `fitted` returns the posterior of prepared ratings.
    """
    stages = [
        _stage("the change", trials.noticed, fitted),
        _stage("what was felt", felt_if_noticed(trials.noticed, noticed), fitted),
    ]
    other, rating = sorted(stages, key=lambda stage: stage.log_evidence)
    return TwoStagePosterior(noticed=noticed, rating=rating, other=other)


def _stage(kind: Kind, ratings: Ratings, fitted: Fitting) -> RatingStage:
    ready = ordinal_model.prepared_ratings(ratings)
    assert isinstance(ready, ordinal_model.PreparedTrials)
    return RatingStage(kind=kind, ratings=ratings, posterior=fitted(ready))


def felt_if_noticed(noticed: Ratings, first: Noticed) -> Ratings:
    """Return the trials with what is felt on average by those who notice the change.

    Somebody who scores only what exceeds the criterion κ felt more of a weak change than there was:
    (21) of mathematics/sensitivity on average (Heckman, Econometrica 47, 1979), in which noise and
    κ are each subject's medians of the first stage.
    """
    d_prime, criterion = np.array([[e.d_prime, e.criterion] for e in first.detection]).T
    noise = (first.reference / np.maximum(d_prime, LEAST_D_PRIME))[noticed.subject]
    above = np.maximum(criterion[noticed.subject] - noticed.contrast / noise, BEYOND)
    return replace(noticed, contrast=noticed.contrast + noise / mills_ratio(above))


def _refusal(trials: AnsweredTrials) -> NotEstimable | None:
    contrast, answer = trials.ratings.contrast, trials.answer
    if not (contrast <= 0).any():
        return NotEstimable("the study has no catch or opposite trials with an answer")
    if not (contrast > 0).any():
        return NotEstimable("no trial has an expected change")
    if (answer == EXPECTED).all():
        return NotEstimable("every answer was the expected change, even without one")
    return None
