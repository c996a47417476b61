"""The report's figures as SVG. The one module that imports matplotlib."""

import io
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from analysis.scores import ScoreTable
from analysis.table4 import table4

# Okabe and Ito's palette, which colour-blind readers can tell apart.
_LINE, _MEAN = "#999999", "#0072B2"
_REPRODUCIBLE: Any = {
    "svg.hashsalt": "touchbeam",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
}


def scores_figure(table: ScoreTable) -> str:
    """Return an SVG: a line per subject over the conditions, and the means as diamonds."""
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.add_subplot()
    places = np.arange(len(table.conditions))
    for scores in table.scores:
        axes.plot(places, scores, color=_LINE, marker="o", markersize=4, linewidth=0.8, alpha=0.7)
    axes.plot(
        places,
        table4(table).column_means,
        color=_MEAN,
        marker="D",
        markersize=9,
        linestyle="none",
        label="mean",
    )
    axes.set_xticks(places, table.conditions)
    axes.set_ylim(-0.5, 10.5)
    axes.set_ylabel("score, 0 to 10")
    axes.legend(loc="lower left", frameon=False)
    return _svg(figure)


def _svg(figure: Figure) -> str:
    """The figure as the same bytes every time: no date, no random ids."""
    out = io.StringIO()
    with rc_context(_REPRODUCIBLE):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return "<svg" + out.getvalue().partition("<svg")[2].replace("\r\n", "\n")
