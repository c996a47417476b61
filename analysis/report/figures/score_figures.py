"""Figures of scores: by condition, over the session, by level, and by participant."""

from collections.abc import Sequence

import numpy as np

from analysis.estimates import FloatArray
from analysis.report.drawing import (
    COLOURS,
    GREY,
    MARKERS,
    Axes,
    Drawing,
    Words,
    drawing,
    grid_drawing,
    jitter,
    labels_of,
    limits,
    marker,
    name_places,
)
from analysis.report.figure_data import Course, Levels, People, Raincloud
from analysis.report.findings import Scale

FEWEST_FOR_A_CLOUD = 8
"""Fewer scores have no density that a cloud could show."""
FEW_NAMES, NAMES_IN_A_ROW = 6, 45
"""How many names of conditions have room upright in a sixth of a figure, and small in all of it."""
_CLOUD_SD = 0.04
"""Standard deviation of the clouds' density kernel, as a share of the scale."""


def raincloud_figure(data: Raincloud, words: Words) -> Drawing:
    """Return score densities by condition, with a line per subject and means as diamonds."""

    def draw(axes: Axes) -> None:
        places = np.arange(len(data.table.conditions))
        for place, column in zip(places, data.table.scores.T, strict=True):
            _cloud(axes, float(place), column[~np.isnan(column)], data.scale)
        axes.plot(
            places,
            data.lines.T + jitter(len(data.lines), data.scale),
            color=GREY,
            marker="o",
            markersize=marker(0.6),
            linewidth=0.6,
            alpha=0.6,
        )
        axes.plot(
            places,
            data.means,
            "D",
            color=COLOURS[1],
            markersize=marker(1.7),
            markerfacecolor="none",  # hides no score
            markeredgewidth=1.5,
            label="mean",
        )
        name_places(axes, labels_of(data.table.conditions, "condition"))
        axes.set(ylim=limits(data.scale), ylabel=f"score, {data.scale}", xlabel="condition")
        axes.legend(loc="lower left", frameon=False)

    return drawing(words, draw)


def _cloud(axes: Axes, place: float, scores: FloatArray, scale: Scale) -> None:
    """Draw half a violin (normal kernel) right of `place`, and median and quartiles left of it."""
    if scores.size < FEWEST_FOR_A_CLOUD:
        return
    values, counts = np.unique(scores, return_counts=True)
    grid = np.linspace(scale.lowest, scale.highest, 201)
    density = np.exp(-(((grid[:, None] - values) / (_CLOUD_SD * scale.span)) ** 2) / 2) @ counts
    width = 0.38 * density / density.max()
    axes.fill_betweenx(
        grid, place + 0.06, place + 0.06 + width, color=COLOURS[5], alpha=0.5, linewidth=0
    )
    low, middle, high = np.quantile(scores, [0.25, 0.5, 0.75])
    axes.plot([place - 0.06] * 2, [low, high], color=COLOURS[0], linewidth=marker(0.8), alpha=0.8)
    axes.plot([place - 0.06], [middle], "_", color="black", markersize=marker(1.8))


def course_figure(data: Course, words: Words) -> Drawing:
    """Return mean scores by place in the session, with their standard errors."""

    def draw(axes: Axes) -> None:
        errors = np.nan_to_num(data.errors)  # a single score has no bar
        axes.errorbar(data.places, data.means, yerr=errors, fmt="o-", color=COLOURS[0])
        axes.set_ylabel(f"mean score ± standard error, {data.scale}")
        axes.locator_params(axis="x", integer=True)
        axes.set_xlabel("place among the session's scored trials")

    return drawing(words, draw)


def levels_figure(data: Levels, words: Words) -> Drawing:
    """Return scores against the level of each condition: all of them, means, and M2's curve."""

    def draw(grid: Sequence[Axes]) -> None:
        for axes, own in zip(grid, data.conditions, strict=False):
            axes.plot(
                own.level,
                own.score + jitter(len(own.score), data.scale),
                ".",
                color=GREY,
                alpha=0.5,
            )
            # A level with a single score has no bar.
            axes.errorbar(
                own.at, own.mean, yerr=np.nan_to_num(own.error), fmt="o", color=COLOURS[0]
            )
            if own.expected is not None:
                axes.plot(own.at, own.expected, color="black", label="M2")
            axes.set_title(own.condition, fontsize="medium")
            axes.set_ylim(limits(data.scale))
        grid[0].set_ylabel(f"score, {data.scale}")
        for axes in grid:
            axes.set_xlabel("level")

    count = len(data.conditions)
    columns = min(count, 3)
    rows = -(-count // columns)
    return grid_drawing(words, draw, rows, columns, 1.0 + 2.4 * rows)


def people_figure(data: People, words: Words) -> Drawing:
    """Return a small panel for each participant: scores by condition, and the group's means."""

    def draw(grid: Sequence[Axes]) -> None:
        places = np.arange(len(data.conditions))
        for axes, (subject, scores) in zip(grid, data.scores.items(), strict=False):
            axes.plot(places, data.means, color=GREY, linewidth=0.8)
            for place, own in enumerate(scores):
                axes.plot(np.full(len(own), place), own, MARKERS[0], color=COLOURS[0], alpha=0.6)
            axes.set_title(labels_of((subject,), "subject")[0], fontsize="small", pad=2)
            axes.set_ylim(limits(data.scale))
        for axes in grid[len(data.scores) :]:
            axes.set_axis_off()
        size = "medium" if count <= FEW_NAMES else "x-small"
        for axes in grid:
            axes.set_xticks(places, names, rotation=90, fontsize=size)

    count, names = len(data.conditions), labels_of(data.conditions, "condition")
    columns = min(len(data.scores), 6, max(1, NAMES_IN_A_ROW // count))
    rows = -(-len(data.scores) // columns)
    return grid_drawing(words, draw, rows, columns, 1.0 + 1.1 * rows)
