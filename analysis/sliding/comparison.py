"""Every friction law and rung beside the measured friction: Fig 16 redrawn, with error measures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from scipy.stats import f as f_distribution

from analysis.estimates import LEVEL, FloatArray, Interval, NotEstimable
from analysis.report.drawing import Panel, Series
from analysis.sliding import rig_model
from analysis.sliding.rig_model import (
    BinnedPass,
    MeanCurve,
    Repeats,
    RigProperties,
    Setting,
    half_wave_ratio,
)
from device.errors import OutOfRangeError
from device.friction.coefficient import friction_coefficient
from device.friction.laws import LAWS
from device.friction.rungs import RUNG_NAMES, TOP_RUNG, rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene

# Troughs and peaks of friction along the beam, with intervals of their places.
#
# Friction turns in corners: the part of the block over one zone of motion grows and shrinks in
# straight lines, with a short plateau between. A parabola would find the middle of the plateau,
# not the trough at its end. So the fitted friction gives the shape near each extreme, and the
# passes say how far it must be moved, with a level and a swing of their own:
#
#     μ(x) = a + b m(x - δ),  b > 0
#
# The interval of the place contains every δ whose sum of squares, with a and b at their best, is
# within the 95% point of the best one's.
#
# Distances are for the paper's beam; on another they are in proportion to half a wave.

Kind = Literal["trough", "peak"]
GRID_M = 0.01e-3
_AROUND_M = 6e-3
"""Friction within this distance of an extreme determines its place: a third of a period."""
_REACH_M = 4e-3
"""How far the passes may move an extreme; further, it is nearer to the next one of its kind."""
_MARGIN_M = 2e-3
"""An extreme closer to an end of the path is not looked for: one of its sides is missing."""
_LEAST_BINS = 6


@dataclass(frozen=True, kw_only=True)
class Extreme:
    """A trough or a peak under one setting.

    `expected_m` is its place in the fitted friction, `place_m` that in the passes, or why they do
    not tell it, and `interval_m` the 95% interval of that, None without a place.
    """

    kind: Kind
    setting: Setting
    expected_m: float
    place_m: float | NotEstimable
    interval_m: Interval | None


def turning_places(x_m: FloatArray, mu: FloatArray, kind: Kind) -> FloatArray:
    """Return the places where a curve on a fine grid turns, not counting the curve's ends."""
    height = mu if kind == "peak" else -mu
    inner = (height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])
    return np.asarray(x_m[1:-1][inner])


Shape = tuple[FloatArray, FloatArray]
"""Places, rising, and friction there."""


def _shape(setting: Setting, ends_m: Interval, rig: RigProperties, spread_m: float) -> Shape:
    """Return a fine grid and the rig's friction there, as bins see it."""
    x_m = np.asarray(np.arange(ends_m[0], ends_m[1] + GRID_M / 2, GRID_M), dtype=np.float64)
    places = rig_model.Places.along([setting], [x_m], [spread_m])
    return x_m, rig_model.friction_along(places, [rig])[0]


def extremes(repeats: Repeats, rig: RigProperties, noise: rig_model.Noise) -> tuple[Extreme, ...]:
    """Return the extremes of repeated passes with the drive on, from left to right."""
    setting, binned = repeats
    low_m = min(float(one.x_m.min()) for one in binned)
    high_m = max(float(one.x_m.max()) for one in binned)
    ratio = half_wave_ratio(rig.surface)
    beyond_m, margin_m = ratio * (_REACH_M + _AROUND_M), ratio * _MARGIN_M
    ends = max(low_m - beyond_m, GRID_M), min(high_m + beyond_m, rig.surface.length_m)
    x_m, mu = _shape(setting, ends, rig, 0.0)
    shape = _shape(setting, ends, rig, float(np.mean([one.spread_m for one in binned])))
    found = [
        _located(repeats, shape, noise, kind, float(place), ratio)
        for kind in get_args(Kind)
        for place in turning_places(x_m, mu, kind)
        if low_m + margin_m <= place <= high_m - margin_m
    ]
    return tuple(sorted(found, key=lambda one: one.expected_m))


def _located(
    repeats: Repeats,
    shape: Shape,
    noise: rig_model.Noise,
    kind: Kind,
    expected_m: float,
    ratio: float,
) -> Extreme:
    setting, binned = repeats
    around_m, reach_m = ratio * _AROUND_M, ratio * _REACH_M
    nearby = (_near(one, expected_m, around_m) for one in binned)
    near = [one for one in nearby if one.x_m.size >= _LEAST_BINS]
    steps = np.asarray(np.arange(-reach_m, reach_m + GRID_M / 2, GRID_M), dtype=np.float64)
    place_m: float | NotEstimable = NotEstimable("too few samples near it")
    interval: Interval | None = None
    if near:
        squares, points = _squares(near, shape, noise, steps)
        spare = points - 3
        best = int(np.argmin(squares))
        # (12), mathematics/sliding
        rise = f_distribution.ppf(1 - LEVEL, 1, spare) * max(1.0, squares[best] / spare)
        inside = np.flatnonzero(squares <= squares[best] + rise)
        if inside[0] == 0 or inside[-1] == steps.size - 1:
            place_m = NotEstimable(
                f"the passes place it within more than {1e3 * reach_m:.2g} mm: too little swing"
            )
        else:
            place_m = expected_m + float(steps[best])
            # Half a step more on either side: the ends lie between two steps.
            low, high = (float(steps[end]) for end in (inside[0], inside[-1]))
            interval = expected_m + low - GRID_M / 2, expected_m + high + GRID_M / 2
    return Extreme(
        kind=kind, setting=setting, expected_m=expected_m, place_m=place_m, interval_m=interval
    )


def _near(one: BinnedPass, place_m: float, around_m: float) -> BinnedPass:
    kept = np.abs(one.x_m - place_m) <= around_m
    by_bin = {name: getattr(one, name)[kept] for name in ("bin", "x_m", "t_s", "mu", "count")}
    return replace(one, **by_bin)


def _squares(
    near: Sequence[BinnedPass], shape: Shape, noise: rig_model.Noise, steps: FloatArray
) -> tuple[FloatArray, int]:
    """Return the least sum of squares of each shift, and the number of bins."""
    white = []
    for one in near:
        factor = noise.factor(one, np.interp(one.x_m, *shape))
        shapes = np.interp(one.x_m[:, None] - steps, *shape)
        parts = one.mu, np.ones(one.x_m.size), shapes
        white.append([rig_model.whitened(factor, part) for part in parts])
    mu, ones, shapes = (np.concatenate(part) for part in zip(*white, strict=True))
    level = ones / np.linalg.norm(ones)
    mu = mu - level * (level @ mu)
    shapes = shapes - np.outer(level, level @ shapes)
    size = np.maximum(np.einsum("ij,ij->j", shapes, shapes), 1e-300)
    swing = np.maximum(mu @ shapes, 0.0)  # (11), mathematics/sliding
    return np.asarray(mu @ mu - swing**2 / size), mu.size


PAPER_HZ = 23_200.0
_MM = 1e3
_FINE = 4
"""Places of a curve's own grid per bin when its troughs and peaks are looked for."""


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """How far a law on a rung is from the measured friction, over all driven settings.

    `fitted` is whether for the fitted rig; else it is for the one that is described, with μ as
    measured at rest and drives relative to the measured resonance. `rmse` and `mean_absolute` are
    of the difference in μ'; `places_m` is the mean distance of the measured troughs and peaks from
    the nearest ones predicted, nan if none is predicted or located.
    """

    law: str
    rung: str
    fitted: bool
    rmse: float
    mean_absolute: float
    places_m: float


def predicted(
    setting: Setting, rig: RigProperties, law: str, rung: str, x_m: FloatArray
) -> FloatArray:
    """Return μ' at places, shape (n,), as a law on a rung predicts it for a rig."""
    beam, mode = rig.beam(), rig.surface.mode
    own_hz = rung_resonance_hz(rung, beam, mode)
    scene = Scene(
        structure=replace(
            rig.surface.structure,
            beam=beam,
            body_height_m=max(rig.body_height_m, 0.0),
            friction_coefficient=rig.friction_coefficient,
        ),
        drive=Drive(
            voltage_v=setting.voltage_v * rig.gain,
            frequency_hz=setting.frequency_hz / rig.resonance_hz * own_hz,
            mode=mode,
        ),
        touch=FingerContact(
            contact_m=setting.contact_m,
            finger_load_n=setting.load_n,
            sliding_speed_m_s=setting.speed_m_s,
        ),
        direction=setting.direction,
    )
    return friction_coefficient(scene, law=law, rung=rung, x_m=np.clip(x_m, 0.0, beam.length_m))


def compared_rungs(curve: MeanCurve, *rigs: RigProperties) -> tuple[str, ...]:
    """Return the rungs that the beams of these rigs and the block allow."""

    def is_allowed(rung: str) -> bool:
        try:
            for rig in rigs:
                predicted(curve.setting, rig, "consistent", rung, curve.x_m)
        except OutOfRangeError:
            return False
        return True

    return tuple(filter(is_allowed, RUNG_NAMES))


def mismatches(
    curves: Sequence[MeanCurve],
    located: Sequence[Extreme],
    described: RigProperties,
    fitted: RigProperties,
) -> tuple[Mismatch, ...]:
    """Return the mismatch of each law on each rung, for the described rig and the fitted one."""
    driven = [curve for curve in curves if curve.setting.voltage_v > 0]
    tried = compared_rungs(driven[0], described, fitted)
    return tuple(
        Mismatch(
            law=law, rung=rung, fitted=rig is fitted, **_errors(driven, located, rig, law, rung)
        )
        for law, rung, rig in product(LAWS, tried, (described, fitted))
    )


def _errors(
    curves: Sequence[MeanCurve], located: Sequence[Extreme], rig: RigProperties, law: str, rung: str
) -> dict[str, float]:
    off: list[FloatArray] = []
    distances: list[float] = []
    for curve in curves:
        x_m = _fine_m(curve)
        mu = predicted(curve.setting, rig, law, rung, x_m)
        off.append(np.interp(curve.x_m, x_m, mu) - curve.mu)
        for one in located:
            if one.setting == curve.setting and isinstance(one.place_m, float):
                places = turning_places(x_m, mu, one.kind)
                if places.size:
                    distances.append(float(np.abs(places - one.place_m).min()))
    difference = np.concatenate(off)
    return {
        "rmse": float(np.sqrt(np.mean(difference**2))),
        "mean_absolute": float(np.mean(np.abs(difference))),
        "places_m": float(np.mean(distances)) if distances else float("nan"),
    }


def figure_panels(
    curves: Sequence[MeanCurve], nominal: RigProperties, fitted: RigProperties
) -> tuple[Panel, ...]:
    """Return Fig 16 redrawn: the laws at resonance, of the paper's beam also at its drive.

    Beside them the rungs under the law `consistent`, and the fitted rig at every drive.
    """
    driven = [curve for curve in curves if curve.setting.voltage_v > 0]
    resonant = min(driven, key=lambda curve: abs(curve.setting.frequency_hz - fitted.resonance_hz))
    shown = [resonant]
    if nominal.is_papers:
        shown.insert(0, min(driven, key=lambda one: abs(one.setting.frequency_hz - PAPER_HZ)))
    tried = compared_rungs(resonant, nominal)
    return (
        *(
            _panel(curve, "laws", nominal, {law: (law, TOP_RUNG) for law in LAWS})
            for curve in dict.fromkeys(shown)
        ),
        _panel(resonant, "rungs", nominal, {rung: ("consistent", rung) for rung in tried}),
        *(
            _panel(curve, "fitted", fitted, {"fitted rig": ("consistent", TOP_RUNG)})
            for curve in driven
        ),
    )


def measured_panels(curves: Sequence[MeanCurve]) -> tuple[Panel, ...]:
    """Return the measured friction at every drive, beside no model."""
    return tuple(_panel(curve, "measured") for curve in curves)


def _panel(
    curve: MeanCurve,
    what: str,
    rig: RigProperties | None = None,
    lines: Mapping[str, tuple[str, str]] = MappingProxyType({}),
) -> Panel:
    """Return a measured curve beside predictions for a rig: law and rung by label."""
    own, x_m = curve.setting, _fine_m(curve)
    measured = Series(label="measured", x=_MM * curve.x_m, y=curve.mu, error=curve.error)
    series = [
        Series(label=label, x=_MM * x_m, y=predicted(own, rig, *of, x_m))
        for label, of in lines.items()
        if rig is not None
    ]
    title = f"{own.voltage_v:g} V, {own.frequency_hz:.0f} Hz, to the {own.direction}: {what}"
    return Panel(title=title, x_label="x, mm", y_label="μ'", series=(measured, *series))


def _fine_m(curve: MeanCurve) -> FloatArray:
    return np.linspace(curve.x_m[0], curve.x_m[-1], _FINE * curve.x_m.size)
