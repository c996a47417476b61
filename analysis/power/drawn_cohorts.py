"""Cohorts of people who feel the predicted contrasts, answer, and score along a line."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256

import numpy as np

from analysis.estimates import BoolArray, FloatArray, IntArray
from analysis.loading.exclusions import kept_trials
from analysis.power.cohorts import Cohort
from analysis.sensitivity.ratings import Ratings
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import Change, trial_change
from device.friction.contrasts import predicted_contrast
from protocol.plan.plan import plan
from protocol.plan.trials import Trial
from protocol.study.questions import no_change
from protocol.study.rating import PAPERS_SCALE
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True)
class Raters:
    """A population whose scores are bias + gain · |felt contrast| + noise, on the paper's scale.

    A felt contrast, with noise of SD `felt_noise`, below the criterion is answered as no change.
    """

    bias: float = 6.6
    bias_sd: float = 0.7
    gain: float = 5.0
    gain_sd: float = 1.0
    felt_noise: float = 0.01
    criterion: float = 0.018
    rating_noise: float = 0.8


@dataclass(frozen=True, kw_only=True, eq=False)
class _Planned:
    """The trials of a cohort: whose, which condition and contrast, and of what kind."""

    subject: IntArray
    condition: IntArray
    contrast: FloatArray
    scored: BoolArray
    expects_none: BoolArray


@dataclass(frozen=True, kw_only=True)
class DrawnCohorts:
    """Simulated cohorts of a study, on its rig."""

    study: Study
    participants: int
    rig: Calibration = NOMINAL
    raters: Raters = field(default_factory=Raters)

    def tables(self, keys: Sequence[str]) -> FloatArray:
        """Return the tables of scores of the studies of `keys`."""
        found = np.full((len(keys), self.participants, len(self.study.conditions)), np.nan)
        for number, key in enumerate(keys):
            scores = self.cohort(key).scores
            found[number, : len(scores)] = scores
        return found

    def cohort(self, key: str) -> Cohort:
        """Return the study of `key`."""
        rng = np.random.default_rng(np.frombuffer(sha256(key.encode()).digest(), dtype=np.uint32))
        people, planned = self.raters, self._planned
        bias = rng.normal(people.bias, people.bias_sd, self.participants)
        gain = rng.normal(people.gain, people.gain_sd, self.participants)
        felt = planned.contrast + rng.normal(0, people.felt_noise, planned.contrast.shape)
        noticed = np.abs(felt) >= people.criterion
        agrees = np.where(planned.expects_none, ~noticed, noticed & (felt > 0))
        line = bias[planned.subject] + gain[planned.subject] * np.abs(felt)
        score = self._on_scale(line + rng.normal(0, people.rating_noise, felt.shape))
        if self.study.rating.score_when == "agrees":
            score = np.where(agrees, score, np.nan)
        reaction_s = rng.uniform(0.4, 2.0, felt.shape)
        return self._cohort(bias, gain, self._kept(agrees, score, reaction_s), score)

    def _on_scale(self, score: FloatArray) -> FloatArray:
        rating = self.study.rating
        above = np.clip(score, PAPERS_SCALE.minimum, PAPERS_SCALE.maximum) - PAPERS_SCALE.minimum
        return np.round(rating.minimum + above * (rating.span / PAPERS_SCALE.span))

    def _kept(self, agrees: BoolArray, score: FloatArray, reaction_s: FloatArray) -> BoolArray:
        """Return the trials that the study's rules of exclusion leave."""
        rules, planned = self.study.exclusions, self._planned
        if not rules.model_dump(exclude_none=True):
            return np.ones(len(score), dtype=bool)
        return kept_trials(
            rules,
            participant=planned.subject,
            trial_kind=np.where(planned.scored, "trial", "catch"),
            reaction_time_s=reaction_s,
            agrees=agrees,
            score=score,
        )

    def _cohort(
        self, bias: FloatArray, gain: FloatArray, kept: BoolArray, score: FloatArray
    ) -> Cohort:
        planned, unit = self._planned, self.study.rating.span / PAPERS_SCALE.span
        rated = kept & planned.scored
        left = np.unique(planned.subject[kept])
        ratings = Ratings(
            subjects=tuple(f"P{number + 1:02}" for number in left),
            conditions=self.study.conditions,
            subject=np.searchsorted(left, planned.subject[rated]),
            condition=planned.condition[rated],
            contrast=planned.contrast[rated],
            rating=score[rated],
        )
        zero = self.study.rating.minimum - unit * PAPERS_SCALE.minimum
        return Cohort(
            ratings=ratings,
            bias=zero + unit * bias[left],
            gain=unit * gain[left],
            population_gain=unit * self.raters.gain,
        )

    @cached_property
    def _planned(self) -> _Planned:
        """The plan of every participant and session, with the predicted contrasts."""
        slots, sessions = range(self.participants), range(1, self.study.design.sessions + 1)
        trials = [
            (slot, trial)
            for slot in slots
            for session in sessions
            for trial in plan(self.study, slot, session).trials
            if trial.kind in {"trial", "catch"}
        ]
        known: dict[Change, float] = {}
        names = self.study.conditions
        return _Planned(
            subject=np.array([slot for slot, _ in trials], dtype=np.int64),
            condition=np.array([names.index(str(it.condition)) for _, it in trials], np.int64),
            contrast=np.array([self._contrast(trial, known) for _, trial in trials]),
            scored=np.array([trial.scored for _, trial in trials]),
            expects_none=np.array([_expects_none(trial) for _, trial in trials]),
        )

    def _contrast(self, trial: Trial, known: dict[Change, float]) -> float:
        if trial.kind == "catch" or trial.question is None:
            return 0.0
        change = trial_change(self.study, trial.question, trial.expected, trial.touches)
        if change not in known:
            known[change] = predicted_contrast(change, rig=self.rig)
        return known[change]


def _expects_none(trial: Trial) -> bool:
    return trial.question is not None and trial.expected == no_change(trial.question)
