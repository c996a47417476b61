"""The ladder's rungs: fields of motion from the paper's piecewise-linear pattern to the whole beam.

| rung | the beam's motion |
|---|---|
| `eq15` | the paper's pattern under the finger, on its own beam alone |
| `mode` | one mode of the bare Euler-Bernoulli beam, as the paper has it |
| `own-mode` | one mode of the beam as it is built, with patches and shear |
| `beam` | all of them |
"""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from device.arrays import FloatArray, IndexArray
from device.beam.beam import Beam
from device.beam.driven import Fineness
from device.beam.eq15 import Eq15Pattern, Overlap, require_the_papers
from device.beam.fields import Field, driven_fields, mode_field, mode_share
from device.beam.spectral import natural_frequency_hz
from device.errors import OutOfRangeError
from device.friction.fineness import DEFAULT
from device.friction.scenes import REFERENCE_SPEED_M_S, REFERENCE_TIP_SPEED_M_S, Drive

RUNG_NAMES = ("eq15", "mode", "own-mode", "beam")
TOP_RUNG = "beam"
_AS_PRINTED = ("eq15", "mode")
"""The rungs without patches and shear, as the paper has them."""
_FORMER: Mapping[str, str] = MappingProxyType(
    {"timoshenko-patched": "beam", "timoshenko-modes": "beam", "auto": "beam"}
)
"""Names of version 1, which older studies and scripts have."""
_LEFT: Mapping[str, str] = MappingProxyType(
    {"far-field": "mode", "euler-patched": "beam", "timoshenko": "beam"}
)

REFERENCE_RATIO = 0.98292153
"""Tip speed over sliding speed at which η is ½ on `own-mode` and `beam`: a constant of the skin, so
the same for every beam. It follows from the paper's scene."""
LEAST_SHARE = 0.9
"""A mode with a smaller share of the motion does not stand for all of it."""


def rung_named(name: str) -> str:
    """Return the rung of that name, of version 1 too, or raise `OutOfRangeError`."""
    name = _FORMER.get(name, name)
    if name in RUNG_NAMES:
        return name
    rule = f"must be one of {', '.join(RUNG_NAMES)}"
    instead = _LEFT.get(name, "beam" if name.startswith("modes:") else "")
    if instead:
        rule += f"; take {instead}"
    raise OutOfRangeError("rung", rule, repr(name))


def present_name(name: str) -> str:
    """Return the name that a rung has now; that of one that has left stays."""
    with suppress(OutOfRangeError):
        return rung_named(name)
    return name


def rung_resonance_hz(name: str, beam: Beam, mode: int) -> float:
    """Return the natural frequency of `mode` as the rung of that name computes it, Hz."""
    built = rung_named(name) not in _AS_PRINTED
    return natural_frequency_hz(beam, mode, patched=built, shear=built)


def reference_tip_speed_m_s(name: str) -> float:
    """Return the tip speed at which η is ½ for a finger at the reference speed."""
    if rung_named(name) in _AS_PRINTED:
        return REFERENCE_TIP_SPEED_M_S
    return REFERENCE_RATIO * REFERENCE_SPEED_M_S


@lru_cache(maxsize=256)
def _require_share(beam: Beam, mode: int) -> None:
    share = mode_share(beam, mode)
    if share < LEAST_SHARE:
        rule = (
            f"must be that of a mode with {LEAST_SHARE:g} or more of the motion on the rung "
            f"own-mode; mode {mode} has {share:.2g} of it; take beam"
        )
        raise OutOfRangeError("rung", rule, "'own-mode'")


def rung_fields(
    name: str,
    beam: Beam,
    mode: int,
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    *,
    overlap: Overlap = "first",
    fineness: Fineness = DEFAULT,
) -> Iterator[tuple[IndexArray, Field]]:
    """Yield parts of the drives, both of shape (drives,), with their fields per volt.

    A frequency of NaN is the rung's resonance. `overlap` is for `eq15`, `fineness` for `beam`.
    Raise `OutOfRangeError` for no such rung, a mode or a drive above the cut-off, and a rung that
    the beam does not allow.
    """
    rung = rung_named(name)
    resonant = np.isnan(frequency_hz)
    if resonant.any():
        frequency_hz = np.where(resonant, rung_resonance_hz(rung, beam, mode), frequency_hz)
    if rung == "beam":
        yield from driven_fields(beam, frequency_hz, damping_ratio, fineness)
        return
    if rung == "own-mode":
        _require_share(beam, mode)
    field = mode_field(beam, mode, frequency_hz, damping_ratio, built=rung == "own-mode")
    if rung == "eq15":
        require_the_papers(beam)
        pattern = Eq15Pattern(mode=mode, length_m=beam.length_m, overlap=overlap)
        field = Field(**{**vars(field), "pattern": pattern})
    yield np.arange(frequency_hz.size), field


@lru_cache(maxsize=256)
def rung_field(
    name: str, beam: Beam, drive: Drive, overlap: Overlap = "first", fineness: Fineness = DEFAULT
) -> Field:
    """Return the field of one drive as the rung of that name computes it; see `rung_fields`."""
    frequency_hz = np.nan if isinstance(drive.frequency_hz, str) else drive.frequency_hz
    drives = np.array([frequency_hz]), np.array([beam.damping_ratio])
    ((_, field),) = rung_fields(name, beam, drive.mode, *drives, overlap=overlap, fineness=fineness)
    return field.scaled(np.array([drive.voltage_v]))
