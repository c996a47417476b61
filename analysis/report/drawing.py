"""Axes, styles and files of figures; the only module that imports matplotlib."""

import io
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import chdir
from dataclasses import dataclass, field
from functools import lru_cache
from html import escape
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from analysis.estimates import FloatArray, IntArray, Interval
from analysis.report.findings import Scale

with chdir(Path(sys.executable).parent):  # it reads a `matplotlibrc` in the current folder
    from matplotlib import font_manager, rc_context, rcParams, rcParamsDefault
    from matplotlib.axes import Axes
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

# Other modules take the type from here, so that matplotlib is imported in one place.
__all__ = ["Axes"]


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
    logarithmic: bool = False


# Okabe and Ito's palette, which suits colour-blind readers; marker shapes differ as well.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
FILLS = ("full", "none", "left", "bottom", "right", "top")
"""How the shapes are filled, when all have had their turn."""
GREY = "#767676"
DASHES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), "-")
_FONT = "DejaVu Sans"
_REPRODUCIBLE: Any = {
    # Not what a notebook has set, or a file of settings in whatever folder it was started in.
    **{name: value for name, value in rcParamsDefault.items() if name != "backend"},
    # Ids of an SVG are random without a salt; the same input must give the same bytes.
    "svg.hashsalt": "touchbeam",
    "svg.fonttype": "none",
    # TrueType, because many journals refuse the Type 3 fonts that are the default.
    "pdf.fonttype": 42,
    "font.family": [_FONT, "sans-serif"],
}
"""Text stays text: it can be searched and edited, and a PDF embeds its font."""
_STYLE: Any = {
    **_REPRODUCIBLE,
    "axes.spines.top": False,
    "axes.spines.right": False,
    # A dollar sign in a subject's or condition's name is no formula.
    "text.parse_math": False,
}
HEIGHT_IN = 3.8
LEGEND_ROW_IN = 0.22
# What journals ask of pictures at least.
_DOTS_PER_INCH = 300


class Size(NamedTuple):
    """Width of a figure in inches, its height relative to the widest one's, and its type in pt."""

    width_in: float
    height: float
    font_pt: float


# Widths of a page and of a column in journals, in centimetres.
TWO_COLUMNS = Size(17.8 / 2.54, 1.0, 10.0)
ONE_COLUMN = Size(8.5 / 2.54, 0.68, 7.0)
"""Of a journal's page."""
FORMATS = (".svg", ".pdf", ".png", "-column.pdf")
"""What is written of each figure: for two columns, and for one."""
_JITTER = 0.016
"""Offset between equal scores, as a share of the scale."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """Figure as SVG text to embed in a page; `files` makes its files by the ends of their names."""

    name: str
    svg: str
    files: Callable[[], Mapping[str, bytes]]


@dataclass(frozen=True, kw_only=True)
class Words:
    """Name, title and description of a figure; screen readers read the last two."""

    name: str
    title: str
    description: str


@dataclass(frozen=True)
class Sheet:
    """Empty figure of one of the widths, in which a figure takes its axes before it draws."""

    size: Size
    figure: Figure = field(default_factory=Figure)

    def axes(self, height_in: float = HEIGHT_IN) -> Axes:
        """Return the only axes of a figure of this height; a narrow one is lower."""
        return self.grid(1, 1, height_in)[0]

    def grid(self, rows: int, columns: int, height_in: float) -> list[Axes]:
        """Return `rows` x `columns` axes with shared scales, row by row."""
        self.figure.set_size_inches(self.size.width_in, self.size.height * height_in)
        grid = self.figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        return list(grid.ravel())


Draw = Callable[[Sheet], None] | tuple[Panel, ...]
"""What draws into an empty figure, or panels, which have a size of their own."""


def marked(number: int) -> dict[str, Any]:
    """Return the `number`-th marker: its shape and filling, and its colour, which differ as well.

    The first 42 differ in shape or filling, the first 252 in that or in colour.
    """
    turn, shape = divmod(number, len(MARKERS))
    return {
        "marker": MARKERS[shape],
        "fillstyle": FILLS[turn % len(FILLS)],
        "markerfacecoloralt": "white",
        "color": COLOURS[(shape + turn) % len(COLOURS)],
    }


def intervals(
    axes: Axes,
    places: FloatArray | IntArray,
    middle: FloatArray,
    ends: FloatArray,
    number: int = 0,
    label: str = "",
) -> None:
    """Draw values with their intervals, shape (n, 2), in the `number`-th colour and shape."""
    low, high = ends.T
    axes.errorbar(
        places,
        middle,
        yerr=np.array([middle - low, high - middle]),
        linestyle="none",
        linewidth=1,
        # Shape and colour, because colour alone is lost on some readers and in print.
        **marked(number),
        label=label,
    )


def panels_files(panels: Sequence[Panel], kinds: Sequence[str]) -> dict[str, bytes]:
    """Return panels, two per row, as reproducible bytes by kind: `svg`, `png` or `pdf`."""
    made = {"svg": lambda figure: _reproducible_svg(figure).encode(), "pdf": _saved_pdf}
    with rc_context(_REPRODUCIBLE):
        figure = _panels(panels)
        return {kind: made.get(kind, _saved)(figure) for kind in kinds}


def _panels(panels: Sequence[Panel]) -> Figure:
    rows, columns = -(-len(panels) // 2), min(len(panels), 2)
    figure = Figure(figsize=(4.6 * columns, 3.3 * rows))
    for place, panel in enumerate(panels, start=1):
        _draw_panel(figure.add_subplot(rows, columns, place), panel)
    # Once: each further pass, as for each file, would move the axes by a rounding error.
    ConstrainedLayoutEngine().execute(figure)
    return figure


def _draw_panel(axes: Axes, panel: Panel) -> None:
    for series, colour, dashes in zip(panel.series, cycle(COLOURS), cycle(DASHES), strict=False):
        style = {"marker": "o", "linestyle": "none"} if series.marked else {"linestyle": dashes}
        axes.plot(series.x, series.y, label=series.label, color=colour, linewidth=1.3, **style)
        if series.error is not None:
            band = series.y - series.error, series.y + series.error
            axes.fill_between(series.x, *band, color=colour, alpha=0.3, linewidth=0)
        for name, x, y in zip(series.names, series.x, series.y, strict=False):
            axes.annotate(name, (x, y), xytext=(4, 4), textcoords="offset points", fontsize=7)
    axes.set_title(panel.title, fontsize=9)
    axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
    if panel.logarithmic:
        axes.set(xscale="log", yscale="log")
        # Names stand right of their points and need room.
        axes.margins(x=0.25)
    if len(panel.series) > 1:
        axes.legend(loc="best", framealpha=0.85, edgecolor="none", fontsize=7)


def limits(scale: Scale) -> Interval:
    """Return the ends of an axis with the whole scale and a margin for points at its ends."""
    return scale.lowest - 0.05 * scale.span, scale.highest + 0.07 * scale.span


def jitter(count: int, scale: Scale) -> FloatArray:
    """Return small, reproducible offsets that keep equal scores apart."""
    # Multiples of the golden ratio, modulo 1, spread evenly without random numbers.
    return np.asarray(_JITTER * scale.span * ((np.arange(count) * 0.6180339887) % 1.0 - 0.5))


@lru_cache(maxsize=1)
def _known_characters() -> frozenset[int]:
    font = font_manager.get_font(font_manager.findfont(_FONT))
    return frozenset(font.get_charmap())


def marker(times: float) -> float:
    """Return a marker's size, pt, relative to that of a point."""
    return times * float(rcParams["lines.markersize"])


def labels_of(names: tuple[str, ...], what: str) -> list[str]:
    """Return axis labels, with a number in place of a name that the font cannot draw."""
    # Conditions crossed of factors may begin alike, and must not look alike.
    kept = 16 if len({name[:15] for name in names}) == len(set(names)) else 40
    return [
        (name if len(name) <= kept else f"{name[: kept - 1]}…")
        # A missing glyph would be drawn as a box, the same for every name.
        if all(ord(letter) in _known_characters() for letter in name)
        else f"{what} {number}"
        for number, name in enumerate(names, start=1)
    ]


def name_places(axes: Axes, labels: Sequence[str]) -> None:
    """Write `labels` below the places 0, 1, …, upright if there is no room side by side."""
    firsts = [len(label.partition("\n")[0]) for label in labels]
    crowded, longest = sum(firsts) > 60, max(firsts, default=0)
    # Longer ones would leave no height to the axes.
    size = rcParams["font.size"] * (min(1.0, 22 / longest) if crowded else 1.0)
    axes.set_xticks(np.arange(len(labels)), labels, rotation=90 if crowded else 0, fontsize=size)


def legend_columns(labels: Sequence[str]) -> int:
    """Return in how many columns a legend of these labels has room above the axes."""
    return max(1, min(4, 72 // (6 + max(map(len, labels), default=0))))


def name_series(axes: Axes, title: str | None = None) -> None:
    """Write a legend above the axes."""
    columns = legend_columns(axes.get_legend_handles_labels()[1])
    axes.legend(
        title=title, ncol=columns, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False
    )


def legend_in(labels: Sequence[str]) -> float:
    """Return the height of such a legend, with its title."""
    return LEGEND_ROW_IN * (1 + -(-len(labels) // legend_columns(labels)))


def drawing(draw: Draw, words: Words) -> Drawing:
    """Return what `draw` draws, for two columns and for one; of panels the former alone."""

    def figure(size: Size) -> Figure:
        if isinstance(draw, tuple):
            return _panels(draw)
        sheet = Sheet(size)
        draw(sheet)
        ConstrainedLayoutEngine().execute(sheet.figure)
        return sheet.figure

    def files() -> Mapping[str, bytes]:
        with rc_context(_REPRODUCIBLE):
            two = {".svg": svg.encode(), ".pdf": _saved_pdf(wide), ".png": _saved(wide)}
        if isinstance(draw, tuple):
            return two
        with rc_context(_sized(ONE_COLUMN)):
            return {**two, "-column.pdf": _saved_pdf(figure(ONE_COLUMN))}

    with rc_context(_REPRODUCIBLE if isinstance(draw, tuple) else _sized(TWO_COLUMNS)):
        wide = figure(TWO_COLUMNS)
        svg = _svg(wide, words)
    return Drawing(name=words.name, svg=svg, files=files)


def _sized(size: Size) -> Any:
    """Return the style, in which markers and lines shrink with the type."""
    share = size.font_pt / TWO_COLUMNS.font_pt
    return {
        **_STYLE,
        "font.size": size.font_pt,
        "lines.linewidth": 1.3 * share,
        "lines.markersize": 5 * share,
        "axes.linewidth": 0.8 * share,
    }


def _saved_pdf(figure: Figure) -> bytes:
    return _saved(figure, "pdf", "CreationDate")


def _saved(figure: Figure, kind: str = "png", stamp: str = "Software") -> bytes:
    """Return the figure without the `stamp` that would change from one time to the next."""
    out = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(out, format=kind, dpi=_DOTS_PER_INCH, metadata={stamp: None})
    return out.getvalue()


def _svg(figure: Figure, words: Words) -> str:
    """Return the figure with title and description, and with ids that are unique in the page."""
    text = re.sub(r"<metadata>.*?</metadata>", "", _reproducible_svg(figure), flags=re.DOTALL)
    # All figures are in one page, where two with the same id would take each other's parts.
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
    figure.savefig(out, format="svg", metadata={"Date": None})
    # An SVG within HTML has no XML declaration.
    return "<svg" + out.getvalue().partition("<svg")[2].replace("\r\n", "\n")
