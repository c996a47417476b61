"""What a drawing of curves consists of, before it is drawn: panels with their series."""

from collections.abc import Sequence
from dataclasses import dataclass

from device.mode_shapes import FloatArray


@dataclass(frozen=True, kw_only=True)
class Series:
    """One curve, or with `marked` a set of points each of which may bear a name."""

    label: str
    x: FloatArray
    y: FloatArray
    marked: bool = False
    names: Sequence[str] = ()


@dataclass(frozen=True, kw_only=True)
class Panel:
    """One pair of axes."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    logarithmic_x: bool = False
