"""What the report's tests and estimators make of simulated cohorts, one row of numbers each.

Rows are added up to diagnosands later. Their columns depend on what the study asks alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations

import numpy as np

from analysis.estimates import FloatArray, IntArray, Interval, NotEstimable
from analysis.power.people_cohorts import RatedCohort
from analysis.sensitivity.integration import Marginals
from analysis.sensitivity.linear_model import linear_lines, own_gains
from analysis.sensitivity.lines import Ratings, medians
from analysis.sensitivity.ordinal_model import ordinal_lines
from analysis.simulation import Tables
from analysis.statistics.additive import gain_heterogeneity
from analysis.statistics.corrections import holm_of_rows
from analysis.statistics.detection import noticed_p
from analysis.statistics.factorial import SESSION, Crossed, effects_of, factorial_p
from analysis.statistics.groups import CLAIMED, group_statistics
from analysis.statistics.many_tables import omnibus_p, pairwise_of_tables, unnamed_table
from device.friction.changes import predicted_contrast, trial_change
from device.friction.scenes import NOMINAL, Calibration
from protocol.registration.registration import GAINS, NOTICED, OMNIBUS, effect_of
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
    def pairs(self) -> list[str]:
        """Each pair of conditions, as its test and its mean difference are called."""
        return [f"{a} - {b}" for a, b in combinations(self.conditions, 2)]

    @property
    def of_design(self) -> dict[str, tuple[str, ...]]:
        """Each test of groups and factors, with the questions that it waits for; see `tests`."""
        pairs = [between_groups(pair) for pair in combinations(self.groups, 2)]
        in_conditions = [f"{condition}: {pair}" for condition in self.conditions for pair in pairs]
        return {
            **dict.fromkeys((GROUP_SCORE, GROUP_GAIN, BY_GROUP) if pairs else (), ()),
            **dict.fromkeys(pairs, (GROUP_SCORE,)),
            **dict.fromkeys(in_conditions, (GROUP_SCORE, BY_GROUP)),
            **{effect_of(*of): () for of in effects_of(self.factors)},
        }

    @property
    def tests(self) -> dict[str, tuple[str, ...]]:
        """Each test, with the questions of which one must be answered by yes before it counts.

        A question itself waits for none.
        """
        return {
            **dict.fromkeys((OMNIBUS, GAINS), ()),
            **dict.fromkeys(self.pairs, (OMNIBUS,)),
            NOTICED: (),
            **{f"{name} {NOTICED}": (NOTICED,) for name in self.conditions},
            **self.of_design,
        }


def between_groups(pair: tuple[str, str]) -> str:
    """Return what the test of two groups is called."""
    return f"{' - '.join(pair)} between groups"


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
    """Return the names of a row's numbers: of each test, and what of it."""
    noticed = [name for name in asked.tests if NOTICED in name]
    return [
        *(f"{OMNIBUS} p", f"{GAINS} p", "complete"),
        *(f"{pair} {what}" for what in ("p", "shift", "error", "subjects") for pair in asked.pairs),
        *(f"{name} p" for name in noticed),
        *(f"{name} {what}" for name in asked.of_design for what in ("p", "shift")),
        *(f"{name} {what}" for name in ESTIMATES if models for what in (*SUMS, RANK)),
    ]


def rows_of_tables(tables: Tables, asked: Asked) -> FloatArray:
    """Return a row per cohort; tables of one shape are tested together.

    Subjects without any score count for nothing in the tests of scores. Without catch trials there
    is no p of noticing.
    """
    # The report does not analyse a subject without any score.
    kept = np.asarray(~np.isnan(tables.scores).all(axis=2))
    left = [table[some] for table, some in zip(tables.scores, kept, strict=True)]
    rows = np.full((len(left), 3 + 4 * len(asked.pairs)), np.nan)
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


def estimates_of_cohorts(cohorts: Sequence[RatedCohort]) -> FloatArray:
    """Return, for each cohort, what the sensitivity models estimate."""
    # A study without an estimate adds nothing to any sum.
    empty = [0.0] * len(SUMS) + [float("nan")]
    both = ({**_of_model("M2", cohort), **_of_model("M1", cohort)} for cohort in cohorts)
    return np.array([list(chain(*(it.get(name, empty) for name in ESTIMATES))) for it in both])


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


def _of_model(model: str, cohort: RatedCohort) -> dict[str, list[float]]:
    # Without what a report tells besides: neither the evidence of equal gains nor JNDs count here.
    mixture = (ordinal_lines if model == "M2" else linear_lines)(cohort.ratings)
    if isinstance(mixture, NotEstimable):
        return {}
    weights, rated = mixture.points.weights, np.flatnonzero(mixture.counts > 0)
    bias, gain, relative = medians(mixture)
    true = cohort.gain[rated]
    kinds = {
        "bias": (bias, cohort.bias[rated], mixture.bias),
        "gain": (gain, true, mixture.gain),
        # A relative gain is about the people who were analysed, not about those left out.
        "relative gain": (relative, true - true.mean(), mixture.relative),
    }
    if mixture.alone:
        del kinds["relative gain"]
    # One person per study, because ranks of one study are not independent.
    first = slice(rated[0], rated[0] + 1)
    found = {
        name: _sums(values[rated], [ends[row] for row in rated], truth, drawn.part(first), weights)
        for name, ((values, ends), truth, drawn) in kinds.items()
    }
    nothing = float("nan"), (float("nan"), float("nan"))
    of_group = nothing if mixture.alone else (gain[0][-1], gain[1][-1])
    value, ends, truth = (np.array([it]) for it in (*of_group, cohort.population_gain))
    group = mixture.gain.part(slice(-1, None))
    found["group's gain"] = _sums(value, ends, truth, group, weights)
    return {f"{model} {name}": sums for name, sums in found.items()}


def _sums(
    value: FloatArray,
    interval: FloatArray | list[Interval],
    truth: FloatArray,
    posterior: Marginals,
    weights: FloatArray,
) -> list[float]:
    """Return the sums of estimates with intervals (n, 2), and the rank of the first truth."""
    error, (low, high) = value - truth, np.transpose(interval)
    significant = (low > 0) | (high < 0)
    sums = (
        *(error, error**2, (low <= truth) & (truth <= high), high - low, significant),
        significant & (np.sign(value) != np.sign(truth)),
        *(np.abs(value[significant]), np.abs(truth[significant])),
    )
    below = 1 - posterior.plus(-truth[0]).above_zero(weights)[0]
    return [len(error), *(float(each.sum()) for each in sums), float(below)]
