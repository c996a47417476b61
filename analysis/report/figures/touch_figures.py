"""Figures of trials and touches as made: reaction times, and force and place against the plan."""

from collections.abc import Mapping, Sequence

import numpy as np

from analysis.estimates import FloatArray
from analysis.report.drawing import (
    COLOURS,
    GREY,
    Axes,
    Drawing,
    Words,
    drawing,
    labels_of,
    name_places,
)


def strips_figure(
    groups: Mapping[str, FloatArray],
    medians: Sequence[float],
    words: Words,
    axis: str,
    *,
    across: str,
    logarithmic: bool = False,
    asked: float | None = None,
) -> Drawing:
    """Return values of each group as points beside its median; `asked` is a dashed line."""

    def draw(axes: Axes) -> None:
        for place, (values, median) in enumerate(zip(groups.values(), medians, strict=True)):
            # Multiples of the golden ratio spread points evenly without random numbers.
            beside = place + 0.3 * ((np.arange(len(values)) * 0.6180339887) % 1.0 - 0.5)
            axes.plot(beside, values, ".", color=COLOURS[0], alpha=0.5)
            axes.plot([place - 0.25, place + 0.25], [median] * 2, color="black")
        if asked is not None:
            axes.axhline(asked, color=GREY, linestyle="--", linewidth=0.8)
        if logarithmic:
            axes.set_yscale("log")
            axes.yaxis.set_major_formatter("{x:g}")
            axes.yaxis.set_minor_formatter("{x:g}")
        name_places(axes, labels_of(tuple(groups), across))
        axes.set(xlabel=across, ylabel=axis)

    return drawing(words, draw)
