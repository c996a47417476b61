"""Passes of a block along the beam, and their friction by place.

Half millimetres are narrow beside the block and wide beside the noise of the position sensor.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from analysis.estimates import FloatArray
from device.friction.scenes import Direction

BIN_M = 0.5e-3
_LEAST_SHARE = 0.5
"""Bins at the ends of the path with fewer samples than this share of the median are left out."""
_SAME_SPEED = 1.2
"""Passes of which none is faster than this multiple of the slowest share a curve: no hand is
steadier."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pass:
    """One drawing of the block along the beam, while it moved.

    Attributes:
        voltage_v: amplitude of the drive, 0 with the output off.
        frequency_hz: of the drive.
        direction: of the block.
        load_n: weight of the block.
        contact_m: length of beam under the block.
        t_s: time of each sample, shape (n,), rising, s.
        x_m: right edge of the block at each sample, m.
        mu: tangential over normal force at each sample, after the tare.
    """

    voltage_v: float
    frequency_hz: float
    direction: Direction
    load_n: float
    contact_m: float
    t_s: FloatArray
    x_m: FloatArray
    mu: FloatArray


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What passes have in common: drive, direction, load, contact and speed.

    `speed_m_s` is measured: the slope of place against time.
    """

    voltage_v: float
    frequency_hz: float
    direction: Direction
    load_n: float
    contact_m: float
    speed_m_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """A pass by place: means over bins of half a millimetre, each of shape (bins,).

    Attributes:
        setting: drive, direction, load, contact and speed.
        bin: number of each bin, counted from the clamp.
        x_m: mean place of the samples in the bin.
        t_s: mean time of the samples, from the beginning of the pass.
        mu: mean friction coefficient.
        count: number of samples.
        spacing_s: time between two samples.
        spread_m: standard deviation of the block's true places in one bin: the bin's width, and
            the noise of the position sensor.
    """

    setting: Setting
    bin: FloatArray
    x_m: FloatArray
    t_s: FloatArray
    mu: FloatArray
    count: FloatArray
    spacing_s: float
    spread_m: float


def course(made: Pass) -> Course:
    """Return a pass by place.

    Raises:
        ValueError: it has fewer than two samples, or the block did not move.
    """
    if made.x_m.size < 2 or np.ptp(made.x_m) < 2 * BIN_M:
        raise ValueError(f"a pass must move by more than 1 mm, got {made.x_m.size} samples")
    number = np.floor(made.x_m / BIN_M).astype(np.intp)
    count = np.bincount(number).astype(np.float64)
    kept = np.flatnonzero(count >= max(1.0, _LEAST_SHARE * float(np.median(count[count > 0]))))
    t_s = made.t_s - made.t_s[0]
    x_m, time_s, mu = (
        np.bincount(number, weights=values)[kept] / count[kept]
        for values in (made.x_m, t_s, made.mu)
    )
    setting = Setting(
        voltage_v=made.voltage_v,
        frequency_hz=made.frequency_hz,
        direction=made.direction,
        load_n=made.load_n,
        contact_m=made.contact_m,
        speed_m_s=abs(float(np.polyfit(t_s, made.x_m, 1)[0])),
    )
    return Course(
        setting=setting,
        bin=kept.astype(np.float64),
        x_m=x_m,
        t_s=time_s,
        mu=mu,
        count=count[kept],
        spacing_s=float(t_s[-1]) / (made.t_s.size - 1),
        # No block shakes by a tenth of a millimetre in a millisecond: that is the sensor's noise.
        spread_m=float(np.sqrt(BIN_M**2 / 12 + np.var(np.diff(made.x_m, 2)) / 6)),
    )


Group: TypeAlias = tuple[Setting, tuple[Course, ...]]


def grouped(courses: Iterable[Course]) -> list[Group]:
    """Return repeated passes together, each group with the setting of its slowest pass."""

    def key(one: Course) -> tuple[float | str, ...]:
        own = one.setting
        return own.voltage_v, own.frequency_hz, own.direction, own.load_n, own.contact_m

    groups: list[list[Course]] = []
    for one in sorted(courses, key=lambda one: (*key(one), one.setting.speed_m_s)):
        first = groups[-1][0] if groups else None
        if first is not None and key(first) == key(one) and _alike(first, one):
            groups[-1].append(one)
        else:
            groups.append([one])
    return [(group[0].setting, tuple(group)) for group in groups]


def _alike(slow: Course, fast: Course) -> bool:
    return fast.setting.speed_m_s <= _SAME_SPEED * slow.setting.speed_m_s


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """Friction by place over repeated passes, shape (places,), with its standard error."""

    setting: Setting
    passes: int
    x_m: FloatArray
    mu: FloatArray
    error: FloatArray


def mean_curve(group: Group, variances: Sequence[FloatArray]) -> Curve:
    """Return the mean of repeated passes, each bin weighted by the inverse of its variance.

    `variances` are those of the bins of each pass.
    """
    setting, courses = group
    number = np.concatenate([one.bin for one in courses])
    weight = 1 / np.concatenate(list(variances))
    place = np.unique(number, return_inverse=True)[1]
    total = np.bincount(place, weights=weight)
    x_m, mu = (
        np.bincount(place, weights=weight * np.concatenate([getattr(one, name) for one in courses]))
        / total
        for name in ("x_m", "mu")
    )
    return Curve(
        setting=setting, passes=len(courses), x_m=x_m, mu=mu, error=np.asarray(total**-0.5)
    )
