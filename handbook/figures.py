"""The figures of docs/model.md: the paper's figures under each law.

`python -m handbook.figures docs/model` redraws them.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.claims.coverage import PLACES_M, full_coverage, local_curve, local_scene
from analysis.report.drawing import Panel, Series
from device.beam.eq15 import same_direction_ratio
from device.beam.modes import FloatArray
from device.beam.windows import mode_window
from device.friction.coefficient import friction_coefficient
from device.friction.laws import LAWS
from device.friction.rungs import TOP_RUNG
from device.friction.scenes import Drive, Scene

_MM = 1e3
_X_LABEL, _MU_LABEL = "x, mm", "μ'"


def _by_law(title: str, x_label: str, x: NDArray[Any], of: dict[str, FloatArray]) -> Panel:
    series = tuple(Series(label=name, x=x, y=values) for name, values in of.items())
    return Panel(title=title, x_label=x_label, y_label=_MU_LABEL, series=series)


def _friction_along_the_beam() -> tuple[Panel, ...]:
    laws = {law: local_curve(law, Scene()) for law in LAWS}
    rungs = {
        rung: friction_coefficient(Scene(), rung=rung, x_m=PLACES_M)
        for rung in ("eq15", "far-field", "mode", TOP_RUNG)
    }
    return (
        _by_law("μ' along the beam (Fig 12), by law", _X_LABEL, _MM * PLACES_M, laws),
        _by_law("μ' along the beam, consistent, by rung", _X_LABEL, _MM * PLACES_M, rungs),
    )


def _ratios() -> tuple[Panel, ...]:
    exact = mode_window(6, 0.1, PLACES_M, 0.01).right
    curves = {
        "Eq 15, lower γ first": same_direction_ratio(PLACES_M, 0.01),
        "Eq 15, higher γ last": same_direction_ratio(PLACES_M, 0.01, "last"),
        "mode 6": exact,
    }
    panel = _by_law("a/u along the beam (Fig 11)", _X_LABEL, _MM * PLACES_M, curves)
    helping = np.arange(21.0)
    full = {
        law: np.array([full_coverage(law, same_direction=float(a)) for a in helping])
        for law in LAWS
    }
    return (
        replace(panel, y_label="a/u"),
        _by_law("full coverage (Fig 8)", "a, of 20 bodies", helping, full),
    )


def _full_coverage() -> tuple[Panel, ...]:
    def panel(title: str, axis: str, x: NDArray[Any], mu: Callable[[str, float], float]) -> Panel:
        curves = {law: np.array([mu(law, float(point)) for point in x]) for law in LAWS}
        return _by_law(title, axis, x, curves)

    def by_u(law: str, u: float) -> float:
        return full_coverage(law, same_direction=u / 2, bodies=int(u))

    def by(name: str) -> Callable[[str, Any], float]:
        return lambda law, value: full_coverage(law, **{name: value})

    near = np.linspace(0.95, 1.05, 101)
    return (
        panel("u, a/u = ½ (Fig 13b)", "u", np.arange(10.0, 41.0), by_u),
        panel("frequency (Fig 13c)", "frequency over resonance", near, by("detuning")),
        panel("voltage (Fig 13d)", "V", np.linspace(0.0, 200.0, 41), by("voltage_v")),
        panel("load per body (Fig 13)", "f, N", np.geomspace(0.5, 20.0, 40), by("load_n")),
    )


def _local_parameters() -> tuple[Panel, ...]:
    panels = []
    for law in LAWS:
        curves = {f"{v:.0f} V": local_curve(law, local_scene(voltage_v=v)) for v in (50, 100, 200)}
        title = f"voltage (Fig 14a), {law}"
        panels.append(_by_law(title, _X_LABEL, _MM * PLACES_M, curves))
        modes = {f"mode {m}": local_curve(law, Scene(drive=Drive(mode=m))) for m in (6, 5, 4)}
        title = f"falling frequency (Fig 14b), {law}"
        panels.append(_by_law(title, _X_LABEL, _MM * PLACES_M, modes))
    return tuple(panels)


def model_figures() -> dict[str, tuple[Panel, ...]]:
    """Return the panels of every figure of docs/model.md except the ladder, by file name."""
    return {
        "friction-along-the-beam": _friction_along_the_beam(),
        "ratios-and-full-coverage": _ratios(),
        "full-coverage-parameters": _full_coverage(),
        "local-parameters": _local_parameters(),
    }


if __name__ == "__main__":
    import sys
    from pathlib import Path

    from analysis.report.drawing import panels_files

    for name, panels in model_figures().items():
        Path(sys.argv[1], f"{name}.svg").write_bytes(panels_files(panels, ["svg"])["svg"])
