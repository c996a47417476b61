"""Claims about people that each analysis of a table of scores can judge."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.estimates import FloatArray, Interval, NotEstimable
from analysis.multiverse.universes import Universe
from analysis.statistics.intervals import mean_interval
from analysis.statistics.omnibus import Friedman
from analysis.statistics.signed_rank import LEVEL
from analysis.statistics.summary import Reading
from analysis.trials.law_order import law_order
from device.friction.changes import CONDITIONS

LEADING, LAST = ("voltage", "structure"), "pressure"
"""What the paper found to be felt most and least (Section 5.2, abstract)."""


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What one analysis says of a claim; the effect is positive where it is the claimed one."""

    effect: float
    p: float
    interval: Interval | None = None

    @property
    def significant(self) -> bool:
        """Whether the effect is the claimed one, p < .05."""
        return self.effect > 0 and self.p < LEVEL


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A claim about people.

    Attributes:
        id: short name.
        words: the statement.
        effect: what `judge` measures, with its unit.
        judge: judges it in one analysis.
        of_model: whether it compares ratings with contrasts.
        signed: whether the effect has a sign, so that an analysis can contradict the claim; one
            without a sign supports it where p < .05.
    """

    id: str
    words: str
    effect: str
    judge: Callable[[Universe], Judged | NotEstimable]
    of_model: bool = False
    signed: bool = True

    def supported(self, found: Judged) -> bool:
        """Return whether an analysis supports the claim."""
        return found.effect > 0 if self.signed else found.significant


CONDITIONS_DIFFER, FOLLOWS_MODEL = "conditions-differ", "order-follows-model"
NAMES = (
    *(CONDITIONS_DIFFER, "voltage-best", "pressure-weakest", "structure-and-voltage-lead"),
    FOLLOWS_MODEL,
)
"""Short names of the claims that are judged in each study that has their conditions."""


def named_claims(conditions: Sequence[str]) -> list[Claim]:
    """Return those of the paper's claims that a table with these conditions can judge."""
    known = [name for name in conditions if name in CONDITIONS]
    first, second = LEADING
    others = [name for name in known if name not in LEADING]
    found = [
        Claim(
            id=CONDITIONS_DIFFER,
            words="The conditions differ",
            effect="agreement of subjects (Kendall's W)",
            judge=_differ,
            signed=False,
        )
    ]
    if first in known and len(known) > 1:
        every = [(first, name) for name in known if name != first]
        found.append(above("voltage-best", "Voltage is rated above every other condition", every))
    if LAST in known and len(known) > 1:
        every = [(name, LAST) for name in known if name != LAST]
        found.append(
            above("pressure-weakest", "Pressure is rated below every other condition", every)
        )
    if set(LEADING) <= set(known) and others:
        every = [(leading, name) for leading in (first, second) for name in others]
        words = "Voltage and structure are rated above all other conditions"
        found.append(above("structure-and-voltage-lead", words, every))
    found.append(
        Claim(
            id=FOLLOWS_MODEL,
            words="Mean ratings follow the order that the model predicts",
            effect="Spearman's ρ over conditions",
            judge=_follows,
            of_model=True,
        )
    )
    return found


def above(name: str, words: str, pairs: Iterable[tuple[str, str]]) -> Claim:
    """Return the claim that the first condition of each pair is rated above the second.

    Its effect is the least mean difference; p is the largest of the signed rank tests after Holm's
    correction over all pairs of conditions, as all of them must hold.
    """
    return Claim(
        id=name,
        words=words,
        effect="least mean difference, points",
        judge=partial(_above, tuple(pairs)),
    )


def _differ(universe: Universe) -> Judged | NotEstimable:
    """Judge whether conditions differ, by Friedman's test or that of Skillings and Mack.

    W is the statistic over Σ(kᵢ - 1), which it cannot exceed, where subject i gave kᵢ scores; with
    no score missing it is Kendall's.
    """
    tested = universe.reading
    test = tested.friedman if tested.skillings_mack is None else tested.skillings_mack
    if isinstance(test, NotEstimable):
        return test
    if isinstance(test, Friedman):
        ends = test.kendall_w_interval
        known = None if isinstance(ends, NotEstimable) else ends
        return Judged(effect=test.kendall_w, p=test.best_p, interval=known)
    counts = tested.table4.table.given.sum(axis=1)
    most = float(np.maximum(counts - 1, 0).sum())
    return Judged(effect=test.statistic / most, p=test.monte_carlo.p)


def _above(pairs: tuple[tuple[str, str], ...], universe: Universe) -> Judged | NotEstimable:
    found = []
    for higher, lower in pairs:
        differences = pair_differences(universe.reading, higher, lower)
        if not differences.size:
            return NotEstimable(f"nobody scored both {higher} and {lower}")
        ends = mean_interval(differences)
        found.append((float(differences.mean()), None if isinstance(ends, NotEstimable) else ends))
    effect, interval = min(found, key=lambda each: each[0])
    return Judged(
        effect=effect,
        p=max(pair_p(universe.reading, higher, lower) for higher, lower in pairs),
        interval=interval,
    )


def pair_differences(reading: Reading, one: str, other: str) -> FloatArray:
    """Return the differences of two conditions' scores, of the subjects who have both."""
    table = reading.table4.table
    first, second = (table.scores[:, table.conditions.index(name)] for name in (one, other))
    both = ~np.isnan(first - second)
    return np.asarray((first - second)[both])


def pair_p(reading: Reading, one: str, other: str) -> float:
    """Return p of a pair of conditions after Holm's correction; 1 without any difference."""
    test = next(pair for pair in reading.pairwise if {pair.a, pair.b} == {one, other})
    return 1.0 if isinstance(test.p_holm, NotEstimable) else test.p_holm


def _follows(universe: Universe) -> Judged | NotEstimable:
    means = universe.reading.table4
    rated = dict(zip(means.table.conditions, means.column_means.tolist(), strict=True))
    names = tuple(universe.contrasts)
    predicted = np.array([universe.contrasts[name] for name in names])
    found = law_order(names, predicted, np.array([rated[name] for name in names]))
    if isinstance(found, NotEstimable):
        return found
    if isinstance(found.spearman, NotEstimable) or isinstance(found.p, NotEstimable):
        return NotEstimable("all contrasts, or all mean ratings, are equal")
    return Judged(effect=found.spearman, p=found.p)
