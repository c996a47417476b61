"""Proves the plans of a whole cohort: each by itself, and carry-over where it is promised."""

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

from protocol.plan_check import plan_problems
from protocol.problem import Problem
from protocol.study import Study
from protocol.trial import Plan


def cohort_problems(study: Study, plans: Sequence[Plan]) -> list[Problem]:
    """Return every promise that the plans of slots 0, 1, 2 and so on break."""
    if not plans:
        return [_problem("there must be at least one plan", "none")]
    found = [problem for plan in plans for problem in plan_problems(study, plan)]
    if [plan.slot for plan in plans] != list(range(len(plans))):
        found.append(_problem("slots must be numbered from 0", [plan.slot for plan in plans]))
    if _promised(study, len(plans)):
        pairs = _pairs(plans)
        names = study.conditions
        counts = {(a, b): pairs[a, b] for a in names for b in names if a != b}
        if len(set(counts.values())) > 1:
            found.append(_problem("every condition must follow every other equally often", counts))
    return found


def _problem(rule: str, value: object) -> Problem:
    return Problem(where="cohort", rule=rule, value=str(value))


def _promised(study: Study, size: int) -> bool:
    number, design = len(study.condition), study.design
    whole = number if number % 2 == 0 else 2 * number
    free = design.group_by_beam == "no" and design.max_beam_swaps is None
    return design.order == "williams" and free and number > 1 and size % whole == 0


def _pairs(plans: Sequence[Plan]) -> Counter[tuple[str | None, str | None]]:
    pairs: Counter[tuple[str | None, str | None]] = Counter()
    for plan in plans:
        main = [trial for trial in plan.trials if trial.kind == "trial"]
        pairs.update((a.condition, b.condition) for a, b in pairwise(main) if a.block == b.block)
    return pairs
