"""Checks of sessions: order, carry-over, drift and catch trials."""

from functools import partial

from analysis.estimates import Json, NotEstimable, or_null, plain, why
from analysis.report.blocks import Figure, Items, Section, Table, columns
from analysis.report.drawing import course_figure
from analysis.report.figure_data import Course, course
from analysis.report.findings import Findings
from analysis.report.wording import interval, number, p_equals, share
from analysis.trials.order_as_run import OrderAsRun
from analysis.trials.trial_checks import Discrimination, Drift, FTest
from analysis.trials.trial_statistics import CatchAnswers


def section(found: Findings) -> Section:
    """Return the checks of whole sessions."""
    trials = found.trials
    return Section(
        name="checks",
        title="Order, carry-over, drift, catch trials",
        blocks=[
            Items(
                lines=[
                    _f_line("Place in the session", trials.order),
                    _f_line("Carry-over from the scored trial directly before", trials.carry_over),
                    *_order_lines(trials.as_run),
                    _drift_line(trials.drift),
                    _catch_line(trials.catch.overall),
                ]
            ),
            _follower_table(found),
            _course_figure(found),
            _catch_table(trials.catch) if trials.catch.subjects else None,
        ],
        data={
            "checks": {
                "order": plain(trials.order),
                "carry_over": plain(trials.carry_over),
                "as_run": _as_run_json(trials.as_run),
                "drift": plain(trials.drift),
                "catch_trials": {
                    "overall": _discrimination_json(trials.catch.overall),
                    "subjects": {
                        name: _discrimination_json(answers)
                        for name, answers in trials.catch.subjects.items()
                    },
                },
            }
        },
    )


def _f_line(name: str, test: FTest | NotEstimable) -> str:
    if isinstance(test, NotEstimable):
        return f"{name}: not estimable ({test.reason})."
    return f"{name}: F({test.df[0]}, {test.df[1]}) = {test.f:.3f}, {p_equals(test.p)}."


def _order_lines(order: OrderAsRun | NotEstimable) -> list[str]:
    if isinstance(order, NotEstimable):
        return [f"Order as run: not known ({order.reason})."]
    kept = "keeps every rule of the plan"
    if order.problems:
        kept = f"breaks rules of the plan ({'; '.join(order.problems)})"
    return [
        f"Attempts that were repeated because a touch was not as instructed: "
        f"{order.attempts_repeated}. The order in which the trials were answered {kept}."
    ]


def _follower_table(found: Findings) -> Table | None:
    """Return how often each condition was felt directly after each other one."""
    order, names = found.trials.as_run, found.study.conditions
    if isinstance(order, NotEstimable):
        return None
    counts = order.carry_over.counts
    return Table(
        name="followers",
        caption="How often each condition (column) was answered directly after another (row), "
        "within a block; catch trials between them are ignored here, while the test of carry-over "
        "leaves out trials that follow one.",
        columns=columns("after", *names),
        rows=[[name, *map(str, row)] for name, row in zip(names, counts, strict=True)],
    )


def _as_run_json(order: OrderAsRun | NotEstimable) -> Json:
    if isinstance(order, NotEstimable):
        return dict(plain(order))
    felt = order.carry_over
    return {
        "attempts_repeated": order.attempts_repeated,
        "problems": list(order.problems),
        "carry_over": {
            "counts": [list(row) for row in felt.counts],
            "across_blocks": [list(row) for row in felt.across_blocks],
            "balanced": felt.balanced,
            "imbalance": felt.imbalance,
        },
    }


def _drift_line(drift: Drift | NotEstimable) -> str:
    if isinstance(drift, NotEstimable):
        return f"Drift: not estimable ({drift.reason})."
    return (
        f"Drift, mean of the subjects' slopes: {number(drift.points_per_trial)} points per trial, "
        f"95 % interval {interval(drift.interval, 3)}, t({drift.df}), {p_equals(drift.p)}."
    )


def _catch_line(answers: Discrimination | NotEstimable) -> str:
    if isinstance(answers, NotEstimable):
        return f"Catch trials: not estimable ({answers.reason})."
    unknown = answers.hits.interval
    pooled = f" (no intervals: {unknown.reason})" if isinstance(unknown, NotEstimable) else ""
    return (
        f"Catch trials (0 V): a change in either direction was reported on "
        f"{share(answers.false_alarms)} of the catch trials and {share(answers.hits)} of the "
        f"scored trials; d′ = {number(answers.d_prime, 2)}, criterion "
        f"{number(answers.criterion, 2)}{pooled}."
    )


def _course_figure(found: Findings) -> Figure:
    data = course(found)
    if data is None:
        return Figure(name="course")
    return Figure(
        name="course",
        title="Scores over the session",
        caption="Mean score with standard error, by the trial's place in the session.",
        draw=partial(course_figure, data),
        table=_course_table(data),
    )


def _course_table(data: Course) -> Table:
    """Return the mean score by place in the session."""
    return Table(
        name="course",
        caption="Numbers shown in the figure: mean score by place in the session.",
        columns=columns("place", "mean score", "standard error", "scores"),
        rows=[
            [str(place), number(mean, 2), number(error, 2), str(count)]
            for place, mean, error, count in zip(
                data.places, data.means, data.errors, data.counts, strict=True
            )
        ],
    )


def _catch_table(catch: CatchAnswers) -> Table:
    """Return hits and false alarms by subject."""
    return Table(
        name="catch",
        caption="Trials on which a change in either direction was reported: scored trials (hits) "
        "and catch trials at 0 V (false alarms), with exact 95 % intervals; d′ and criterion are "
        "computed from the counts alone, so that few trials limit d′; those of M3 are at a "
        "contrast.",
        columns=columns("subject", "hits", "false alarms", "d′", "criterion"),
        rows=[[name, *_catch_cells(answers)] for name, answers in catch.subjects.items()],
    )


def _catch_cells(answers: Discrimination | NotEstimable) -> list[str]:
    if isinstance(answers, NotEstimable):
        return [f"not estimable: {answers.reason}", *[number(None)] * 3]
    rates = [share(answers.hits), share(answers.false_alarms)]
    return [*rates, number(answers.d_prime, 2), number(answers.criterion, 2)]


def _discrimination_json(answers: Discrimination | NotEstimable) -> Json:
    found: Json = plain(answers)
    if isinstance(answers, Discrimination):
        for name, rate in (("hits", answers.hits), ("false_alarms", answers.false_alarms)):
            found[name] |= {"interval": or_null(rate.interval), **why("interval", rate.interval)}
    return found
