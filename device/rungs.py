"""The ladder's rungs: from the paper's piecewise-linear pattern up, each a field of the beam."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from types import MappingProxyType

from device.beam import Beam
from device.eq15 import Overlap
from device.fields import Field, Signal, modal_field
from device.patterns import Eq15Pattern, ModePattern, Pattern, SinusoidPattern
from device.ranges import OutOfRangeError
from device.scenes import Drive

FieldOf = Callable[[Beam, Drive], Field]


def _frequency_hz(drive: Drive) -> float | None:
    """The drive's frequency, or None where it is the rung's own resonance."""
    return None if isinstance(drive.frequency_hz, str) else drive.frequency_hz


def _pattern(name: str, beam: Beam, mode: int, overlap: Overlap = "first") -> Pattern:
    """The pattern of a rung that knows one mode of the bare beam."""
    if name == "mode":
        return ModePattern(mode=mode, length_m=beam.length_m)
    far_field = SinusoidPattern(mode=mode, length_m=beam.length_m)
    return far_field if name == "far-field" else Eq15Pattern(far_field=far_field, overlap=overlap)


def _modal(name: str) -> FieldOf:
    """The field of a rung that knows one mode of the bare beam."""

    def field_of(beam: Beam, drive: Drive) -> Field:
        return modal_field(
            beam,
            drive.mode,
            _pattern(name, beam, drive.mode),
            Signal(voltage_v=drive.voltage_v, frequency_hz=_frequency_hz(drive)),
        )

    return field_of


RUNGS: Mapping[str, FieldOf] = MappingProxyType(
    {name: _modal(name) for name in ("eq15", "far-field", "mode")}
)


def rung_by_name(name: str) -> FieldOf:
    """The field of the rung of that name.

    Raises:
        OutOfRangeError: there is no such rung.
    """
    if name not in RUNGS:
        raise OutOfRangeError("rung", f"must be one of {', '.join(RUNGS)}", repr(name))
    return RUNGS[name]


@lru_cache(maxsize=32)
def reference_tip_speed_m_s(name: str) -> float:
    """The tip speed of a 1 mm body that a rung gives in the paper's scene at its own resonance."""
    beam = Beam()
    field = rung_by_name(name)(beam, Drive())
    return float(field.tip_speed_m_s(beam.thickness_m / 2 + 1e-3))
