"""The published scores (Table 4), their uncertainty, and the claims about them alone."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from analysis.claims.claim import Outcome, PaperClaims, human_outcome
from analysis.estimates import (
    LEVEL,
    LOWER,
    BoolArray,
    FloatArray,
    Interval,
    NotEstimable,
    ScoreTable,
)
from analysis.statistics.additive import AdditiveEffects, additive_effects
from analysis.statistics.intervals import mean_interval
from analysis.statistics.signed_rank import pairwise_signed_ranks
from device.friction.changes import CONDITIONS


def short(p: float) -> str:
    """Return a probability with three decimals and no leading zero.

    >>> short(0.0390625)
    '.039'
    """
    return f"{p:.3f}".removeprefix("0")


def in_words(interval: Interval) -> str:
    """Return a 95% interval in words.

    >>> in_words((7.694, 8.928))
    '95% CI 7.69 to 8.93'
    """
    return f"95% CI {interval[0]:.2f} to {interval[1]:.2f}"


def interval_of_all(count: int) -> Interval:
    """Return the exact 95% interval of a share, all of `count` having shown it.

    Clopper and Pearson, Biometrika 26, 1934.

    >>> round(interval_of_all(9)[0], 3)
    0.664
    """
    return LOWER ** (1 / count), 1.0


def _over_subjects(values: FloatArray) -> Interval:
    found = mean_interval(values)
    assert not isinstance(found, NotEstimable)
    return found


@dataclass(frozen=True)
class HumanScores:
    """Scores of subjects by condition, none missing, with their uncertainty."""

    table: ScoreTable

    @cached_property
    def means(self) -> dict[str, float]:
        columns = self.table.scores.mean(axis=0).tolist()
        return dict(zip(self.table.conditions, columns, strict=True))

    @cached_property
    def subject_means(self) -> FloatArray:
        """The comprehensive scores, shape (subjects,)."""
        return np.asarray(self.table.scores.mean(axis=1))

    @cached_property
    def effects(self) -> AdditiveEffects:
        found = additive_effects(self.table)
        assert isinstance(found, AdditiveEffects)
        return found

    @cached_property
    def _p_holm(self) -> dict[frozenset[str], float]:
        """Holm's p of each pair of conditions; 1 without any difference."""
        return {
            frozenset((pair.a, pair.b)): 1.0
            if isinstance(pair.p_holm, NotEstimable)
            else pair.p_holm
            for pair in pairwise_signed_ranks(self.table)
        }

    def mean_interval(self, condition: str) -> Interval:
        """Return the 95% interval of a condition's mean score."""
        return _over_subjects(self.table.scores[:, self.table.conditions.index(condition)])

    @property
    def grand_mean_interval(self) -> Interval:
        return _over_subjects(self.subject_means)

    def p_holm(self, one: str, others: Iterable[str]) -> dict[str, float]:
        """Return p of the signed rank tests of a condition against others, smallest first.

        Holm's correction is over all pairs of conditions.
        """
        found = {other: self._p_holm[frozenset((one, other))] for other in others}
        return dict(sorted(found.items(), key=lambda item: item[1]))

    def above(self, one: str, other: str) -> bool | None:
        """Return whether a condition was scored above another one, None where that is open.

        It is open while p after Holm's correction is .05 or more, unless the means contradict it.
        """
        # Means that contradict the claim need no test.
        if self.means[one] <= self.means[other]:
            return False
        return True if self._p_holm[frozenset((one, other))] < LEVEL else None

    def compared(self, one: str, others: Iterable[str]) -> str:
        """Return Holm's p of a condition against others in words."""
        against = ", ".join(f"{name} {short(p)}" for name, p in self.p_holm(one, others).items())
        return f"Holm p of {one} against {against}"

    def mean_in_words(self, condition: str) -> str:
        """Return a condition's mean score with its interval in words."""
        return f"mean score {self.means[condition]:.2f}, {in_words(self.mean_interval(condition))}"


SCORES = np.array(
    [
        [10, 8, 10, 10, 5],
        [10, 10, 10, 8, 7],
        [8, 8, 8, 7, 4],
        [10, 10, 10, 10, 8],
        [8, 8, 10, 8, 5],
        [8, 10, 10, 10, 7],
        [7, 10, 9, 8, 7],
        [7, 8, 10, 7, 8],
        [8, 8, 10, 7, 5],
    ],
    dtype=np.float64,
)
"""Table 4: subjects 1 to 9 in rows; frequency to pressure in columns."""
PUBLISHED = HumanScores(
    ScoreTable(
        subjects=tuple("123456789"),
        conditions=("frequency", "structure", "voltage", "direction", "pressure"),
        scores=SCORES,
    )
)
_LOWEST, _HIGHEST = PUBLISHED.subject_means.min(), PUBLISHED.subject_means.max()
_LOWEST_ROW = int(PUBLISHED.subject_means.argmin())
_HIGHEST_ROW = int(PUBLISHED.subject_means.argmax())
_GRAND = f"mean of all {SCORES.mean():.2f}, {in_words(PUBLISHED.grand_mean_interval)}"
CLAIMS = PaperClaims()


def about_subjects(rows: Iterable[int], main: Any, *details: Any, **computed: Any) -> Outcome:
    """Return a outcome on single subjects, with how far each is from the mean of all."""
    found = PUBLISHED.effects
    names = [PUBLISHED.table.subjects[row] for row in rows]
    intervals = {name: found.subject_intervals[name] for name in names}
    words = [
        f"subject {name} {found.subjects[name]:+.2f} from the mean of all, {in_words(interval)}"
        for name, interval in intervals.items()
    ]
    computed["intervals_from_mean_of_all"] = intervals
    return human_outcome("; ".join(words), main, *details, **computed)


def _as_printed(values: Iterable[float], printed: list[float], digits: int) -> BoolArray:
    """Return which values round to the printed ones."""
    return np.abs(np.round(np.array([*values]) + 1e-9, digits) - printed) < 1e-9


@CLAIMS.add(
    "Table 4",
    "the conditions' averages are 8.44, 8.89, 9.67, 8.33, 6.22, of all 8.31",
    "8.44, 8.89, 9.67, 8.33, 6.22; 8.31",
)
def _table4_averages() -> Outcome:
    """Recomputed from the scores, to two decimals."""
    columns, grand = [*PUBLISHED.means.values()], SCORES.mean()
    return human_outcome(
        _GRAND,
        _as_printed([*columns, grand], [8.44, 8.89, 9.67, 8.33, 6.22, 8.31], 2),
        columns=columns,
        grand=grand,
        intervals={name: PUBLISHED.mean_interval(name) for name in PUBLISHED.means},
        grand_interval=PUBLISHED.grand_mean_interval,
    )


@CLAIMS.add(
    "Table 4",
    "the comprehensive scores are 8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6",
    "the printed column",
)
def _table4_comprehensive() -> Outcome:
    """Row means of the scores, to one decimal."""
    printed = [8.6, 9, 7, 9.6, 7.8, 9, 8.2, 8, 7.6]
    # In a complete table all subjects have intervals of the same width.
    half = np.ptp(PUBLISHED.effects.subject_intervals["1"]) / 2
    return human_outcome(
        f"each ±{half:.2f} relative to the mean of all (95% CI)",
        _as_printed(PUBLISHED.subject_means, printed, 1),
        rows=PUBLISHED.subject_means,
        intervals_from_mean_of_all=PUBLISHED.effects.subject_intervals,
    )


@CLAIMS.add("Section 5.2, after Table 4", "the lowest average score is 7.2", "7.2")
def _table4_lowest() -> Outcome:
    """The smallest row mean."""
    # Half of the last digit that is printed.
    return about_subjects([_LOWEST_ROW], abs(_LOWEST - 7.2) < 0.05, lowest=_LOWEST)


@CLAIMS.add("Section 5.2, after Table 4", "the highest average score is 9.6", "9.6")
def _table4_highest() -> Outcome:
    """The largest row mean."""
    return about_subjects([_HIGHEST_ROW], abs(_HIGHEST - 9.6) < 0.05, highest=_HIGHEST)


@CLAIMS.add("Section 5.2, after Table 4", "comprehensive scores range from 7 to 10", "7 and 10")
def _table4_range() -> Outcome:
    """Smallest and largest row mean."""
    return about_subjects(
        [_LOWEST_ROW, _HIGHEST_ROW],
        [abs(_LOWEST - 7) < 0.05, abs(_HIGHEST - 10) < 0.05],
        lowest=_LOWEST,
        highest=_HIGHEST,
    )


@CLAIMS.add(
    "Section 5.2, after Table 4",
    "the device performs well and its effect is notable: the scores average 8.31",
    "8.31 is well above it",
    remark="not testable: the paper has neither a control condition nor catch trials, so that 8.31 "
    "may be what people score whatever they feel",
)
def _device_performs_well() -> Outcome:
    """The score of a condition without any change, with which to compare the others."""
    controls = [
        name
        for name in PUBLISHED.means
        # A control would be a condition in which nothing changes.
        if name not in CONDITIONS or CONDITIONS[name].before == CONDITIONS[name].after
    ]
    least = PUBLISHED.grand_mean_interval[0]
    better = [PUBLISHED.mean_interval(name)[1] < least for name in controls]
    return human_outcome(
        _GRAND,
        better,
        control_conditions=controls,
        grand=SCORES.mean(),
        grand_interval=PUBLISHED.grand_mean_interval,
    )
