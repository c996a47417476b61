"""Diagnosands: power, bias, RMSE, coverage, type S and M errors, each with its Monte Carlo error.

Every one is a ratio of two sums over independent studies, so that the number of estimates in a
study may differ and its subjects may resemble each other.
"""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import isfinite

import numpy as np
from scipy.special import stdtr, stdtrit

from analysis.estimates import LEVEL, UPPER, BoolArray, FloatArray, Json
from analysis.power.diagnosis import ESTIMATES, RANK, SUMS, Asked, between_groups, columns
from analysis.power.job import Design
from analysis.statistics.corrections import holm_of_rows
from protocol.registration.registration import FOLLOWS, NOTICED, above, between, effect_of


@dataclass(frozen=True)
class Measured:
    """A diagnosand with its Monte Carlo standard error; both NaN where nothing determines it."""

    value: float
    error: float

    def as_json(self, name: str, error: str = "mc_error") -> Json:
        """Return value and error under these names."""
        return {name: finite(self.value), error: finite(self.error)}


def finite(value: float) -> float | None:
    """Return a number as JSON, which has neither NaN nor infinity."""
    return value if isfinite(value) else None


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
    is made more often than in 5%. `after` has the questions that it waits for: none of a question.
    """

    __test__ = False  # no test of pytest's

    name: str
    after: tuple[str, ...]
    power: Measured
    supported: Measured


@dataclass(frozen=True, kw_only=True, eq=False)
class EstimateQuality:
    """How an estimate errs; `ranks` are the truths' places in their posteriors, from 0 to 1.

    `truth` is known where there is one for all studies, else NaN. `power` is the share of intervals
    without 0, `type_s` that of those estimates with the wrong sign, `type_m` their mean size
    relative to the truth's.
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
    asked: Asked,
    rows: FloatArray,
    null_rows: FloatArray,
    hypotheses: Sequence[str] = (),
    of_tracks: "Held | None" = None,
) -> Findings:
    """Return the diagnosands of a design from `rows` of its studies, shape (studies, numbers).

    `null_rows` are of null cohorts; `hypotheses` the registered ones, the primary one first;
    `of_tracks` tells in which of the same studies those on thresholds are supported.
    """
    models = rows.shape[1] == len(columns(asked, models=True))
    table, null = _named(rows, asked, models=models), _named(null_rows, asked, models=False)
    tests, claimed, null_claims = asked.tests, _claims(table, asked), _claims(null, asked)
    false = {
        name: share(made)
        for name, made in zip(tests, null_claims.T, strict=True)
        # A study without catch trials has no test of noticing.
        if NOTICED not in name or not np.isnan(table[f"{name} p"]).all()
    }
    # Power of a test that claims too much says nothing.
    broken = {name for name, each in false.items() if too_often(each)}
    held = {**_held(table, asked, broken), **(of_tracks or {})}
    return Findings(
        design=design,
        studies=len(rows),
        null_studies=len(null_rows),
        omnibus="Friedman" if (table["complete"] == 1).all() else "Friedman or Skillings-Mack",
        tests=tuple(
            TestPower(
                name=name,
                after=after,
                power=share(table[f"{name} p"] < LEVEL),
                supported=UNKNOWN if name in broken else share(made),
            )
            for (name, after), made in zip(tests.items(), claimed.T, strict=True)
            if name in false
        ),
        estimates=(
            *(_of_model(table, name) for name in ESTIMATES if models),
            *(_of_difference(table, pair) for pair in asked.pairs),
        ),
        unscored=share(table["complete"] == 0),
        any_false_claim=share(np.asarray(null_claims.any(axis=1))),
        false_claims=false,
        registered=registered_power(held, hypotheses),
    )


Table = Mapping[str, FloatArray]
"""The numbers of all studies, shape (studies,), by the name of their column."""


def _named(rows: FloatArray, asked: Asked, *, models: bool) -> Table:
    return dict(zip(columns(asked, models=models), rows.T, strict=True))


def _claims(table: Table, asked: Asked) -> BoolArray:
    """Return which tests the family's rule lets a report claim, shape (studies, tests).

    The questions - do the conditions differ, do people's gains differ, with catch trials, are
    changes noticed, and those of groups and factors - are one family with Holm's correction. Any
    other test, corrected already, is claimed only if a question that it waits for is: a pair only
    if the conditions differ. So any false claim has a chance of at most 5%.
    """
    tests = asked.tests
    p = np.column_stack([table[f"{name} p"] for name in tests])
    places = [place for place, after in enumerate(tests.values()) if not after]
    # A missing p, as that of noticing without catch trials, is no part of the family.
    p[:, places] = holm_of_rows(p[:, places])
    own, at = p < LEVEL, list(tests).index
    return np.column_stack(
        [
            hit & own[:, [at(name) for name in after]].any(axis=1) if after else hit
            for hit, after in zip(own.T, tests.values(), strict=True)
        ]
    )


_GROUPS_GAIN = "M2 group's gain"


Held = Mapping[str, tuple[str, FloatArray]]
"""By hypothesis: the row that decides on it, and 1 in each study that supports it, else 0."""


def registered_power(held: Held, hypotheses: Sequence[str]) -> tuple[RegisteredPower, ...]:
    """Return the power for each hypothesis; all but the first count only together with it."""
    found = [(name, *held.get(name, ("", np.full(1, np.nan)))) for name in hypotheses]
    return tuple(
        # The primary one is tested alone and opens the way to the others, so that no correction is
        # due.
        RegisteredPower(name=name, row=row, power=share(np.minimum(supported, found[0][2])))
        for name, row, supported in found
    )


def _held(table: Table, asked: Asked, broken: Container[str]) -> Held:
    """Return, by hypothesis, the row that decides on it and in which studies its test holds."""
    hits = {name: (table[f"{name} p"] < LEVEL).astype(np.float64) for name in asked.tests}
    held = {name: (name, hit) for name, hit in hits.items()}
    groups = list(combinations(asked.groups, 2))
    for named, pairs, rows in (
        (above, combinations(asked.conditions, 2), asked.pairs),
        (between, groups, map(between_groups, groups)),
    ):
        for (a, b), row in zip(pairs, rows, strict=True):
            shift = table[f"{row} shift"]
            held[named(a, b)] = row, hits[row] * (shift > 0)
            held[named(b, a)] = row, hits[row] * (shift < 0)
    for a, b in combinations(asked.factors, 2):
        held[effect_of(b, a)] = held[effect_of(a, b)]
    if f"{_GROUPS_GAIN} significant" in table:
        held[FOLLOWS] = _GROUPS_GAIN, table[f"{_GROUPS_GAIN} significant"]
    every = np.full(len(table["complete"]), np.nan)
    return {name: (row, every if row in broken else hit) for name, (row, hit) in held.items()}


def _of_model(table: Table, name: str) -> EstimateQuality:
    of = {what: table[f"{name} {what}"] for what in (*SUMS, RANK)}
    count, significant, ranks = of["count"], of["significant"], of[RANK]
    return EstimateQuality(
        name=name,
        bias=ratio(of["error"], count),
        rmse=root(ratio(of["squared error"], count)),
        coverage=ratio(of["covered"], count),
        width=ratio(of["width"], count),
        power=ratio(significant, count),
        type_s=ratio(of["wrong sign"], significant),
        type_m=ratio(of["estimated size"], of["true size"]),
        estimable=float((count > 0).mean()),
        ranks=ranks[~np.isnan(ranks)],
    )


def _of_difference(table: Table, pair: str) -> EstimateQuality:
    """Return the quality of a mean difference; its truth is the mean over all studies.

    A truth that is 0 but for its Monte Carlo error has no sign and no size to be wrong about.
    """
    mean, error, subjects = (table[f"{pair} {what}"] for what in ("shift", "error", "subjects"))
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
        name=f"mean difference {pair}",
        bias=share(off),
        rmse=root(share(off**2)),
        coverage=share(np.abs(off) <= half),
        width=share(2 * half),
        power=share(significant),
        type_s=ratio(found * (np.sign(mean) != np.sign(truth)), found),
        type_m=ratio(found * np.abs(mean), found * abs(truth)),
        estimable=float(known.mean()),
        ranks=stdtr(df, (truth - mean) / scale)[error > 0],
        truth=truth,
    )


def root(squares: Measured) -> Measured:
    value = float(np.sqrt(squares.value))
    # The delta method: the derivative of the root is one over twice the root.
    return Measured(value, squares.error / (2 * value) if value > 0 else 0.0)
