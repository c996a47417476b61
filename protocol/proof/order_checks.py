"""Checks of the order in which trials were run, where some came again: the plan's rules anew."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from protocol.errors import Problem
from protocol.plan.trials import Plan, plan_swaps
from protocol.proof.trial_checks import order_violations
from protocol.study.study import Study


def order_problems(study: Study, plan: Plan, order: Sequence[int]) -> list[Problem]:
    """Return every rule that the trials break in the order in which they were answered.

    Args:
        study: the study.
        plan: of the session.
        order: the numbers of the trials, as far as the session came.
    """
    by_index = {trial.index: trial for trial in plan.trials}
    found: list[tuple[str, str]] = []
    if twice := [index for index, times in Counter(order).items() if times > 1]:
        found.append(("every trial must be answered once", f"twice: {twice}"))
    if unknown := [index for index in order if index not in by_index]:
        found.append(("every trial must be planned", f"not planned: {unknown}"))
    run = [by_index[index] for index in order if index in by_index]
    blocks = [trial.block for trial in run]
    if blocks != sorted(blocks):
        found.append(("blocks must follow one another", str(blocks)))
    first = [trial.index for trial in run if trial.block == 0]
    if first != sorted(first):
        found.append(("opening and practice must come as planned", str(first)))
    as_run = replace(plan, trials=tuple(run))
    if len(run) == len(plan.trials) and plan_swaps(study, as_run) > plan_swaps(study, plan):
        rule = f"there must be at most {plan_swaps(study, plan)} beam swaps"
        found.append((rule, str(plan_swaps(study, as_run))))
    found += order_violations(study, run)
    return [Problem(where=f"order of slot {plan.slot}", rule=r, value=v) for r, v in found]
