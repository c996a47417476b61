"""The summary of simulated studies: power, bias, RMSE, coverage and width, with Monte Carlo errors.

Each is a ratio of two sums over independent studies, so that the number of estimates in a study may
differ and its subjects may resemble each other.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.estimates import LEVEL, BoolArray, FloatArray, Json
from analysis.power.designs import Design
from analysis.power.null_cohorts import kind_named
from analysis.power.study_records import MEAN_GAIN, Asked, Records
from analysis.statistics.corrections import holm_of_rows
from protocol.registration.registration import GAINS, NOTICED, OMNIBUS, implying_differences


@dataclass(frozen=True)
class Measured:
    """A number with its Monte Carlo standard error; both NaN where nothing determines it."""

    value: float
    error: float

    def as_json(self, name: str, error: str = "mc_error") -> Json:
        """Return value and error under these names."""
        return {name: self.value, error: self.error}


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


def share(happened: BoolArray) -> Measured:
    """Return the share of studies with its standard error."""
    return ratio(happened.astype(np.float64), np.ones(len(happened)))


@dataclass(frozen=True, kw_only=True)
class TestPower:
    """How often a test rejects at 5%, and how often the family's rule lets it be claimed.

    `false` is how often it is claimed in each kind of null cohort, NaN where it is true there, and
    `supported` is NaN where any of them is more than 5%; all are NaN for a test beside the family.
    `after` has the questions that a test waits for: none of a question, None beside the family.
    """

    __test__ = False  # no test of pytest's

    name: str
    after: tuple[str, ...] | None
    power: Measured
    supported: Measured
    false: Mapping[str, Measured]


@dataclass(frozen=True, kw_only=True)
class EstimateQuality:
    """How an estimate errs; `estimable` is the share of those to be made that could be."""

    name: str
    bias: Measured
    rmse: Measured
    coverage: Measured
    width: Measured
    estimable: Measured


@dataclass(frozen=True, kw_only=True)
class Summary:
    """What simulations tell of one design.

    `told` is the share of studies in which the gains of people are told. `any_false_claim` is the
    share of null cohorts of each kind in which any test of the family is claimed that is false
    there, NaN where none is; `null_studies` are there of each kind. `alike` is whether the people
    of all groups were drawn from one population.
    """

    design: Design
    studies: int
    null_studies: int
    tests: tuple[TestPower, ...]
    estimates: tuple[EstimateQuality, ...]
    told: Measured
    any_false_claim: Mapping[str, Measured]
    alike: bool = False


def summary(
    design: Design, asked: Asked, studies: Records, nulls: Mapping[str, Records]
) -> Summary:
    """Return the summary of a design from the records of its studies and of each kind of null.

    `nulls` are by the names of the kinds, that without any effect first.
    """
    claimed = claims(asked, studies.p)
    false = {
        kind: {
            name: made
            for name, made in claims(asked, records.p).items()
            if kind_named(kind).is_false(asked, name)
        }
        for kind, records in nulls.items()
    }
    estimates = np.moveaxis(studies.estimates, 1, 0)
    return Summary(
        design=design,
        studies=len(studies.p),
        null_studies=len(next(iter(nulls.values())).p),
        tests=tuple(
            _test(
                name,
                asked.family.get(name),
                studies.p[:, place],
                claimed.get(name),
                {kind: of_kind.get(name) for kind, of_kind in false.items()},
            )
            for place, name in enumerate(asked.tests)
            # A study without catch trials has no test of noticing, nor of gains that nothing tells.
            if not (NOTICED in name or name == GAINS) or not np.isnan(studies.p[:, place]).all()
        ),
        estimates=tuple(
            _estimate(name, sums, design.participants)
            for name, sums in zip(asked.estimates, estimates, strict=True)
        ),
        told=UNKNOWN if np.isnan(studies.told).any() else share(studies.told > 0),
        any_false_claim={
            kind: share(np.logical_or.reduce([*of_kind.values()])) if of_kind else UNKNOWN
            for kind, of_kind in false.items()
        },
        alike=asked.alike,
    )


def claims(asked: Asked, p: FloatArray) -> dict[str, BoolArray]:
    """Return in which studies the family's rule lets a report claim each of its tests.

    The questions - do the conditions differ, do responses follow the prediction, with catch trials,
    are changes noticed, and those of groups and factors - are one family with Holm's correction;
    conditions also differ if one holds that implies it. Any other test, corrected already, is
    claimed only if a question that it waits for is: a pair only if the conditions differ. So where
    nothing has an effect any claim has a chance of at most 5%; beside a true effect false ones have
    more (docs/mathematics/power.md).
    """
    questions = [place for place, after in enumerate(asked.family.values()) if not after]
    p = p.copy()
    # A missing p, as that of noticing without catch trials, is no part of the family.
    p[:, questions] = holm_of_rows(p[:, questions])
    below = dict(zip(asked.family, (p < LEVEL).T, strict=False))  # others stand after the family
    if OMNIBUS in below:
        grounds = [below[name] for name in implying_differences(asked.family)]
        below[OMNIBUS] = np.logical_or.reduce([below[OMNIBUS], *grounds])
    return {
        name: below[name] & np.logical_or.reduce([below[question] for question in after])
        if after
        else below[name]
        for name, after in asked.family.items()
    }


def _test(
    name: str,
    after: tuple[str, ...] | None,
    p: FloatArray,
    claimed: BoolArray | None,
    false: Mapping[str, BoolArray | None],
) -> TestPower:
    shares = {kind: UNKNOWN if made is None else share(made) for kind, made in false.items()}
    supported = UNKNOWN if claimed is None else share(claimed)
    # Power of a test that claims too much says nothing.
    if any(map(too_often, shares.values())):
        supported = UNKNOWN
    return TestPower(
        name=name, after=after, power=share(p < LEVEL), supported=supported, false=shares
    )


def _estimate(name: str, sums: FloatArray, participants: int) -> EstimateQuality:
    """Return the quality of an estimate from its sums in each study, (studies, 5)."""
    count, error, squared, covered, width = sums.T
    to_make = float(1 if name == MEAN_GAIN else participants)
    return EstimateQuality(
        name=name,
        bias=ratio(error, count),
        rmse=root(ratio(squared, count)),
        coverage=ratio(covered, count),
        width=ratio(width, count),
        estimable=ratio(count, np.full(len(count), to_make)),
    )


def root(squares: Measured) -> Measured:
    value = float(np.sqrt(squares.value))
    # The delta method: the derivative of the root is one over twice the root.
    return Measured(value, squares.error / (2 * value) if value > 0 else 0.0)
