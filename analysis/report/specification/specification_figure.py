"""Specification curve: the effects of all analyses in order, and the choices of each below."""

from collections.abc import Sequence
from textwrap import fill

import numpy as np

from analysis.multiverse.curve import Curve
from analysis.report.drawing import (
    COLOURS,
    GREY,
    Axes,
    Drawing,
    Words,
    grid_drawing,
    marker,
)

_ROW_IN = 0.19
_ABOVE_IN = 2.4
_MOST_INTERVALS = 100
"""Error bars of more analyses than these would cover each other."""


def specification_figure(data: Curve, words: Words) -> Drawing:
    """Return the effects of a claim's analyses above, and a matrix of their choices below."""
    rows = [line for choice, options in data.options.items() for line in (choice, *options)]
    below_in = _ROW_IN * (len(rows) + 1)

    def draw(grid: Sequence[Axes]) -> None:
        _effects(grid[0], data)
        _choices(grid[1], data)
        if data.own is not None:
            for axes in grid:
                axes.axvline(data.own + 1, color=GREY, linestyle=":", zorder=0)

    return grid_drawing(words, draw, 2, 1, _ABOVE_IN + below_in, (_ABOVE_IN, below_in))


def _effects(axes: Axes, data: Curve) -> None:
    places = np.arange(1, len(data.judged) + 1)
    effects = np.array([it.effect for it in data.judged])
    significant = np.array([it.significant for it in data.judged])
    supported = np.array([data.claim.supported(it) for it in data.judged])
    ends = np.array([it.interval or (np.nan, np.nan) for it in data.judged])
    if len(places) <= _MOST_INTERVALS:
        errors = np.abs(ends.T - effects)
        axes.errorbar(places, effects, yerr=errors, fmt="none", ecolor=GREY, elinewidth=0.8)
    size = min(marker(1.0), marker(60 / len(places)))
    kinds = {
        "supported, p < .05": (significant, "o", COLOURS[0], COLOURS[0]),
        "supported, p ≥ .05": (supported & ~significant, "o", COLOURS[0], "white"),
        "not supported": (~supported, "s", COLOURS[1], COLOURS[1]),
    }
    for label, (chosen, shape, colour, face) in kinds.items():
        if chosen.any():
            axes.plot(
                places[chosen],
                effects[chosen],
                shape,
                label=label,
                color=colour,
                markerfacecolor=face,
                markersize=size,
            )
    if data.claim.signed:
        axes.axhline(0, color="black", linewidth=0.6)
    axes.set_ylabel(fill(data.claim.effect, 24), fontsize="small")
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=3,
        frameon=False,
        fontsize="small",
        borderpad=0,
        handletextpad=0.2,
        columnspacing=1.0,
    )
    axes.tick_params(axis="x", labelbottom=False)


def _choices(axes: Axes, data: Curve) -> None:
    labels: list[str] = []
    headings: list[int] = []
    size = min(marker(0.8), marker(50 / len(data.judged)))
    for choice, options in data.options.items():
        headings.append(len(labels))
        labels.append(choice)
        for option in options:
            taken = [place for place, it in enumerate(data.chosen, 1) if it.get(choice) == option]
            axes.plot(taken, [len(labels)] * len(taken), "s", color="black", markersize=size)
            labels.append(option)
    axes.set_yticks(range(len(labels)), labels, fontsize="small")
    for place in headings:
        axes.get_yticklabels()[place].set_fontweight("bold")
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlabel("analyses, by effect")
    axes.locator_params(axis="x", integer=True)
