"""What the report's tests and estimators make of simulated cohorts, one row of numbers each.

Rows are added up to diagnosands later. Their columns depend on what the study asks alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations, product

import numpy as np

from analysis.estimates import FloatArray, IntArray, NotEstimable
from analysis.power.people_cohorts import Cohort
from analysis.sensitivity.integration import Marginals
from analysis.sensitivity.linear_model import linear_lines, own_gains
from analysis.sensitivity.lines import LineMixture, Medians, Ratings, medians
from analysis.sensitivity.ordinal_model import ordinal_lines
from analysis.simulation.simulation import Tables
from analysis.statistics.additive import gain_heterogeneity
from analysis.statistics.detection import noticed_p
from analysis.statistics.factorial import SESSION, Crossed, effects_of, factorial_p
from analysis.statistics.groups import CLAIMED, group_statistics
from analysis.statistics.many_tables import omnibus_p, pairs_of, pairwise_of_tables, unnamed_table
from analysis.statistics.signed_rank import holm_of_rows
from device.friction.changes import predicted_contrast, trial_change
from device.friction.scenes import NOMINAL, Calibration
from protocol.registration.registration import effect_of
from protocol.study.factor import CONDITION
from protocol.study.study import Study

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


GROUP_SCORE, GROUP_GAIN, BY_GROUP = CLAIMED.values()


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What the report of a study asks: of conditions and, if there are any, groups and factors.

    `factors` have their levels, sessions of a participant among them; `contrasts` is the predicted
    contrast of each condition as planned, for the gains of groups.
    """

    conditions: tuple[str, ...]
    groups: tuple[str, ...] = ()
    factors: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    contrasts: tuple[float, ...] = ()

    @property
    def of_design(self) -> dict[str, tuple[str, ...]]:
        """Each test of groups and factors, with the questions of which one must be answered by yes.

        A question itself waits for none.
        """
        pairs = [f"{a} - {b} between groups" for a, b in combinations(self.groups, 2)]
        return {
            **dict.fromkeys((GROUP_SCORE, GROUP_GAIN, BY_GROUP) if pairs else (), ()),
            **dict.fromkeys(pairs, (GROUP_SCORE,)),
            **{
                f"{condition}: {pair}": (GROUP_SCORE, BY_GROUP)
                for condition in self.conditions
                for pair in pairs
            },
            **{effect_of(*of): () for of in effects_of(self.factors)},
        }


def asked_by(study: Study, rig: Calibration = NOMINAL) -> Asked:
    """Return what the report of a study asks, with contrasts on that rig."""
    factors, several = study.factors, study.design.sessions > 1
    if several and not factors and len(study.conditions) > 1:
        factors = {CONDITION: study.conditions}
    changes = (
        trial_change(study, each.question, each.expected, each.touches) for each in study.condition
    )
    return Asked(
        conditions=study.conditions,
        groups=study.groups,
        factors=factors
        | ({SESSION: tuple(map(str, range(1, study.design.sessions + 1)))} if several else {}),
        contrasts=tuple(predicted_contrast(change, rig=rig) for change in changes),
    )


def columns(asked: Asked, *, models: bool) -> list[str]:
    """Return the names of a row's numbers."""
    pairs = range(len(pairs_of(len(asked.conditions))))
    tests = ["omnibus p", "gains p", "complete"]
    noticed = [
        "noticed p",
        *(f"noticed p {condition}" for condition in range(len(asked.conditions))),
    ]
    of_pairs = [
        f"{what} {pair}"
        for what in ("pair p", "pair mean", "pair error", "pair subjects")
        for pair in pairs
    ]
    of_design = [f"{name} {what}" for name in asked.of_design for what in ("p", "shift")]
    sums = [f"{name} {what}" for name, what in product(ESTIMATES, (*SUMS, RANK))]
    return [*tests, *of_pairs, *noticed, *of_design, *(sums if models else [])]


def rows_of_tables(tables: Tables, asked: Asked) -> FloatArray:
    """Return a row per cohort; tables of one shape are tested together.

    Subjects without any score count for nothing in the tests of scores. Without catch trials there
    is no p of noticing.
    """
    # The report does not analyse a subject without any score.
    kept = np.asarray(~np.isnan(tables.scores).all(axis=2))
    left = [table[some] for table, some in zip(tables.scores, kept, strict=True)]
    rows = np.full((len(left), 3 + 4 * len(pairs_of(len(asked.conditions)))), np.nan)
    # Tables of one shape are one array, which is far faster than a test at a time.
    for shape in {table.shape for table in left}:
        which = [number for number, table in enumerate(left) if table.shape == shape]
        # A cohort of which nobody is left has a row of NaN: no test, and no claim.
        if shape[0]:
            rows[which] = _rows(np.array([left[number] for number in which]))
    noticed = np.concatenate(list(map(_noticed_p, tables.noticed)))
    of_design = [
        [*_of_groups(scores, of[some], asked), *_of_factors(scores, apart[some], asked)]
        for scores, some, apart, of in zip(
            left, kept, tables.by_session, tables.groups, strict=True
        )
    ]
    return np.column_stack([rows, noticed, of_design])


def _of_groups(scores: FloatArray, groups: IntArray, asked: Asked) -> list[float]:
    """Return p and shift of each test of groups, in their order; NaN where there is none."""
    names, pairs = asked.groups, list(combinations(asked.groups, 2))
    if not pairs:
        return []
    if not len(scores):
        return [float("nan")] * (2 * (3 + len(pairs) * (1 + len(asked.conditions))))
    contrasts = np.broadcast_to(asked.contrasts, scores.shape)
    subject, condition = np.nonzero(np.isfinite(contrasts))
    ratings = Ratings(
        subjects=tuple(map(str, range(len(scores)))),
        conditions=asked.conditions,
        subject=subject,
        condition=condition,
        contrast=contrasts[subject, condition],
        rating=scores[subject, condition],
    )
    made = group_statistics(scores, own_gains(ratings), groups, names, asked.conditions)
    found: list[float] = []
    for it in (made.score, made.gain, made.interaction):
        found += [float("nan") if isinstance(it, NotEstimable) else it.p, float("nan")]
    for test in (made.score, *made.conditions.values()):
        own = () if isinstance(test, NotEstimable) else test.pairs
        known = {(pair.a, pair.b): (pair.p_holm, pair.shift) for pair in own}
        found += chain.from_iterable(known.get(pair, (float("nan"),) * 2) for pair in pairs)
    return found


def _of_factors(scores: FloatArray, by_session: FloatArray, asked: Asked) -> list[float]:
    """Return p of each effect, in their order, and NaN, because an effect has no sign."""
    if not asked.factors:
        return []
    within = {name: levels for name, levels in asked.factors.items() if name != SESSION}
    shape = [len(levels) for levels in within.values()]
    crossed = Crossed(factors=within, scores=scores.reshape(-1, *shape))
    wide = Crossed(
        factors=asked.factors, scores=by_session.reshape(-1, *shape, by_session.shape[-1])
    )
    p = factorial_p(crossed, wide if SESSION in asked.factors else None)
    return [number for each in p for number in (each, float("nan"))]


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


def estimates_of_cohorts(cohorts: Sequence[Cohort]) -> FloatArray:
    """Return, for each cohort, what the sensitivity models estimate."""
    return np.array([_estimated(cohort) for cohort in cohorts])


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
