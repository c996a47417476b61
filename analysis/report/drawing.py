"""Figures of the report, the model and the ladder; the only module that imports matplotlib."""

import io
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from typing import Any

import numpy as np
from matplotlib import font_manager, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from analysis.estimates import FloatArray, Interval
from analysis.report.figure_data import Course, Gains, Raincloud, Scatter
from analysis.report.findings import Scale


@dataclass(frozen=True, kw_only=True)
class Series:
    """Curve, or a set of points (optionally named) if `marked`.

    A curve with a standard `error` has a band of one on either side.
    """

    label: str
    x: FloatArray
    y: FloatArray
    marked: bool = False
    names: Sequence[str] = ()
    error: FloatArray | None = None


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Axes of a figure with the series drawn in them."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    logarithmic_x: bool = False


# Okabe and Ito's palette, which suits colour-blind readers; marker shapes differ as well.
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
_GREY = "#767676"
_DASHES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), "-")
_FONT = "DejaVu Sans"
_REPRODUCIBLE: Any = {"svg.hashsalt": "touchbeam", "svg.fonttype": "path", "font.family": _FONT}
_STYLE: Any = {
    **_REPRODUCIBLE,
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.parse_math": False,
}
_WIDTH_IN = 7.2
_HEIGHT_IN = 3.8
_LEGEND_ROW_IN = 0.22
_DOTS_PER_INCH = 150
_CLOUD_SD = 0.04
"""Standard deviation of the clouds' density kernel, as a share of the scale."""
_JITTER = 0.016
"""Offset between equal scores, as a share of the scale."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """Figure as SVG text to embed in a page, and as PNG."""

    name: str
    svg: str
    png: bytes


@dataclass(frozen=True, kw_only=True)
class Words:
    """Name, title and description of a figure; screen readers read the last two."""

    name: str
    title: str
    description: str


def raincloud_figure(data: Raincloud, words: Words) -> Drawing:
    """Return score densities by condition, with a line per subject and means as diamonds."""

    def draw(axes: Axes) -> None:
        places = np.arange(len(data.table.conditions))
        for place, column in zip(places, data.table.scores.T, strict=True):
            _cloud(axes, float(place), column[~np.isnan(column)], data.scale)
        axes.plot(
            places,
            data.lines.T + _jitter(len(data.lines), data.scale),
            color=_GREY,
            marker="o",
            markersize=3,
            linewidth=0.6,
            alpha=0.6,
        )
        axes.plot(places, data.means, "D", color=_COLOURS[1], markersize=8, label="mean")
        _name_places(axes, _labels(data.table.conditions, "condition"))
        axes.set(ylim=_limits(data.scale), ylabel=f"score, {data.scale}")
        axes.legend(loc="lower left", frameon=False)

    return _drawing(words, draw)


def scatter_figure(data: Scatter, words: Words) -> Drawing:
    """Return ratings against predicted contrasts, with a marker and colour per condition."""

    def draw(axes: Axes) -> None:
        ratings = data.ratings
        labels = _labels(ratings.conditions, "condition")
        for place in np.unique(ratings.condition):
            own = ratings.condition == place
            axes.plot(
                ratings.contrast[own],
                ratings.rating[own] + _jitter(int(own.sum()), data.scale),
                linestyle="none",
                marker=_MARKERS[place % len(_MARKERS)],
                color=_COLOURS[place % len(_COLOURS)],
                markersize=5,
                alpha=0.7,
                label=labels[place],
            )
        for (model, curve), dashes in zip(data.curves.items(), _DASHES, strict=False):
            axes.plot(data.at, curve, color="black", linestyle=dashes, label=f"group, {model}")
        axes.set(ylim=_limits(data.scale), ylabel=f"rating, {data.scale}")
        axes.set_xlabel("predicted contrast, change of log friction")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)

    shown = len(np.unique(data.ratings.condition))
    return _drawing(words, draw, max(_HEIGHT_IN, _LEGEND_ROW_IN * (shown + 3)))


def gains_figure(data: Gains, words: Words) -> Drawing:
    """Return each subject's gain with its 95 % interval, with the models side by side."""

    def draw(axes: Axes) -> None:
        places = np.arange(len(data.shown))
        for number, (model, lines) in enumerate(data.models.items()):
            subjects = [lines.subjects[place] for place in data.shown]
            gain = np.array([line.gain for line in subjects])
            low, high = np.array([line.gain_interval for line in subjects]).T
            axes.errorbar(
                places + 0.25 * (number - (len(data.models) - 1) / 2),
                gain,
                yerr=np.array([gain - low, high - gain]),
                fmt=_MARKERS[number],
                color=_COLOURS[number],
                markersize=5,
                linewidth=1,
                label=f"{model}, 95 % interval",
            )
            axes.axhline(lines.gain, color=_COLOURS[number], linewidth=0.8, linestyle="--")
        names = next(iter(data.models.values())).subjects
        labels = _labels(tuple(names[place].subject for place in data.shown), "subject")
        _name_places(axes, labels)
        axes.set_ylabel("gain, points per unit of contrast")
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncol=2, frameon=False)

    return _drawing(words, draw)


def course_figure(data: Course, words: Words) -> Drawing:
    """Return mean scores by place in the session, with their standard errors."""

    def draw(axes: Axes) -> None:
        errors = np.nan_to_num(data.errors)
        axes.errorbar(
            data.places, data.means, yerr=errors, fmt="o-", color=_COLOURS[0], markersize=5
        )
        axes.set(ylim=_limits(data.scale), ylabel="mean score ± standard error")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.set_xlabel("place among the session's scored trials")

    return _drawing(words, draw)


def panels_figure(panels: Sequence[Panel], kind: str = "svg") -> bytes:
    """Return panels, two per row, as reproducible `svg`, `png` or `pdf` bytes."""
    figure = _panels(panels)
    if kind == "svg":
        return _reproducible_svg(figure).encode()
    return _saved(figure, kind, "Software" if kind == "png" else "CreationDate")


def panels_drawing(panels: Sequence[Panel], words: Words) -> Drawing:
    """Return the same for a page, as SVG and PNG."""
    figure = _panels(panels)
    return Drawing(name=words.name, svg=_svg(figure, words), png=_saved(figure))


def _panels(panels: Sequence[Panel]) -> Figure:
    rows, columns = -(-len(panels) // 2), min(len(panels), 2)
    figure = Figure(figsize=(4.6 * columns, 3.3 * rows), layout="constrained")
    for place, panel in enumerate(panels, start=1):
        _draw_panel(figure.add_subplot(rows, columns, place), panel)
    return figure


def _draw_panel(axes: Axes, panel: Panel) -> None:
    for series, colour, dashes in zip(panel.series, _COLOURS, _DASHES, strict=False):
        style = {"marker": "o", "linestyle": "none"} if series.marked else {"linestyle": dashes}
        axes.plot(series.x, series.y, label=series.label, color=colour, linewidth=1.3, **style)
        if series.error is not None:
            band = series.y - series.error, series.y + series.error
            axes.fill_between(series.x, *band, color=colour, alpha=0.3, linewidth=0)
        for name, x, y in zip(series.names, series.x, series.y, strict=False):
            axes.annotate(name, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7)
    axes.set_title(panel.title, fontsize=9)
    axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
    if panel.logarithmic_x:
        axes.set_xscale("log")
        axes.margins(x=0.25)
    if len(panel.series) > 1:
        axes.legend(frameon=False, fontsize=7)


def _limits(scale: Scale) -> Interval:
    """Return the ends of an axis with the whole scale and a margin for points at its ends."""
    return scale.lowest - 0.05 * scale.span, scale.highest + 0.07 * scale.span


def _cloud(axes: Axes, place: float, scores: FloatArray, scale: Scale) -> None:
    """Draw half a violin (normal kernel) right of `place`, and median and quartiles left of it."""
    if scores.size < 2:
        return
    values, counts = np.unique(scores, return_counts=True)
    grid = np.linspace(scale.lowest, scale.highest, 201)
    density = np.exp(-(((grid[:, None] - values) / (_CLOUD_SD * scale.span)) ** 2) / 2) @ counts
    width = 0.38 * density / density.max()
    axes.fill_betweenx(
        grid, place + 0.06, place + 0.06 + width, color=_COLOURS[5], alpha=0.5, linewidth=0
    )
    low, middle, high = np.quantile(scores, [0.25, 0.5, 0.75])
    axes.plot([place - 0.06] * 2, [low, high], color=_COLOURS[0], linewidth=4, alpha=0.8)
    axes.plot([place - 0.06], [middle], "_", color="black", markersize=9)


def _jitter(count: int, scale: Scale) -> FloatArray:
    """Return small, reproducible offsets that keep equal scores apart."""
    # Multiples of the golden ratio, modulo 1, spread evenly without random numbers.
    return np.asarray(_JITTER * scale.span * ((np.arange(count) * 0.6180339887) % 1.0 - 0.5))


@lru_cache(maxsize=1)
def _known_characters() -> frozenset[int]:
    font = font_manager.get_font(font_manager.findfont(_FONT))
    return frozenset(font.get_charmap())


def _labels(names: tuple[str, ...], what: str) -> list[str]:
    """Return axis labels, with a number in place of a name that the font cannot draw."""
    return [
        (name if len(name) <= 16 else f"{name[:15]}…")
        if all(ord(letter) in _known_characters() for letter in name)
        else f"{what} {number}"
        for number, name in enumerate(names, start=1)
    ]


def _name_places(axes: Axes, labels: Sequence[str]) -> None:
    """Write `labels` below the places 0, 1, …, upright if there is no room side by side."""
    crowded = sum(map(len, labels)) > 60
    axes.set_xticks(np.arange(len(labels)), labels, rotation=90 if crowded else 0)


def _drawing(words: Words, draw: Callable[[Axes], None], height_in: float = _HEIGHT_IN) -> Drawing:
    with rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH_IN, height_in), layout="constrained")
        draw(figure.add_subplot())
        return Drawing(name=words.name, svg=_svg(figure, words), png=_saved(figure))


def _saved(figure: Figure, kind: str = "png", stamp: str = "Software") -> bytes:
    """Return the figure without the `stamp` that would change from one time to the next."""
    out = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(out, format=kind, dpi=_DOTS_PER_INCH, metadata={stamp: None})
    return out.getvalue()


def _svg(figure: Figure, words: Words) -> str:
    """Return the figure with title and description, and with ids that are unique in the page."""
    text = re.sub(r"<metadata>.*?</metadata>", "", _reproducible_svg(figure), flags=re.DOTALL)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{words.name}-", text)
    opening, _, rest = text.partition(">")
    about = f'role="img" aria-labelledby="{words.name}-title {words.name}-desc"'
    return (
        f'{opening} {about}>\n <title id="{words.name}-title">{escape(words.title)}</title>\n'
        f' <desc id="{words.name}-desc">{escape(words.description)}</desc>{rest}'
    )


def _reproducible_svg(figure: Figure) -> str:
    """Return the same bytes every time: without a date or random ids."""
    out = io.StringIO()
    FigureCanvasSVG(figure)
    with rc_context(_REPRODUCIBLE):
        figure.savefig(out, format="svg", metadata={"Date": None})
    return "<svg" + out.getvalue().partition("<svg")[2].replace("\r\n", "\n")
