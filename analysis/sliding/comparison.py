"""Every friction law and rung beside the measured friction: Fig 16 redrawn, with error measures."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.estimates import FloatArray
from analysis.report.drawing import Panel, Series
from analysis.sliding.extremes import Extreme, turning_places
from analysis.sliding.passes import Curve, Setting
from analysis.sliding.rig_model import MODE, RigProperties
from device.friction.coefficient import friction_coefficient
from device.friction.laws import LAWS
from device.friction.rungs import MODAL_RUNGS, SEGMENTED_RUNGS, TOP_RUNG, rung_resonance_hz
from device.friction.scenes import Drive, FingerContact, Scene, Structure

RUNGS = (*MODAL_RUNGS, *SEGMENTED_RUNGS)
PAPER_HZ = 23_200.0
_MM = 1e3
_FINE = 4
"""Places of a curve's own grid per bin when its troughs and peaks are looked for."""


@dataclass(frozen=True, kw_only=True)
class Mismatch:
    """How far a law on a rung is from the measured friction, over all driven settings.

    Attributes:
        law: name.
        rung: name.
        fitted: whether for the fitted rig; else for the paper's, with μ as measured at rest and
            drives relative to the measured resonance.
        rms: root mean square difference in μ'.
        mean_absolute: mean absolute difference in μ'.
        places_m: mean distance of the measured troughs and peaks from the nearest ones predicted;
            nan if none is predicted or located.
    """

    law: str
    rung: str
    fitted: bool
    rms: float
    mean_absolute: float
    places_m: float


def predicted(
    setting: Setting, rig: RigProperties, law: str, rung: str, x_m: FloatArray
) -> FloatArray:
    """Return μ' at places, shape (n,), as a law on a rung predicts it for a rig."""
    beam = rig.beam()
    own_hz = rung_resonance_hz(rung, beam, MODE)
    structure = Structure(
        beam=beam,
        body_height_m=max(rig.body_height_m, 0.0),
        friction_coefficient=rig.friction_coefficient,
    )
    scene = Scene(
        structure=structure,
        drive=Drive(
            voltage_v=setting.voltage_v * rig.gain,
            frequency_hz=setting.frequency_hz / rig.resonance_hz * own_hz,
            mode=MODE,
        ),
        touch=FingerContact(
            contact_m=setting.contact_m,
            finger_load_n=setting.load_n,
            sliding_speed_m_s=setting.speed_m_s,
        ),
        direction=setting.direction,
    )
    return friction_coefficient(scene, law=law, rung=rung, x_m=np.clip(x_m, 0.0, beam.length_m))


def mismatches(
    curves: Sequence[Curve],
    located: Sequence[Extreme],
    nominal: RigProperties,
    fitted: RigProperties,
    rungs: Iterable[str] = RUNGS,
) -> tuple[Mismatch, ...]:
    """Return the mismatch of each law on each rung, for the paper's rig and for the fitted one."""
    driven = [curve for curve in curves if curve.setting.voltage_v > 0]
    return tuple(
        _mismatch(driven, located, rig, law, rung, fitted=rig is fitted)
        for law in LAWS
        for rung in rungs
        for rig in (nominal, fitted)
    )


def _mismatch(
    curves: Sequence[Curve],
    located: Sequence[Extreme],
    rig: RigProperties,
    law: str,
    rung: str,
    *,
    fitted: bool,
) -> Mismatch:
    off: list[FloatArray] = []
    distances: list[float] = []
    for curve in curves:
        x_m = np.linspace(curve.x_m[0], curve.x_m[-1], _FINE * curve.x_m.size)
        mu = predicted(curve.setting, rig, law, rung, x_m)
        off.append(np.interp(curve.x_m, x_m, mu) - curve.mu)
        for one in located:
            if one.setting == curve.setting and isinstance(one.place_m, float):
                places = turning_places(x_m, mu, one.kind)
                if places.size:
                    distances.append(float(np.abs(places - one.place_m).min()))
    difference = np.concatenate(off)
    return Mismatch(
        law=law,
        rung=rung,
        fitted=fitted,
        rms=float(np.sqrt(np.mean(difference**2))),
        mean_absolute=float(np.mean(np.abs(difference))),
        places_m=float(np.mean(distances)) if distances else float("nan"),
    )


def figure_panels(
    curves: Sequence[Curve], nominal: RigProperties, fitted: RigProperties
) -> tuple[Panel, ...]:
    """Return Fig 16 redrawn: the laws at the drive nearest to the paper's, and at resonance.

    Beside them the rungs under the law `consistent`, and the fitted rig at every drive.
    """
    driven = [curve for curve in curves if curve.setting.voltage_v > 0]
    papers = min(driven, key=lambda curve: abs(curve.setting.frequency_hz - PAPER_HZ))
    resonant = min(driven, key=lambda curve: abs(curve.setting.frequency_hz - fitted.resonance_hz))
    return (
        *(_laws(curve, nominal) for curve in dict.fromkeys((papers, resonant))),
        _rungs(resonant, nominal),
        *(_fitted(curve, fitted) for curve in driven),
    )


def _panel(curve: Curve, what: str, lines: Sequence[Series]) -> Panel:
    own = curve.setting
    measured = Series(label="measured", x=_MM * curve.x_m, y=curve.mu, error=curve.error)
    return Panel(
        title=f"{own.voltage_v:g} V, {own.frequency_hz:.0f} Hz, to the {own.direction}: {what}",
        x_label="x, mm",
        y_label="μ'",
        series=(measured, *lines),
    )


def _line(curve: Curve, label: str, rig: RigProperties, law: str, rung: str) -> Series:
    x_m = np.linspace(curve.x_m[0], curve.x_m[-1], _FINE * curve.x_m.size)
    mu = predicted(curve.setting, rig, law, rung, x_m)
    return Series(label=label, x=_MM * x_m, y=mu)


def _laws(curve: Curve, rig: RigProperties) -> Panel:
    lines = [_line(curve, law, rig, law, TOP_RUNG) for law in LAWS]
    return _panel(curve, "laws", lines)


def _rungs(curve: Curve, rig: RigProperties) -> Panel:
    shown = ("eq15", "far-field", "mode", "euler-patched", "timoshenko", TOP_RUNG)
    return _panel(curve, "rungs", [_line(curve, rung, rig, "consistent", rung) for rung in shown])


def _fitted(curve: Curve, rig: RigProperties) -> Panel:
    return _panel(curve, "fitted", [_line(curve, "fitted rig", rig, "consistent", TOP_RUNG)])


def paper_rig(mu: float, resonance_hz: float) -> RigProperties:
    """Return the paper's rig with friction at rest and resonance as measured."""
    return RigProperties(friction_coefficient=mu, resonance_hz=resonance_hz)
