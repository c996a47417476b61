"""The ladder's rungs, from the paper's piecewise-linear pattern up: each gives a field of the beam.

Only the rungs that need it load the solver of the segmented beam: most predictions use one mode.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from device.beam.beam import Beam
from device.beam.eq15 import Overlap
from device.beam.fields import Eq15Pattern, Field, ModePattern, Signal, SinusoidPattern, modal_field
from device.beam.modes import FloatArray, IndexArray, natural_frequency_hz
from device.beam.windows import Pattern
from device.errors import OutOfRangeError
from device.friction.scenes import Drive

if TYPE_CHECKING:
    from device.beam.motion import MotionPattern

TOP_RUNG = "timoshenko-patched"
REDUCED_RUNG = "timoshenko-modes"
"""The top rung's own modes: cheap where many drives differ."""
MODAL_RUNGS = ("eq15", "far-field", "mode")
SEGMENTED_RUNGS: Mapping[str, tuple[bool, bool]] = MappingProxyType(
    {
        "euler-patched": (True, False),
        "timoshenko": (False, True),
        REDUCED_RUNG: (True, True),
        TOP_RUNG: (True, True),
    }
)
"""The rungs of the segmented beam: whether its patches' stiffness and mass count, and shear."""
HIGHEST_MODE = 999
"""The highest mode that `modes:N` can add up: N has at most three digits."""
_LOWEST_SUM = Drive().mode
"""The reference scene's mode: a sum without it has no reference tip speed."""
RUNG_NAMES = (*MODAL_RUNGS, "modes:N", *SEGMENTED_RUNGS)


def require_rung(name: str) -> None:
    """Raise `OutOfRangeError` unless it is one of `RUNG_NAMES` (`modes:12`: a sum of twelve)."""
    if not (name in MODAL_RUNGS or name in SEGMENTED_RUNGS or _summed(name)):
        names = ", ".join(RUNG_NAMES).replace(":N", f":N (N from {_LOWEST_SUM} to {HIGHEST_MODE})")
        raise OutOfRangeError("rung", f"must be one of {names}", repr(name))


def _summed(name: str) -> int:
    """Return how many modes of the bare beam the rung adds up, 0 if it is no such sum."""
    found = re.fullmatch(r"modes:([1-9]\d{0,2})", name)
    return int(found[1]) if found and int(found[1]) >= _LOWEST_SUM else 0


def rung_resonance_hz(name: str, beam: Beam, mode: int) -> float:
    """Return the natural frequency of `mode` as the rung of that name computes it, Hz."""
    require_rung(name)
    if name not in SEGMENTED_RUNGS:
        return natural_frequency_hz(beam, mode)
    from device.beam.timoshenko import segmented_natural_frequency_hz

    patched, shear = SEGMENTED_RUNGS[name]
    return segmented_natural_frequency_hz(beam, mode, patched=patched, shear=shear)


@lru_cache(maxsize=64)
def rung_field(name: str, beam: Beam, drive: Drive, overlap: Overlap = "first") -> Field:
    """Return the driven beam's motion as the rung of that name computes it.

    A drive at `resonance` is at the rung's own; `overlap` is for `eq15`. Raise `OutOfRangeError`
    for no such rung, or a mode beyond its cut-off or its sum.
    """
    require_rung(name)
    frequency_hz = None if isinstance(drive.frequency_hz, str) else drive.frequency_hz
    if name in MODAL_RUNGS:
        signal = Signal(voltage_v=drive.voltage_v, frequency_hz=frequency_hz)
        return modal_rung_field(name, beam, drive.mode, signal, overlap)
    if 0 < (count := _summed(name)) < drive.mode:
        rule = f"must be at most {count} on the rung modes:{count}; take modes:{drive.mode}"
        raise OutOfRangeError("mode", rule, drive.mode)
    frequency_hz = frequency_hz or rung_resonance_hz(name, beam, drive.mode)
    return _solved_field(name, beam, frequency_hz).scaled(np.asarray(drive.voltage_v))


def modal_rung_field(
    name: str, beam: Beam, mode: int, signal: Signal, overlap: Overlap = "first"
) -> Field:
    """Return the field of `eq15`, `far-field` or `mode`, for one signal or an array of them."""
    length_m = beam.length_m
    patterns: Mapping[str, Pattern] = {
        "eq15": Eq15Pattern(mode=mode, length_m=length_m, overlap=overlap),
        "far-field": SinusoidPattern(mode=mode, length_m=length_m),
        "mode": ModePattern(mode=mode, length_m=length_m),
    }
    return modal_field(beam, mode, patterns[name], signal)


def _solved_field(name: str, beam: Beam, frequency_hz: float) -> Field:
    """Return the field per volt of a rung that solves the beam or adds up many modes."""
    if name == REDUCED_RUNG:
        all_places, damping = np.zeros(1, dtype=np.intp), np.array([beam.damping_ratio])
        field = modal_sum_field(beam, all_places, np.array([frequency_hz]), damping)
        rms, rotation = field.displacement_m[0], field.rotation[0]
        return replace(
            field, frequency_hz=np.asarray(frequency_hz), displacement_m=rms, rotation=rotation
        )
    if count := _summed(name):
        pattern = _modal_pattern(beam, frequency_hz, count)
    else:
        patched, shear = SEGMENTED_RUNGS[name]
        pattern = _segmented_pattern(beam, frequency_hz, patched=patched, shear=shear)
    return Field(
        pattern=pattern,
        frequency_hz=np.asarray(frequency_hz),
        displacement_m=np.asarray(pattern.rms_m_per_v),
        rotation=np.asarray(pattern.rotation_per_v),
    )


@lru_cache(maxsize=4096)
def _segmented_pattern(
    beam: Beam, frequency_hz: float, *, patched: bool, shear: bool
) -> "MotionPattern":
    from device.beam.motion import motion_pattern, segmented_motion

    return motion_pattern(segmented_motion(beam, frequency_hz, patched=patched, shear=shear))


@lru_cache(maxsize=256)
def _modal_pattern(beam: Beam, frequency_hz: float, count: int) -> "MotionPattern":
    from device.beam.motion import modal_motion, motion_pattern

    return motion_pattern(modal_motion(beam, frequency_hz, count))


def modal_sum_field(
    beam: Beam,
    drive: IndexArray,
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    direction_error: FloatArray | float = 0.0,
) -> Field:
    """Return `device.beam.modal_pattern.modal_sum_field`; `OutOfRangeError` beyond its modes."""
    from device.beam import modal_pattern
    from device.beam.timoshenko_modes import modal_basis

    highest_hz = modal_basis(beam).highest_hz * beam.frequency_scale
    if frequency_hz.max() > highest_hz:
        rule = f"must be at most {highest_hz:.0f} on the rung {REDUCED_RUNG}; take {TOP_RUNG}"
        raise OutOfRangeError("frequency_hz", rule, float(frequency_hz.max()))
    return modal_pattern.modal_sum_field(
        beam, drive, frequency_hz, damping_ratio, direction_error=direction_error
    )


@lru_cache(maxsize=32)
def reference_tip_speed_m_s(name: str) -> float:
    """Return a rung's tip speed of a 1 mm body in the paper's scene at the rung's resonance."""
    beam = Beam()
    field = rung_field(name, beam, Drive())
    return float(field.tip_speed_m_s(beam.thickness_m / 2 + 1e-3))


def forget_set_ups() -> None:
    """Clear all cached set-ups, so that their cost can be measured again."""
    from device.beam.timoshenko import segmented_natural_frequency_hz
    from device.beam.timoshenko_modes import modal_basis

    rung_field.cache_clear()
    _segmented_pattern.cache_clear()
    _modal_pattern.cache_clear()
    modal_basis.cache_clear()
    segmented_natural_frequency_hz.cache_clear()
