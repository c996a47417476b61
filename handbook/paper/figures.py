"""The paper's figures, computed under each friction law."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib import rc_context, rcdefaults, rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from analysis.estimates import FloatArray
from device.beam.eq15 import same_direction_ratio
from device.friction.laws import LAWS
from handbook.paper import scenes
from handbook.paper.scenes import PLACES_M, RESONANCE_HZ, SLIDING, along, fig8, whole_hand

_TROUGHS_MM = tuple(1e3 * scenes.TROUGHS_M)
# Okabe and Ito's colours, which suit colour-blind readers; dashes differ as well.
_STYLES = (("#0072B2", "-"), ("#D55E00", "--"), ("#009E73", "-."))


@dataclass(frozen=True, kw_only=True)
class Panel:
    """Axes with curves over `x`, by name; grey lines at values that the paper prints."""

    title: str
    curves: Mapping[str, FloatArray]
    x: NDArray[Any] = field(default_factory=lambda: 1e3 * PLACES_M)
    x_label: str = "x, mm"
    y_label: str = "μ'"
    printed_x: Sequence[float] = ()
    printed_y: Sequence[float] = ()


def _fig_8() -> list[Panel]:
    curves, label = {law: fig8(law) for law in LAWS}, "a, of 20 bodies"
    a, printed = np.arange(21.0), (0.2, 0.6)
    return [Panel(title="Fig 8, by law", curves=curves, x=a, x_label=label, printed_y=printed)]


def _fig_11() -> list[Panel]:
    curves = {
        "Eq 15, lower γ": same_direction_ratio(PLACES_M, scenes.CONTACT_M),
        "Eq 15, higher γ": same_direction_ratio(PLACES_M, scenes.CONTACT_M, "last"),
        "mode 6, exact": scenes.term("same_direction_ratio", x_m=PLACES_M),
    }
    return [Panel(title="Fig 11", curves=curves, y_label="a/u", printed_y=(0.0, 0.87))]


def _fig_12() -> list[Panel]:
    rungs = {"Eq 15": "eq15", "mode 6 alone": scenes.MODE, "beam as built": scenes.WHOLE_BEAM}
    panels = {
        "Fig 12, by law": {law: along(law) for law in LAWS},
        "Fig 12, law consistent": {name: along("consistent", rung) for name, rung in rungs.items()},
    }
    return [
        Panel(title=title, curves=curves, printed_x=_TROUGHS_MM, printed_y=(0.2, 0.6))
        for title, curves in panels.items()
    ]


def _fig_13() -> list[Panel]:
    u, ratio = np.arange(10.0, 41.0), np.linspace(0.95, 1.05, 101)
    volts, load_n = np.linspace(0.0, 200.0, 41), np.linspace(2.0, 20.0, 37)
    panels = (
        ("Fig 13b, half of the bodies help", "u", u, {"a": u / 2, "u": u}),
        ("Fig 13c", "frequency over resonance", ratio, {"frequency_hz": ratio * RESONANCE_HZ}),
        ("Fig 13d", "V", volts, {"voltage_v": volts}),
        ("Fig 13, the pressures", "f, N on each body", load_n, {"body_load_n": load_n}),
    )
    return [
        Panel(title=title, curves={law: whole_hand(law, **of) for law in LAWS}, x=x, x_label=label)
        for title, label, x, of in panels
    ]


def _fig_14() -> list[Panel]:
    panels = []
    for law in LAWS:
        volts = {f"{v} V": along(law, voltage_v=v) for v in (50, 100, 200)}
        modes = {f"mode {mode}": along(law, mode=mode, ratio="mode") for mode in (6, 5, 4)}
        panels.append(Panel(title=f"Fig 14a, {law}", curves=volts))
        panels.append(Panel(title=f"Fig 14b, {law}", curves=modes))
    return panels


def _fig_16() -> list[Panel]:
    by_law = {law: along(law, **SLIDING) for law in LAWS}
    by_drive = {
        "as in Fig 12": along("consistent"),
        "the same, damping ratio 0.03": along("consistent", damping_ratio=0.03),
        "23,200 Hz and 0.56 N": along("consistent", **SLIDING),
    }
    return [
        Panel(title="Fig 16, theory by law", curves=by_law, printed_x=_TROUGHS_MM),
        Panel(title="Fig 16, law consistent", curves=by_drive, printed_x=_TROUGHS_MM),
    ]


def figures() -> dict[str, list[Panel]]:
    """Return the panels of each figure, by its number in the paper."""
    drawn = {"8": _fig_8, "11": _fig_11, "12": _fig_12, "13": _fig_13, "14": _fig_14, "16": _fig_16}
    return {number: panels() for number, panels in drawn.items()}


def svg(panels: Sequence[Panel]) -> str:
    """Return panels, two in a row, as SVG: the same bytes for the same curves."""
    rows, columns = -(-len(panels) // 2), min(len(panels), 2)
    out = io.StringIO()
    with rc_context():
        rcdefaults()  # not what a file of settings says
        rcParams.update({"svg.hashsalt": "paper", "svg.fonttype": "none", "font.size": 9})
        figure = Figure(figsize=(4.0 * columns, 3.1 * rows), layout="constrained")
        for place, panel in enumerate(panels, start=1):
            _draw(figure.add_subplot(rows, columns, place), panel)
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return out.getvalue()


def _draw(axes: Axes, panel: Panel) -> None:
    grey: dict[str, Any] = {"color": "#767676", "linewidth": 0.8, "linestyle": ":"}
    for place in panel.printed_x:
        axes.axvline(place, **grey)
    for value in panel.printed_y:
        axes.axhline(value, **grey)
    for (name, curve), (colour, dashes) in zip(panel.curves.items(), _STYLES, strict=True):
        axes.plot(panel.x, curve, label=name, color=colour, linestyle=dashes, linewidth=1.3)
    if panel.printed_x or panel.printed_y:
        axes.plot([], [], label="values in the paper", **grey)
    axes.locator_params(axis="x", steps=[1, 2, 5, 10])
    axes.set(xlabel=panel.x_label, ylabel=panel.y_label)
    axes.set_title(panel.title, loc="left", fontsize=9, fontweight="bold", pad=30)
    # Above the axes, where it hides no curve.
    where: dict[str, Any] = {
        "loc": "lower left",
        "bbox_to_anchor": (0, 1),
        "ncols": 2,
        "borderaxespad": 0.2,
    }
    axes.legend(**where, frameon=False, fontsize=7.5, columnspacing=1.2)
