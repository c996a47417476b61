"""Diagnosands: power, bias, RMSE, coverage, type S and M errors, each with its Monte Carlo error.

Every one is a ratio of two sums over independent studies, so that the number of estimates in a
study may differ and its subjects may resemble each other.
"""

from collections.abc import Container, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import stdtr, stdtrit

from analysis.estimates import LEVEL, UPPER, BoolArray, FloatArray
from analysis.power.diagnosis import ESTIMATES, RANK, columns
from analysis.power.job import Design
from analysis.statistics.many_tables import pairs_of
from analysis.statistics.signed_rank import holm_of_rows
from protocol.registration.registration import FOLLOWS, GAINS, NOTICED, OMNIBUS, above


@dataclass(frozen=True)
class Measured:
    """A diagnosand with its Monte Carlo standard error; both NaN where nothing determines it."""

    value: float
    error: float


UNKNOWN = Measured(float("nan"), float("nan"))


def too_often(false: Measured) -> bool:
    """Return whether claims that are false are made in more than 5 %, beyond Monte Carlo error."""
    return false.value - 2 * false.error > LEVEL


def ratio(above: FloatArray, below: FloatArray) -> Measured:
    """Return the ratio of two sums over studies and its standard error (delta method).

    (1) and (2) of docs/mathematics/power.md: r = Σ a / Σ b; its error is √(Σ (a - r b)²) / Σ b. A
    share that all n studies had, or none, is not known without error: it has that of
    (n + 1) / (n + 2), or of 1 / (n + 2).

    >>> ratio(np.array([1.0, 0.0, 1.0, 0.0]), np.ones(4))
    Measured(value=0.5, error=0.25)
    """
    total = float(below.sum())
    if not total > 0:
        return UNKNOWN
    value = float(above.sum()) / total
    if value in {0.0, 1.0} and (above == value * below).all():
        studies = int((below > 0).sum())
        return Measured(value, float(np.sqrt((studies + 1) / studies) / (studies + 2)))
    return Measured(value, float(np.sqrt(((above - value * below) ** 2).sum())) / total)


def share(happened: FloatArray | BoolArray) -> Measured:
    """Return the share of studies with its standard error."""
    return ratio(happened.astype(np.float64), np.ones(len(happened)))


@dataclass(frozen=True, kw_only=True)
class TestPower:
    """How often a test rejects at 5%, and how often the family's rule lets it be claimed.

    `supported` is NaN where the rule does not hold what it promises: without any effect the claim
    is made more often than in 5%.
    """

    __test__ = False  # no test of pytest's

    name: str
    power: Measured
    supported: Measured


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateQuality:
    """How an estimate errs; `ranks` are the truths' places in their posteriors, from 0 to 1.

    `truth` is known where there is one for all studies, else NaN. `power` is the share of intervals
    without 0, `type_s` the share of those estimates with the
    wrong sign, `type_m` their mean size relative to the truth's.
    """

    name: str
    bias: Measured
    rmse: Measured
    coverage: Measured
    width: Measured
    power: Measured
    type_s: Measured
    type_m: Measured
    estimable: float
    ranks: FloatArray = field(repr=False)
    truth: float = float("nan")


@dataclass(frozen=True, kw_only=True)
class RegisteredPower:
    """How often a registered hypothesis is supported; NaN where that is not known or not protected.

    `row` is the test or estimate that decides on it, empty if it is none of those simulated.
    """

    name: str
    row: str
    power: Measured


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """What simulations tell of one design; `false_claims` are by test, in null cohorts.

    `unscored` is the share of studies in which somebody has no score under some condition.
    `registered` are the hypotheses of a registered study, the primary one first.
    """

    design: Design
    studies: int
    null_studies: int
    omnibus: str
    tests: tuple[TestPower, ...]
    estimates: tuple[EstimateQuality, ...]
    any_false_claim: Measured
    unscored: Measured
    false_claims: dict[str, Measured]
    registered: tuple[RegisteredPower, ...] = ()


def findings(
    design: Design,
    conditions: Sequence[str],
    rows: FloatArray,
    null_rows: FloatArray,
    hypotheses: Sequence[str] = (),
) -> Findings:
    """Return the diagnosands of a design.

    Args:
        design: the design.
        conditions: names.
        rows: of the simulated studies, shape (studies, numbers).
        null_rows: of null cohorts.
        hypotheses: the registered ones, the primary one first.
    """
    models = rows.shape[1] == len(columns(len(conditions), models=True))
    table = _Table(rows, columns(len(conditions), models=models))
    null = _Table(null_rows, columns(len(conditions), models=False))
    names, null_claims = _names(conditions), _claims(null, len(conditions))
    pairs = names[2 : 2 + len(pairs_of(len(conditions)))]
    # A study without catch trials has no test of noticing.
    tested = np.any(~np.isnan(_p_values(table, len(conditions))), axis=0)
    false = {
        name: share(made)
        for name, made, has in zip(names, null_claims.T, np.atleast_1d(tested), strict=True)
        if has or NOTICED not in name
    }
    # Power of a test that claims too much says nothing.
    broken = {name for name, each in false.items() if too_often(each)}
    p, claimed = _p_values(table, len(conditions)), _claims(table, len(conditions))
    return Findings(
        design=design,
        studies=len(rows),
        null_studies=len(null_rows),
        omnibus="Friedman" if (table["complete"] == 1).all() else "Friedman or Skillings-Mack",
        tests=tuple(
            TestPower(
                name=name,
                power=share(p[:, place] < LEVEL),
                supported=UNKNOWN if name in broken else share(made),
            )
            for place, (name, made) in enumerate(zip(names, claimed.T, strict=True))
            if name in false
        ),
        estimates=(
            *(_of_model(table, name) for name in ESTIMATES if models),
            *(_of_difference(table, pair, name) for pair, name in enumerate(pairs)),
        ),
        unscored=share(table["complete"] == 0),
        any_false_claim=share(np.asarray(null_claims.any(axis=1))),
        false_claims=false,
        registered=_registered(table, conditions, hypotheses, broken),
    )


def _names(conditions: Sequence[str]) -> list[str]:
    pairs = [f"{conditions[a]} - {conditions[b]}" for a, b in pairs_of(len(conditions))]
    return [OMNIBUS, GAINS, *pairs, NOTICED, *(f"{name} {NOTICED}" for name in conditions)]


@dataclass(frozen=True, eq=False)
class _Table:
    """Rows of numbers whose columns have names."""

    rows: FloatArray
    names: list[str]

    def __getitem__(self, name: str) -> FloatArray:
        return np.asarray(self.rows[:, self.names.index(name)])


def _p_values(table: _Table, conditions: int) -> FloatArray:
    pairs = [table[f"pair p {pair}"] for pair in range(len(pairs_of(conditions)))]
    noticed = [table[f"noticed p {condition}"] for condition in range(conditions)]
    tests = [table["omnibus p"], table["gains p"], *pairs, table["noticed p"], *noticed]
    return np.column_stack(tests)


def _claims(table: _Table, conditions: int) -> BoolArray:
    """Return which tests the family's rule lets a report claim, shape (studies, tests).

    The questions - do the conditions differ, do people's gains differ, and, with catch trials, are
    changes noticed - are one family with Holm's correction. A pair is claimed only if the
    conditions differ, by its own p after Holm's correction over all pairs, and a condition to be
    noticed only if changes are. So any false claim has a chance of at most 5%.
    """
    p, pairs = _p_values(table, conditions), 2 + len(pairs_of(conditions))
    # A missing p, as that of noticing without catch trials, is no part of the family.
    questions = holm_of_rows(p[:, [0, 1, pairs]]) < LEVEL
    own = p < LEVEL
    return np.column_stack(
        [
            questions[:, :2],
            questions[:, :1] & own[:, 2:pairs],
            questions[:, 2:],
            questions[:, 2:] & own[:, pairs + 1 :],
        ]
    )


_GROUPS_GAIN = "M2 group's gain"


def _registered(
    table: _Table, conditions: Sequence[str], hypotheses: Sequence[str], broken: Container[str]
) -> tuple[RegisteredPower, ...]:
    """Return the power for each hypothesis; all but the first count only together with it."""
    every = np.full(len(table.rows), np.nan)
    held = {
        name: (row, every if row in broken else supported)
        for name, (row, supported) in _held(table, conditions).items()
    }
    nothing = "", every
    _, first = held.get(hypotheses[0], nothing) if hypotheses else nothing
    found = [(name, *held.get(name, nothing)) for name in hypotheses]
    return tuple(
        # The primary one is tested alone and opens the way to the others, so that no correction is
        # due.
        RegisteredPower(name=name, row=row, power=share(np.minimum(supported, first)))
        for name, row, supported in found
    )


def _held(table: _Table, conditions: Sequence[str]) -> dict[str, tuple[str, FloatArray]]:
    """Return, by hypothesis, the row that decides on it and in which studies its test holds."""
    names, rejected = _names(conditions), (_p_values(table, len(conditions)) < LEVEL).T
    held = {name: (name, hit * 1.0) for name, hit in zip(names[:2], rejected, strict=False)}
    for pair, (a, b) in enumerate(pairs_of(len(conditions))):
        row, hit, mean = names[2 + pair], rejected[2 + pair], table[f"pair mean {pair}"]
        held[above(conditions[a], conditions[b])] = row, 1.0 * (hit & (mean > 0))
        held[above(conditions[b], conditions[a])] = row, 1.0 * (hit & (mean < 0))
    noticed = slice(2 + len(pairs_of(len(conditions))), None)
    for name, hit in zip(names[noticed], rejected[noticed], strict=True):
        held[name] = name, hit * 1.0
    if f"{_GROUPS_GAIN} significant" in table.names:
        held[FOLLOWS] = _GROUPS_GAIN, table[f"{_GROUPS_GAIN} significant"]
    return held


def _of_model(table: _Table, name: str) -> EstimateQuality:
    def sums(what: str) -> FloatArray:
        return table[f"{name} {what}"]

    count, significant = sums("count"), sums("significant")
    ranks = sums(RANK)
    return EstimateQuality(
        name=name,
        bias=ratio(sums("error"), count),
        rmse=_root(ratio(sums("squared error"), count)),
        coverage=ratio(sums("covered"), count),
        width=ratio(sums("width"), count),
        power=ratio(significant, count),
        type_s=ratio(sums("wrong sign"), significant),
        type_m=ratio(sums("estimated size"), sums("true size")),
        estimable=float((count > 0).mean()),
        ranks=ranks[~np.isnan(ranks)],
    )


def _of_difference(table: _Table, pair: int, name: str) -> EstimateQuality:
    """Return the quality of a mean difference; its truth is the mean over all studies.

    A truth that is 0 but for its Monte Carlo error has no sign and no size to be wrong about.
    """
    mean, error, subjects = (table[f"pair {what} {pair}"] for what in ("mean", "error", "subjects"))
    # One difference has no standard error.
    known = subjects > 1
    mean, error, df = mean[known], error[known], subjects[known] - 1
    truth = float(mean.mean()) if len(mean) else float("nan")
    half = stdtrit(df, UPPER) * error
    significant, off = np.abs(mean) > half, mean - truth
    has_sign = abs(truth) > 2 * share(mean).error
    found = (significant & has_sign).astype(np.float64)
    # Where all differences are equal there is no rank; 1 only avoids a division by zero.
    scale = np.where(error > 0, error, 1.0)
    return EstimateQuality(
        name=f"mean difference {name}",
        bias=share(off),
        rmse=_root(share(off**2)),
        coverage=share(np.abs(off) <= half),
        width=share(2 * half),
        power=share(significant),
        type_s=ratio(found * (np.sign(mean) != np.sign(truth)), found),
        type_m=ratio(found * np.abs(mean), found * abs(truth)),
        estimable=float(known.mean()),
        ranks=stdtr(df, (truth - mean) / scale)[error > 0],
        truth=truth,
    )


def _root(squares: Measured) -> Measured:
    value = float(np.sqrt(squares.value))
    # The delta method: the derivative of the root is one over twice the root.
    return Measured(value, squares.error / (2 * value) if value > 0 else 0.0)
