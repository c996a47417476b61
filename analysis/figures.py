"""The report's figures as SVG. The one module that imports matplotlib."""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from analysis.panels import Panel
from analysis.scores import ScoreTable
from analysis.table4 import table4

# Okabe and Ito's palette, which colour-blind readers can tell apart.
_LINE, _MEAN = "#999999", "#0072B2"
_COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_DASHES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), "-")
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


def panels_figure(panels: Sequence[Panel], kind: str = "svg") -> bytes:
    """Return panels side by side, two to a row, as `svg`, `png` or `pdf`; the same bytes always."""
    rows, columns = -(-len(panels) // 2), min(len(panels), 2)
    figure = Figure(figsize=(4.6 * columns, 3.3 * rows), layout="constrained")
    for place, panel in enumerate(panels, start=1):
        _draw_panel(figure.add_subplot(rows, columns, place), panel)
    if kind == "svg":
        FigureCanvasSVG(figure)
        return _svg(figure).encode()
    out = io.BytesIO()
    stamp = {"Software": None} if kind == "png" else {"CreationDate": None}
    figure.savefig(out, format=kind, dpi=150, metadata=stamp)
    return out.getvalue()


def _draw_panel(axes: Axes, panel: Panel) -> None:
    for series, colour, dashes in zip(panel.series, _COLOURS, _DASHES, strict=False):
        style = {"marker": "o", "linestyle": "none"} if series.marked else {"linestyle": dashes}
        axes.plot(series.x, series.y, label=series.label, color=colour, linewidth=1.3, **style)
        for name, x, y in zip(series.names, series.x, series.y, strict=False):
            axes.annotate(name, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7)
    axes.set_title(panel.title, fontsize=9)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    if panel.logarithmic_x:
        axes.set_xscale("log")
        axes.margins(x=0.25)
    if len(panel.series) > 1:
        axes.legend(frameon=False, fontsize=7)


def _svg(figure: Figure) -> str:
    """The figure as the same bytes every time: no date, no random ids."""
    out = io.StringIO()
    with rc_context(_REPRODUCIBLE):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return "<svg" + out.getvalue().partition("<svg")[2].replace("\r\n", "\n")
