"""The ladder's rungs, from the paper's piecewise-linear pattern up: each gives a field of the beam.

Only the rungs that need it load the solver of the segmented beam: most predictions use one mode.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from device.beam.beam import Beam
from device.beam.eq15 import Overlap
from device.beam.fields import Eq15Pattern, Field, ModePattern, Signal, SinusoidPattern, modal_field
from device.beam.modes import FloatArray, natural_frequency_hz
from device.beam.windows import Pattern
from device.errors import OutOfRangeError
from device.friction.scenes import Drive

if TYPE_CHECKING:
    from device.beam.motion import MotionPattern


@dataclass(frozen=True, kw_only=True)
class Rung:
    """A rung: the driven beam's motion as it computes it, and a mode's natural frequency, Hz."""

    field_of: Callable[[Beam, Drive, Overlap], Field]
    resonance_hz: Callable[[Beam, int], float] = natural_frequency_hz


def _frequency_hz(drive: Drive) -> float | None:
    """Return the drive's frequency, or None for the rung's own resonance."""
    return None if isinstance(drive.frequency_hz, str) else drive.frequency_hz


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


def _driven(pattern: "MotionPattern", frequency_hz: float, voltage_v: float) -> Field:
    return Field(
        pattern=pattern,
        frequency_hz=np.asarray(frequency_hz),
        displacement_m=np.asarray(pattern.rms_m_per_v * voltage_v),
        rotation=np.asarray(pattern.rotation_per_v * voltage_v),
    )


def _modal(name: str) -> Rung:

    def field_of(beam: Beam, drive: Drive, overlap: Overlap) -> Field:
        signal = Signal(voltage_v=drive.voltage_v, frequency_hz=_frequency_hz(drive))
        return modal_rung_field(name, beam, drive.mode, signal, overlap)

    return Rung(field_of=field_of)


def _segmented(*, patched: bool, shear: bool) -> Rung:
    def resonance_hz(beam: Beam, mode: int) -> float:
        from device.beam.timoshenko import segmented_natural_frequency_hz

        return segmented_natural_frequency_hz(beam, mode, patched=patched, shear=shear)

    def field_of(beam: Beam, drive: Drive, _: Overlap) -> Field:
        frequency_hz = _frequency_hz(drive) or resonance_hz(beam, drive.mode)
        pattern = _segmented_pattern(beam, frequency_hz, patched=patched, shear=shear)
        return _driven(pattern, frequency_hz, drive.voltage_v)

    return Rung(field_of=field_of, resonance_hz=resonance_hz)


def _modes(count: int) -> Rung:
    """Return the rung that adds up the first `count` modes of the bare beam."""

    def field_of(beam: Beam, drive: Drive, _: Overlap) -> Field:
        if drive.mode > count:
            rule = f"must be at most {count} on the rung modes:{count}; take modes:{drive.mode}"
            raise OutOfRangeError("mode", rule, drive.mode)
        frequency_hz = _frequency_hz(drive) or natural_frequency_hz(beam, drive.mode)
        return _driven(_modal_pattern(beam, frequency_hz, count), frequency_hz, drive.voltage_v)

    return Rung(field_of=field_of)


def modal_sum_field(
    beam: Beam,
    drive: NDArray[np.intp],
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


def _reduced() -> Rung:
    """Return the rung that sums modes of the patched Timoshenko beam."""
    solved = _segmented(patched=True, shear=True)

    def field_of(beam: Beam, drive: Drive, _: Overlap) -> Field:
        frequency_hz = _frequency_hz(drive) or solved.resonance_hz(beam, drive.mode)
        all_places = np.zeros(1, dtype=np.intp)
        damping = np.array([beam.damping_ratio])
        field = modal_sum_field(beam, all_places, np.array([frequency_hz]), damping)
        return Field(
            pattern=field.pattern,
            frequency_hz=np.asarray(frequency_hz),
            displacement_m=field.displacement_m[0] * np.asarray(drive.voltage_v),
            rotation=field.rotation[0] * np.asarray(drive.voltage_v),
        )

    return Rung(field_of=field_of, resonance_hz=solved.resonance_hz)


def forget_set_ups() -> None:
    """Clear all cached set-ups, so that their cost can be measured again."""
    from device.beam.timoshenko import segmented_natural_frequency_hz
    from device.beam.timoshenko_modes import modal_basis

    rung_field.cache_clear()
    _segmented_pattern.cache_clear()
    _modal_pattern.cache_clear()
    modal_basis.cache_clear()
    segmented_natural_frequency_hz.cache_clear()


TOP_RUNG = "timoshenko-patched"
REDUCED_RUNG = "timoshenko-modes"
"""The top rung's own modes: cheap where many drives differ."""
MODAL_RUNGS = ("eq15", "far-field", "mode")
SEGMENTED_RUNGS: Mapping[str, Rung] = MappingProxyType(
    {
        "euler-patched": _segmented(patched=True, shear=False),
        "timoshenko": _segmented(patched=False, shear=True),
        REDUCED_RUNG: _reduced(),
        TOP_RUNG: _segmented(patched=True, shear=True),
    }
)
HIGHEST_MODE = 999
"""The highest mode that `modes:N` can add up: N has at most three digits."""
_LOWEST_SUM = Drive().mode
"""The reference scene's mode: a sum without it has no reference tip speed."""
RUNG_NAMES = (*MODAL_RUNGS, "modes:N", *SEGMENTED_RUNGS)
_RUNGS = {**{name: _modal(name) for name in MODAL_RUNGS}, **SEGMENTED_RUNGS}


def rung_by_name(name: str) -> Rung:
    """Return one of `RUNG_NAMES` (`modes:12`: a sum of twelve), or raise `OutOfRangeError`."""
    if name in _RUNGS:
        return _RUNGS[name]
    found = re.fullmatch(r"modes:([1-9]\d{0,2})", name)
    if found and int(found[1]) >= _LOWEST_SUM:
        return _modes(int(found[1]))
    names = ", ".join(RUNG_NAMES).replace(":N", f":N (N from {_LOWEST_SUM} to {HIGHEST_MODE})")
    raise OutOfRangeError("rung", f"must be one of {names}", repr(name))


@lru_cache(maxsize=64)
def rung_field(name: str, beam: Beam, drive: Drive, overlap: Overlap = "first") -> Field:
    """Return the driven beam's motion as the rung of that name computes it.

    A drive at `resonance` is at the rung's own; `overlap` is for `eq15`. Raise `OutOfRangeError`
    for no such rung, or a mode beyond its cut-off or its sum.
    """
    return rung_by_name(name).field_of(beam, drive, overlap)


def rung_resonance_hz(name: str, beam: Beam, mode: int) -> float:
    """Return the natural frequency of `mode` as the rung of that name computes it, Hz."""
    return rung_by_name(name).resonance_hz(beam, mode)


@lru_cache(maxsize=32)
def reference_tip_speed_m_s(name: str) -> float:
    """Return a rung's tip speed of a 1 mm body in the paper's scene at the rung's resonance."""
    beam = Beam()
    field = rung_field(name, beam, Drive())
    return float(field.tip_speed_m_s(beam.thickness_m / 2 + 1e-3))
