"""Simulated participants who first notice a change and then score what they felt of it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.estimates import FloatArray
from analysis.sensitivity.answers_model import StudyAnswers
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing_stage import Answered

NOISE, MEAN_GAIN = 0.15, 6.0
LEVELS = np.array([0.05, 0.1, 0.2, 0.35, 0.5])


@dataclass(frozen=True, kw_only=True, eq=False)
class AnsweredStudy:
    """Answers, and the true bias, gain and criterion of each subject; the last in noise SDs."""

    answers: StudyAnswers
    bias: FloatArray
    gain: FloatArray
    criterion: FloatArray


def answered_study(
    seed: int = 0,
    subjects: int = 12,
    repeats: int = 6,
    *,
    selects: bool = True,
    plus: float = 0.0,
    steeper: float = 0.0,
    later: float = 0.0,
) -> AnsweredStudy:
    """Return answers of people who score what they felt: level 4, gain 6, noise .15, criterion .15.

    Every other trial expects the contrary answer, which is given .05 less readily; one in six is a
    catch trial. Changes may be larger, `plus` so much, and are scored as before. The second half of
    the people has gains that are `steeper` and is a group of its own if they are; the second half
    of the trials is scored `later` points higher and is a session of its own if it is.
    """
    rng = np.random.default_rng([46, seed])
    once = np.tile(np.append(LEVELS + plus, 0.0), repeats)
    subject, contrast = np.repeat(np.arange(subjects), len(once)), np.tile(once, subjects)
    count = len(contrast)
    first = np.arange(count) % 2 == 0
    felt = contrast + NOISE * rng.normal(size=count)
    criterion = 0.15 * np.exp(0.2 * rng.normal(size=subjects))
    towards = 0.025 * (2 * first - 1)
    above, beneath = criterion[subject] - towards, criterion[subject] + towards
    answer = np.select([felt > above, felt < -beneath], [1, -1], 0)
    bias, gain = (
        rng.normal(4 - MEAN_GAIN * plus, 0.7, subjects),
        rng.normal(MEAN_GAIN, 1.0, subjects),
    )
    group = (np.arange(subjects) >= subjects / 2).astype(np.int64)
    session = np.tile(np.arange(len(once)) >= len(once) / 2, subjects).astype(np.int64)
    gain += steeper * group
    score = bias[subject] + gain[subject] * felt + later * session + 0.5 * rng.normal(size=count)
    given = (answer == 1) | (not selects)
    ratings = Ratings(
        subjects=tuple(f"P{number}" for number in range(subjects)),
        conditions=tuple(f"{level}" for level in LEVELS),
        subject=subject,
        condition=np.tile(np.arange(6) % 5, count // 6),
        contrast=contrast,
        rating=np.where(given & (contrast > 0), np.clip(np.round(score), 0, 10), np.nan),
    )
    answers = StudyAnswers(
        ratings=ratings,
        scale=(0.0, 10.0),
        answered=Answered(
            ratings=ratings,
            answer=answer,
            two_sided=np.ones(count, dtype=np.bool_),
            first=first,
            catch=contrast == 0,
        ),
        selects=selects,
        groups=("young", "old") if steeper else (),
        group=group if steeper else None,
        session=session if later else None,
    )
    return AnsweredStudy(answers=answers, bias=bias, gain=gain, criterion=criterion / NOISE)


def people(*numbers: int, **how: Any) -> StudyAnswers:
    """Return the answers alone."""
    return answered_study(*numbers, **how).answers
