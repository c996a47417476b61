"""The order in which trials were answered: carry-over as it was felt, and the plan's rules anew."""

from dataclasses import dataclass, replace

from analysis.estimates import NotEstimable
from analysis.loading.study_data import SessionOrder, StudyData
from protocol.plan.plan import plan
from protocol.plan.trials import Plan
from protocol.proof.trial_checks import CarryOver, carry_over, order_problems
from protocol.registration.registration import locked
from protocol.study.study import Study


@dataclass(frozen=True, kw_only=True)
class OrderAsRun:
    """The trials of all sessions in the order of their answers.

    `attempts_repeated` counts the attempts that ended because a touch was not as instructed.
    `problems` lists the rules of the plan that the order breaks.
    """

    attempts_repeated: int
    carry_over: CarryOver
    problems: tuple[str, ...]


def order_as_run(data: StudyData, study: Study) -> OrderAsRun | NotEstimable:
    """Return the order in which the trials of all sessions were answered."""
    if not data.orders:
        return NotEstimable("the order of published scores is not known")
    if data.lock is not None:
        # A registration's digest seeds the plan, which is drawn again here.
        study = locked(study, data.lock.registration.digest)
    planned = [plan(study.of_group(it.group), it.slot, it.session) for it in data.orders]
    # Rules of the present file say nothing about a plan that another one made.
    if not all(map(_is_planned, data.orders, planned)):
        return NotEstimable("some sessions ran under another version of the study file")
    as_run = [
        replace(planned, trials=tuple(planned.trials[index] for index in order.trials))
        for order, planned in zip(data.orders, planned, strict=True)
    ]
    problems = [
        problem
        for order, own in zip(data.orders, planned, strict=True)
        for problem in order_problems(study, own, order.trials)
    ]
    return OrderAsRun(
        attempts_repeated=sum(it.what == "trial repeated" for it in data.incidents),
        carry_over=carry_over(study, as_run),
        problems=tuple(map(str, problems)),
    )


def _is_planned(order: SessionOrder, planned: Plan) -> bool:
    conditions = [trial.condition for trial in planned.trials]
    return all(
        index < len(conditions) and conditions[index] == condition
        for index, condition in zip(order.trials, order.conditions, strict=True)
    )
