"""Checks of a cohort: each plan by itself, and the carry-over compared with the design."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from protocol.errors import Problem
from protocol.plan.trials import Plan
from protocol.proof.trial_checks import plan_problems
from protocol.study.study import Study


def cohort_problems(study: Study, plans: Sequence[Plan], first: int = 0) -> list[Problem]:
    """Return every requirement that the plans of slots 0, 1, 2 and so on violate.

    The slot that they begin with may also be the `first` of another `cycle`.
    """
    if not plans:
        return [_problem("there must be at least one plan", "none")]
    found = [problem for plan in plans for problem in plan_problems(study, plan)]
    slots = [plan.slot for plan in plans]
    if slots != list(range(first, first + len(plans))):
        found.append(_problem(f"slots must be numbered from {first}", slots))
    if balance_guaranteed(study, len(plans)):
        pairs, names = _pairs(plans, within_blocks=True), study.conditions
        counts = {(a, b): pairs[a, b] for a in names for b in names if a != b}
        if len(set(counts.values())) > 1:
            found.append(_problem("every condition must follow every other equally often", counts))
    return found


def _problem(rule: str, value: object) -> Problem:
    return Problem(where="cohort", rule=rule, value=str(value))


Pairs = Counter[tuple[str | None, str | None]]


def _pairs(plans: Iterable[Plan], *, within_blocks: bool) -> Pairs:
    """Count how often one condition directly follows another, within or across blocks."""
    pairs: Pairs = Counter()
    for plan in plans:
        main = [trial for trial in plan.trials if trial.kind == "trial"]
        pairs.update(
            (before.condition, after.condition)
            for before, after in pairwise(main)
            if (before.block == after.block) == within_blocks
        )
    return pairs


Counts = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, kw_only=True)
class CarryOver:
    """First-order carry-over: `counts[a][b]` is how often condition b directly follows a.

    Scored trials of the same block are counted; catch trials between them are ignored.
    `across_blocks` counts the pairs on both sides of a block's end, which no design balances.
    `guaranteed` says whether the design balances every cohort of this size.
    """

    counts: Counts
    across_blocks: Counts
    guaranteed: bool

    @property
    def balanced(self) -> bool:
        """Whether every condition follows every other one, and equally often."""
        return self.imbalance == 0 and 0 not in self._pairs

    @property
    def imbalance(self) -> int:
        """Largest difference between the counts of two pairs of different conditions."""
        return max(self._pairs, default=0) - min(self._pairs, default=0)

    @property
    def _pairs(self) -> list[int]:
        size = range(len(self.counts))
        return [self.counts[a][b] for a in size for b in size if a != b]


def carry_over(study: Study, plans: Sequence[Plan]) -> CarryOver:
    """Return the carry-over of `plans`, conditions in the order of the file."""
    return CarryOver(
        counts=_counts(study.conditions, _pairs(plans, within_blocks=True)),
        across_blocks=_counts(study.conditions, _pairs(plans, within_blocks=False)),
        guaranteed=balance_guaranteed(study, len(plans)),
    )


def _counts(names: Sequence[str], pairs: Pairs) -> Counts:
    return tuple(tuple(pairs[before, after] for after in names) for before in names)


def balance_guaranteed(study: Study, participants: int) -> bool:
    """Return whether the design balances carry-over exactly for a cohort of this size.

    It does in Williams order, without grouping and without a limit on beam swaps, if the cohort is
    a multiple of n (n conditions, n even) or 2n (n odd).
    """
    design = study.design
    free = design.group_by_beam == "no" and design.max_beam_swaps is None
    return design.order == "williams" and free and participants % sequences(study) == 0


def cycle(study: Study, slot: int) -> range:
    """Return the slots over which the design balances carry-over together with `slot`.

    That is `slot` alone where it balances nothing.
    """
    size = sequences(study)
    first = slot // size * size
    return range(first, first + size) if balance_guaranteed(study, size) else range(slot, slot + 1)


def sequences(study: Study) -> int:
    """Return how many sequences a Williams design of the study's conditions has."""
    conditions = len(study.condition)
    return conditions if conditions % 2 == 0 or conditions == 1 else 2 * conditions
