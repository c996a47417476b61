"""Sensitivity of each subject under the models M1, M2 and M3, with the limits of the data."""

from collections.abc import Sequence
from functools import partial

from analysis.estimates import Json, NotEstimable, plain
from analysis.report.blocks import Figure, Items, Section, Table, columns
from analysis.report.drawing import gains_figure
from analysis.report.figure_data import Gains, gains
from analysis.report.findings import Findings
from analysis.report.wording import interval, number, of_all
from analysis.sensitivity.linear_model import LinearSensitivity
from analysis.sensitivity.lines import Lines, SubjectLine
from analysis.sensitivity.ordinal_model import OrdinalSensitivity
from analysis.sensitivity.two_stage_model import TwoStageSensitivity
from analysis.trials.law_comparison import LawOrder, critical_correlation, critical_rank_correlation
from analysis.trials.trial_statistics import TrialStatistics

_CEILING = 0.05
"""Share of scores at the top of the scale above which the report warns."""


def section(found: Findings) -> Section:
    """Return bias and gain of each subject, and the detection of changes."""
    trials = found.trials
    return Section(
        name="sensitivity",
        title="Sensitivity",
        blocks=[
            Items(heading="Limitations of these data.", lines=_limits(found)),
            *(
                f"{model} could not be fitted: {fit.reason}."
                for model, fit in (("M1", trials.m1), ("M2", trials.m2))
                if isinstance(fit, NotEstimable)
            ),
            _gains_figure(trials),
            None if isinstance(trials.m3, NotEstimable) else _detection_table(trials.m3),
        ],
        data=_sensitivity_json(trials),
    )


def _limits(found: Findings) -> list[str]:
    """Return the limitations of the data, a sentence or two each."""
    limits, trials = [], found.trials
    if not trials.has_repeats:
        limits.append(
            "With one rating per subject and condition, differences between subjects in "
            "sensitivity cannot be established: a subject's gain is known only by pooling with the "
            "others, and the shrinkage factor shows how little of it comes from the subject's own "
            "trials. The intervals of M1 and M2 then depend largely on the priors."
        )
    if isinstance(trials.m1, LinearSensitivity):
        limits.append(
            "M1 assumes that conditions differ only in the predicted contrast. It treats all other "
            "differences between conditions as noise of single trials, so its intervals are too "
            "narrow, above all those of the group; M2 includes a discrepancy for each condition."
        )
    rated = [score.order.rated for score in trials.laws if isinstance(score.order, LawOrder)]
    if rated:
        limits.append(_too_few_means(rated[0]))
    scores = found.loaded.scored["score"].dropna()
    ceiling = (scores >= found.scale.highest).mean() if len(scores) else 0.0
    if ceiling > _CEILING:
        limits.append(
            f"{ceiling:.0%} of the scores are the highest possible. M1 ignores this ceiling and "
            "underestimates the gains; M2 accounts for it."
        )
    if isinstance(trials.m3, NotEstimable):
        why = trials.m3.reason
        limits.append(f"M3 (noticing a change, then rating it) could not be fitted: {why}.")
    return limits


def _too_few_means(count: int) -> str:
    """Return a sentence on the correlations that `count` condition means need for p < .05."""
    ranks, moments = critical_rank_correlation(count), critical_correlation(count)
    if isinstance(ranks, NotEstimable):
        reached = "cannot have p < .05, even for a perfect order"
    elif ranks >= 1:
        reached = "has p < .05 only if it is 1 or −1"
    else:
        reached = f"must reach {ranks:.3f} for p < .05"
    products = (
        ""
        if isinstance(moments, NotEstimable)
        else f" (Pearson's correlation of the contrasts and means must exceed {moments:.3f})"
    )
    return (
        f"With {count} condition means and no ties, Spearman's rank correlation (the one shown) "
        f"{reached}{products}. Most orders of the conditions are not evidence for or against a law."
    )


def _gains_figure(trials: TrialStatistics) -> Figure:
    data = gains(trials)
    if data is None:
        return Figure(name="sensitivity")
    return Figure(
        name="sensitivity",
        title="Sensitivity of each subject",
        caption="Sensitivity of each subject with its 95 % interval, by M1 (circles) and M2 "
        f"(squares); dashed lines show the group.{of_all(len(data.shown), data.of, 'subjects')}",
        draw=partial(gains_figure, data),
        table=_gains_table(data),
    )


def _gains_table(data: Gains) -> Table:
    """Return each subject's bias and gain under each model, with intervals and shrinkage."""
    models = data.models
    names = ["subject"]
    for model in models:
        names += [f"{model} bias", "95 %", f"{model} gain", "95 %", "shrinkage"]
    group = [cell for lines in models.values() for cell in (*_line_cells(lines), "")]
    rows = [["group", *group]]
    for place, line in enumerate(next(iter(models.values())).subjects):
        lines = [fit.subjects[place] for fit in models.values()]
        own = [cell for own in lines for cell in (*_line_cells(own), number(own.shrinkage, 2))]
        rows.append([line.subject, *own])
    return Table(
        name="gains",
        caption="Bias (rating at no contrast) and sensitivity (gain, rating points per unit of "
        "contrast) of each subject and of the group, with 95 % intervals. The shrinkage factor is "
        "the share of a gain that comes from the subject's own trials; the rest comes from the "
        "group.",
        columns=columns(*names),
        rows=rows,
    )


def _line_cells(line: SubjectLine | Lines) -> list[str]:
    return [
        number(line.bias, 2),
        interval(line.bias_interval),
        number(line.gain, 2),
        interval(line.gain_interval),
    ]


def _detection_table(fit: TwoStageSensitivity) -> Table:
    """Return each subject's d′ and criterion under M3."""
    return Table(
        name="detection",
        caption="Change detection and rating of the changes that were noticed (M3): d′ at a "
        f"contrast of {fit.reference_contrast:.3f}; the criterion for the expected change, in SDs "
        "of the noise; the false-alarm rate, the probability that a change in either direction is "
        "reported without one; gain in rating points; with 95 % intervals.",
        columns=columns(
            *("subject", "d′", "95 %", "criterion", "95 %"),
            *("false alarms", "95 %", "gain", "95 %"),
        ),
        rows=[
            [
                entry.subject,
                number(entry.d_prime, 2),
                interval(entry.d_prime_interval),
                number(entry.criterion, 2),
                interval(entry.criterion_interval),
                number(entry.false_alarm_rate, 2),
                interval(entry.false_alarm_rate_interval),
                number(line.gain, 2),
                interval(line.gain_interval),
            ]
            for entry, line in zip(fit.detection, fit.ratings.lines.subjects, strict=True)
        ],
    )


def _sensitivity_json(trials: TrialStatistics) -> Json:
    m1 = trials.m1
    subjects = m1.lines.subjects if isinstance(m1, LinearSensitivity) else ()
    return {
        "sensitivity": _subjects_json(subjects),
        "sensitivity_models": {
            "M1": _fit_json(m1),
            "M2": _fit_json(trials.m2),
            "M3": _fit_json(trials.m3),
        },
    }


def _fit_json(
    fit: LinearSensitivity | OrdinalSensitivity | TwoStageSensitivity | NotEstimable,
) -> Json:
    """Return the fit with the subjects' and the population's lines beside its other numbers."""
    found: Json = plain(fit)
    if isinstance(fit, TwoStageSensitivity):
        del found["ratings"]
        return {**_fit_json(fit.ratings), **found}
    if isinstance(fit, NotEstimable):
        return found
    del found["lines"]
    return {**_lines_json(fit.lines), **found}


def _lines_json(lines: Lines) -> Json:
    names = ("bias", "gain", "bias_sd", "gain_sd")
    return {
        "subjects": _subjects_json(lines.subjects),
        "population": {name: plain(getattr(lines, name)) for name in names}
        | {f"{name}_ci": plain(getattr(lines, f"{name}_interval")) for name in names},
    }


def _subjects_json(lines: Sequence[SubjectLine]) -> list[Json]:
    return [
        {name.replace("interval", "ci"): value for name, value in plain(line).items()}
        for line in lines
    ]
