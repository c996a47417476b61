"""Figures of the models: ratings against contrasts, sensitivities, and predictive checks."""

from collections.abc import Sequence

import numpy as np

from analysis.report.drawing import (
    COLOURS,
    GREY,
    HEIGHT_IN,
    LEGEND_ROW_IN,
    Axes,
    Drawing,
    Words,
    drawing,
    intervals,
    jitter,
    labels_of,
    limits,
    marked,
    name_places,
)
from analysis.report.figure_data import HEADLINE, Gains, Scatter
from analysis.sensitivity.lines import Lines
from analysis.sensitivity.predictive_checks import PredictiveStatistic


def scatter_figure(data: Scatter, words: Words) -> Drawing:
    """Return ratings against predicted contrasts, with a marker and colour per condition."""

    def draw(axes: Axes) -> None:
        ratings = data.ratings
        labels = labels_of(ratings.conditions, "condition")
        for place in np.unique(ratings.condition):
            own = ratings.condition == place
            axes.plot(
                ratings.contrast[own],
                ratings.rating[own] + jitter(int(own.sum()), data.scale),
                linestyle="none",
                **marked(int(place)),
                alpha=0.7,
                label=labels[place],
            )
        for model, curve in data.curves.items():
            dashes = "-" if model == HEADLINE else "--"
            axes.plot(data.at, curve, color="black", linestyle=dashes, label=f"group, {model}")
        axes.set(ylim=limits(data.scale), ylabel=f"rating, {data.scale}")
        axes.set_xlabel("predicted contrast, change of log friction")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncol=2, frameon=False)

    shown = len(np.unique(data.ratings.condition))
    return drawing(words, draw, HEIGHT_IN + LEGEND_ROW_IN * (shown + 2) / 2)


def gains_figure(data: Gains, words: Words) -> Drawing:
    """Return each subject's gain with its 95% interval, with the models side by side."""

    def draw(axes: Axes) -> None:
        for number, (model, lines) in enumerate(data.models.items()):
            subjects = [lines.subjects[place] for place in data.shown]
            offset = 0.25 * (number - (len(data.models) - 1) / 2)
            intervals(
                axes,
                np.arange(len(data.shown), dtype=np.float64) + offset,
                np.array([line.gain for line in subjects]),
                np.array([line.gain_interval for line in subjects]),
                number,
                f"{model}, 95% interval",
            )
            if lines.group_known:
                axes.axhline(lines.gain, color=COLOURS[number], linewidth=0.8, linestyle="--")
        _name_subjects(axes, data, next(iter(data.models.values())))
        axes.set_ylabel("gain, points per unit of contrast")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=2, frameon=False)

    return drawing(words, draw)


def relative_gains_figure(data: Gains, words: Words) -> Drawing:
    """Return each subject's gain less the mean gain, with its 95% interval, by the first model."""

    def draw(axes: Axes) -> None:
        lines = next(iter(data.models.values()))
        subjects = [lines.subjects[place] for place in data.shown]
        intervals(
            axes,
            np.arange(len(subjects)),
            np.array([line.relative_gain for line in subjects]),
            np.array([line.relative_gain_interval for line in subjects]),
        )
        axes.axhline(0.0, color=GREY, linewidth=0.8, linestyle="--")
        _name_subjects(axes, data, lines)
        axes.set_ylabel("relative gain, points per unit")

    return drawing(words, draw)


def _name_subjects(axes: Axes, data: Gains, lines: Lines) -> None:
    names = tuple(lines.subjects[place].subject for place in data.shown)
    name_places(axes, labels_of(names, "subject"))
    axes.set_xlabel("subject")


def predictive_figure(data: Sequence[PredictiveStatistic], words: Words) -> Drawing:
    """Return each statistic of the study beside the 95% interval of simulated studies.

    Each is relative to the median of the simulated ones, so that they share an axis.
    """
    unit = np.array([each.predicted or 1.0 for each in data])
    study = np.array([each.observed for each in data]) / unit
    simulated = np.array([each.predicted for each in data]) / unit
    ends = np.array([each.predicted_interval for each in data]) / unit[:, None]

    def draw(axes: Axes) -> None:
        places = np.arange(len(data))
        intervals(axes, places, simulated, ends, 0, "simulated studies, 95%")
        axes.plot(places, study, "D", color=COLOURS[1], label="this study")
        name_places(axes, [each.name.replace(" ", "\n") for each in data])
        axes.set_ylim(bottom=0)
        axes.set_ylabel("distance from the model, relative")
        axes.legend(frameon=False)

    return drawing(words, draw)
