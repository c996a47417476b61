"""What the report's tests and estimators make of simulated cohorts, one row of numbers each.

Rows are added up to diagnosands later. Their columns depend on the study's conditions alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.power.people_cohorts import Cohort
from analysis.sensitivity.integration import Marginals
from analysis.sensitivity.linear_model import linear_lines
from analysis.sensitivity.lines import LineMixture, Medians, medians
from analysis.sensitivity.ordinal_model import ordinal_lines
from analysis.statistics.additive import gain_heterogeneity
from analysis.statistics.detection import noticed_p
from analysis.statistics.many_tables import omnibus_p, pairs_of, pairwise_of_tables, unnamed_table
from analysis.statistics.signed_rank import holm_of_rows

ESTIMATES = (
    *("M2 bias", "M2 gain", "M2 relative gain", "M2 group's gain"),
    *("M1 gain", "M1 relative gain", "M1 group's gain"),
)
SUMS = (
    *("count", "error", "squared error", "covered", "width"),
    *("significant", "wrong sign", "estimated size", "true size"),
)
"""Of one study's estimates of a kind; the last three over the significant ones alone."""
RANK = "rank"
"""The posterior probability below the truth, of the study's first subject with ratings."""


def columns(conditions: int, *, models: bool) -> list[str]:
    """Return the names of a row's numbers."""
    pairs = range(len(pairs_of(conditions)))
    tests = ["omnibus p", "gains p", "complete"]
    noticed = ["noticed p", *(f"noticed p {condition}" for condition in range(conditions))]
    of_pairs = [
        f"{what} {pair}"
        for what in ("pair p", "pair mean", "pair error", "pair subjects")
        for pair in pairs
    ]
    sums = [f"{name} {what}" for name, what in product(ESTIMATES, (*SUMS, RANK))]
    return [*tests, *of_pairs, *noticed, *(sums if models else [])]


def rows_of_tables(
    tables: Sequence[FloatArray], noticed: Sequence[IntArray] | None = None
) -> FloatArray:
    """Return a row per table of scores; tables of one shape are tested together.

    Subjects without any score count for nothing in the tests of scores. Without what was `noticed`
    (see `noticed_counts`), and without catch trials, there is no p of noticing.
    """
    # The report does not analyse a subject without any score.
    left = [table[~np.isnan(table).all(axis=1)] for table in tables]
    width = len(columns(tables[0].shape[1], models=False))
    rows = np.full((len(left), width), np.nan)
    # Tables of one shape are one array, which is far faster than a test at a time.
    for shape in {table.shape for table in left}:
        which = [number for number, table in enumerate(left) if table.shape == shape]
        # A cohort of which nobody is left has a row of NaN: no test, and no claim.
        if shape[0]:
            tested = _rows(np.array([left[number] for number in which]))
            rows[which, : tested.shape[1]] = tested
    if noticed is not None:
        rows[:, -tables[0].shape[1] - 1 :] = np.concatenate(list(map(_noticed_p, noticed)))
    return rows


def _noticed_p(counts: IntArray) -> FloatArray:
    """Return p of all conditions and, by Holm's correction, of each, shape (1, conditions + 1)."""
    signal, catch = counts[:, :-1], counts[:, -1]
    if not catch[:, 1].any():
        return np.full((1, counts.shape[1]), np.nan)
    whole = noticed_p(signal.sum(axis=1)[None], catch[None])
    each = signal.transpose(1, 0, 2)
    p = noticed_p(each, np.broadcast_to(catch, each.shape))
    # A condition whose trials expect no change has no test.
    p[each[:, :, 1].sum(axis=1) == 0] = np.nan
    return np.asarray(np.concatenate([whole, holm_of_rows(p[None])[0]])[None])


def _rows(scores: FloatArray) -> FloatArray:
    pairs = pairwise_of_tables(scores)
    return np.column_stack(
        [
            omnibus_p(scores),
            [_gains_p(one) for one in scores],
            ~np.isnan(scores).any(axis=(1, 2)),
            *(pairs.p_holm, pairs.mean, pairs.standard_error, pairs.subjects),
        ]
    )


def rows_of_cohorts(cohorts: Sequence[Cohort]) -> FloatArray:
    """Return a row per cohort: its tests, then what the sensitivity models estimate."""
    tests = rows_of_tables(
        [cohort.scores for cohort in cohorts], [cohort.noticed for cohort in cohorts]
    )
    return np.column_stack([tests, [_estimated(cohort) for cohort in cohorts]])


def _gains_p(scores: FloatArray) -> float:
    """Return the p of unequal gains; more shufflings are worth their time only where it is small.

    A p above .2 of the first ones is as good as never below .05 of all, so that none is claimed
    that all of them would not claim.
    """
    table = unnamed_table(scores)
    found = gain_heterogeneity(table, shuffles=99)
    if not isinstance(found, NotEstimable) and found.p <= 0.2:
        found = gain_heterogeneity(table, shuffles=999)
    return float("nan") if isinstance(found, NotEstimable) else found.p


@dataclass(frozen=True, kw_only=True, eq=False)
class _Estimated:
    """Estimates of a kind with intervals (n, 2), the truth, and the first one's posterior."""

    value: FloatArray
    interval: FloatArray
    truth: FloatArray
    posterior: Marginals
    weights: FloatArray


def _estimated(cohort: Cohort) -> list[float]:
    found = {**_of_model("M2", cohort), **_of_model("M1", cohort)}
    # A study without an estimate adds nothing to any sum.
    empty = [0.0] * len(SUMS) + [float("nan")]
    return [
        number for name in ESTIMATES for number in (_sums(found[name]) if name in found else empty)
    ]


def _of_model(model: str, cohort: Cohort) -> Mapping[str, _Estimated]:
    # Without what a report tells besides: neither the evidence of equal gains nor JNDs count here.
    mixture = (ordinal_lines if model == "M2" else linear_lines)(cohort.ratings)
    if isinstance(mixture, NotEstimable):
        return {}
    bias, gain, relative = medians(mixture)
    found = _of_subjects(cohort, {"bias": bias, "gain": gain, "relative gain": relative}, mixture)
    nothing = float("nan"), (float("nan"), float("nan"))
    of_group = nothing if mixture.alone else (gain[0][-1], gain[1][-1])
    found["group's gain"] = _Estimated(
        value=np.array([of_group[0]]),
        interval=np.array([of_group[1]]),
        truth=np.array([cohort.population_gain]),
        posterior=mixture.gain.part(slice(-1, None)),
        weights=mixture.points.weights,
    )
    return {f"{model} {name}": each for name, each in found.items()}


def _of_subjects(
    cohort: Cohort, estimates: Mapping[str, Medians], mixture: LineMixture
) -> dict[str, _Estimated]:
    rated = np.flatnonzero(mixture.counts > 0)
    # One person per study, because ranks of one study are not independent.
    first, gain = int(rated[0]), cohort.gain[rated]
    # A relative gain is about the people who were analysed, not about those left out.
    truths = {"bias": cohort.bias[rated], "gain": gain, "relative gain": gain - gain.mean()}
    posteriors = {"bias": mixture.bias, "gain": mixture.gain, "relative gain": mixture.relative}
    return {
        name: _Estimated(
            value=values[rated],
            interval=np.array([intervals[row] for row in rated]),
            truth=truths[name],
            posterior=posteriors[name].part(slice(first, first + 1)),
            weights=mixture.points.weights,
        )
        for name, (values, intervals) in estimates.items()
        if not (name == "relative gain" and mixture.alone)
    }


def _sums(found: _Estimated) -> list[float]:
    error = found.value - found.truth
    low, high = found.interval.T
    significant = (low > 0) | (high < 0)
    below = 1 - found.posterior.plus(-found.truth[0]).above_zero(found.weights)[0]
    return [
        len(error),
        float(error.sum()),
        float((error**2).sum()),
        float(((low <= found.truth) & (found.truth <= high)).sum()),
        float((high - low).sum()),
        float(significant.sum()),
        float((significant & (np.sign(found.value) != np.sign(found.truth))).sum()),
        float(np.abs(found.value[significant]).sum()),
        float(np.abs(found.truth[significant]).sum()),
        float(below),
    ]
