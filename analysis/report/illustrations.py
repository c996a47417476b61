"""The report's figures with their words and the table of numbers beside each."""

from dataclasses import dataclass

from analysis.loading.study_data import Loaded
from analysis.report.drawing import (
    Drawing,
    Words,
    course_figure,
    gains_figure,
    raincloud_figure,
    scatter_figure,
)
from analysis.report.figure_data import course, gains, raincloud, scatter
from analysis.report.tables import (
    PageTable,
    course_table,
    gains_table,
    prediction_table,
    quartile_table,
)
from analysis.statistics.summary import TableStatistics
from analysis.trials.trial_statistics import TrialStatistics

FIGURES = ("scores", "model", "sensitivity", "course")


@dataclass(frozen=True, kw_only=True)
class Illustration:
    """A figure, what it shows, and its numbers."""

    drawing: Drawing
    caption: str
    table: PageTable


def illustrations(
    loaded: Loaded, table: TableStatistics, trials: TrialStatistics
) -> dict[str, Illustration]:
    """Return the figures by name; one that would show nothing is left out."""
    found = [
        _scores(loaded, table),
        _scatter(loaded, trials),
        _gains(trials),
        _course(trials),
    ]
    return {shown.drawing.name: shown for shown in found if shown is not None}


def _scores(loaded: Loaded, table: TableStatistics) -> Illustration:
    data = raincloud(loaded.table, table.main.table4.column_means)
    caption = (
        "Scores by condition: a line with circles per subject, clouds with the density of the "
        "scores, bars from the lower to the upper quartile with the median, and means as diamonds."
        + _of(len(data.lines), len(loaded.table.subjects), "subjects' lines")
    )
    words = Words(name="scores", title="Scores by condition", description=caption)
    return Illustration(
        drawing=raincloud_figure(data, words), caption=caption, table=quartile_table(loaded.table)
    )


def _scatter(loaded: Loaded, trials: TrialStatistics) -> Illustration | None:
    data = scatter(trials)
    if data is None:
        return None
    caption = (
        "Ratings against the contrast that the friction model predicts for the trial, a shape and "
        "colour per condition; equal ratings are shifted a little. The line is the group's, by M1."
        + _of(len(data.ratings.rating), data.of, "ratings")
    )
    words = Words(name="model", title="Ratings against the model", description=caption)
    beside = prediction_table(loaded.table, trials.laws)
    return Illustration(drawing=scatter_figure(data, words), caption=caption, table=beside)


def _gains(trials: TrialStatistics) -> Illustration | None:
    data = gains(trials)
    if data is None:
        return None
    caption = (
        "Sensitivity of each subject with its 95 % interval, by M1 (circles) and M2 (squares); "
        "dashed lines are the group's." + _of(len(data.shown), data.of, "subjects")
    )
    words = Words(name="sensitivity", title="Sensitivity of each subject", description=caption)
    return Illustration(drawing=gains_figure(data, words), caption=caption, table=gains_table(data))


def _course(trials: TrialStatistics) -> Illustration | None:
    data = course(trials)
    if data is None:
        return None
    caption = "Mean score, with its standard error, by the trial's place in the session."
    words = Words(name="course", title="Scores over the session", description=caption)
    return Illustration(
        drawing=course_figure(data, words), caption=caption, table=course_table(data)
    )


def _of(shown: int, of: int, what: str) -> str:
    """Say how much of it is drawn, where it is not all."""
    return f" {shown} of {of} {what} are drawn, evenly spaced." if shown < of else ""
