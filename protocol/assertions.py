"""Assertions about plans for a study's own tests; each failure names participant and value."""

from collections import Counter
from collections.abc import Sequence

from protocol.plan.trials import Plan, plan_swaps, session_s
from protocol.proof.trial_checks import by_group, carry_over, cohort_problems
from protocol.study.study import Study


def assert_proved(study: Study, cohort: Sequence[Plan]) -> None:
    """Assert that every plan meets every requirement of the study file, by an independent check."""
    # The proof and not the planner is asked: it shares no code with what drew the plans.
    if problems := cohort_problems(study, cohort):
        raise AssertionError("\n".join(map(str, problems)))


def assert_never_above(cohort: Sequence[Plan], voltage_v: float) -> None:
    """Assert that no touch has an amplitude (peak) above `voltage_v`."""
    for plan in cohort:
        for trial in plan.trials:
            for touch in trial.touches:
                if touch.peak_voltage_v > voltage_v:
                    raise AssertionError(
                        f"every amplitude must be at most {voltage_v:.12g} V, "
                        f"got {touch.peak_voltage_v:.12g} V in trial {trial.index} "
                        f"({trial.condition or trial.kind}) of {_who(plan)}"
                    )


def assert_each_condition(study: Study, cohort: Sequence[Plan], times: int) -> None:
    """Assert that every participant has `times` trials of each condition, catch trials aside."""
    for plan in cohort:
        # Practice and catch trials have a condition, too, and are no repeats of it.
        felt = Counter(trial.condition for trial in plan.trials if trial.kind == "trial")
        for name in study.conditions:
            if felt[name] != times:
                raise AssertionError(
                    f"every participant must have {times} trials of {name}, got {felt[name]} for "
                    f"{_who(plan)}"
                )


def assert_shorter_than(study: Study, cohort: Sequence[Plan], minutes: float) -> None:
    """Assert that every session is expected to take less than `minutes`."""
    for plan in cohort:
        expected = session_s(study, plan) / 60
        if expected >= minutes:
            raise AssertionError(
                f"a session must take less than {minutes:g} min, got {expected:.1f} min for "
                f"{_who(plan)}"
            )


def assert_beam_swaps(study: Study, cohort: Sequence[Plan], at_most: int) -> None:
    """Assert that the operator swaps beams at most `at_most` times per session."""
    for plan in cohort:
        swaps = plan_swaps(study, plan)
        if swaps > at_most:
            raise AssertionError(
                f"a session must have at most {at_most} beam swaps, got {swaps} for {_who(plan)}"
            )


def assert_balanced(study: Study, cohort: Sequence[Plan]) -> None:
    """Assert that every condition follows every other one equally often, in each group."""
    for group, own in (by_group(cohort) or {None: []}).items():
        report, who = carry_over(study, own), "participants" + (f" of {group}" if group else "")
        if not report.balanced:
            raise AssertionError(
                f"carry-over must be balanced over {len(own)} {who}, got counts that differ "
                f"by {report.imbalance}: {dict(zip(study.conditions, report.counts, strict=True))}"
            )


def _who(plan: Plan) -> str:
    group = f" of {plan.group}" if plan.group else ""
    return f"participant {plan.slot + 1}{group}, session {plan.session}"
