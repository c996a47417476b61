"""Recordings of touches as forces in newtons: averages of short blocks, on the session's clock."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from analysis.estimates import BoolArray, FloatArray, NotEstimable
from protocol.journal.records import FULL_SCALE, LIFTED_N, DamagedSamplesError, Recording

BLOCK_S = 0.025
"""Length of a block: one millimetre of the paper's path, and as long as what counts in friction
(20 ms: Monnoyer et al. 2023)."""
TARE_S = 0.5
"""How long the sensors' zero is measured before a touch."""
WINDOW_BLOCKS = 4
"""Blocks over which stick-slip is told from what changes slowly."""
LEAST_BLOCKS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class TouchForces:
    """Forces and place while the finger moved, each a mean over a block; zero offsets taken off.

    Parameters:
        t_s: shape (blocks,), middle of each block after the movement began.
        position_m: shape (blocks,), right edge of the finger.
        tangential_n, normal_n: shape (blocks,).
        vector_n: shape (blocks,), amplitude of the vector of both forces.
        block_s: length of a block.
        moved_s: how long the finger moved, as planned.
        noise_n2: variance that the sensor's noise gives a block's tangential force.
        tare_n2: variance of the tangential zero.
        zero_n: the zero that was taken off, None if it was not measured.
        zero_s: when the zero was measured, on the session's clock.
        touched_s: the middle of the touch on that clock.
        stick_slip: SD of the tangential force within a tenth of a second, about its trend there
            and without the sensor's noise, over its mean.
        saturated: samples at a sensor's limit.
    """

    t_s: FloatArray
    position_m: FloatArray
    tangential_n: FloatArray
    normal_n: FloatArray
    vector_n: FloatArray
    block_s: float
    moved_s: float
    noise_n2: float
    tare_n2: float
    zero_n: float | None
    zero_s: float
    touched_s: float
    stick_slip: float
    saturated: int

    @property
    def friction(self) -> FloatArray:
        """Logarithm of the friction coefficient, ln(tangential / normal), by block."""
        return np.asarray(np.log(self.tangential_n / self.normal_n))

    @property
    def noise(self) -> FloatArray:
        """Variance that the sensor's noise gives `friction`, by block."""
        return np.asarray(self.noise_n2 / self.tangential_n**2)

    @property
    def tare(self) -> FloatArray:
        """What a tangential zero one SD too low adds to `friction`, by block."""
        return np.asarray(np.sqrt(self.tare_n2) / self.tangential_n)

    def with_drift(self, drift_n_per_s: float) -> "TouchForces":
        """Return the forces if the zero has drifted since it was measured."""
        moved_n = drift_n_per_s * (self.touched_s + self.t_s - self.moved_s / 2 - self.zero_s)
        tangential_n = self.tangential_n - moved_n
        if (tangential_n <= 0).any():
            return self
        return replace(self, tangential_n=tangential_n)


def reduced(recording: Recording) -> TouchForces | NotEstimable:
    """Return the forces of a recording while the finger moved, or why they say nothing.

    A block counts if the finger was on the beam, both forces were positive and no sensor was at
    its limit.
    """
    try:
        counts = np.frombuffer(recording.counts(), "<i2").reshape(3, recording.count)
    except DamagedSamplesError as error:
        return NotEstimable(str(error))
    size = max(round(BLOCK_S * recording.rate_hz), 1)
    t_s = (
        recording.first_s
        + recording.clock_offset_s
        + np.arange(recording.count) / (recording.rate_hz)
    )
    began_s, over_s = recording.moved_s
    moving = slice(*np.searchsorted(t_s, [began_s, over_s]))
    length = (moving.stop - moving.start) // size * size
    chosen = slice(moving.start, moving.start + length)
    if length < LEAST_BLOCKS * size:
        return NotEstimable("the finger moved for less than 0.2 s of the recording")
    own = counts[:, chosen].astype(np.float64)
    at_limit = np.abs(own[:2]).max(axis=0) >= FULL_SCALE
    zero = (0.0, 0.0) if recording.tare_n is None else recording.tare_n
    tangential_n, normal_n, position_m = own * np.array(recording.scale)[:, None]
    tangential_n, normal_n = tangential_n - zero[0], normal_n - zero[1]
    noise_n2 = float(np.mean(np.diff(tangential_n) ** 2)) / 2

    def averaged(values: FloatArray) -> FloatArray:
        return np.asarray(values.reshape(-1, size).mean(axis=1))

    means = {
        "position_m": averaged(position_m),
        "tangential_n": averaged(tangential_n),
        "normal_n": averaged(normal_n),
        "vector_n": averaged(np.hypot(tangential_n, normal_n)),
    }
    counted = (
        (means["normal_n"] > LIFTED_N)
        & (means["tangential_n"] > 0)
        & ~at_limit.reshape(-1, size).any(axis=1)
    )
    if counted.sum() < max(LEAST_BLOCKS, len(counted) / 2):
        return NotEstimable(_why_not(means["normal_n"], at_limit))
    return TouchForces(
        t_s=(averaged(t_s[chosen]) - began_s)[counted],
        **{name: values[counted] for name, values in means.items()},
        block_s=size / recording.rate_hz,
        moved_s=over_s - began_s,
        noise_n2=noise_n2 / size,
        tare_n2=noise_n2 / (TARE_S * recording.rate_hz),
        zero_n=None if recording.tare_n is None else zero[0],
        zero_s=float(t_s[0]) - TARE_S / 2,
        touched_s=(began_s + over_s) / 2,
        stick_slip=_stick_slip(tangential_n, size, counted, noise_n2),
        saturated=recording.saturated,
    )


def _why_not(normal_n: FloatArray, at_limit: BoolArray) -> str:
    if (normal_n <= LIFTED_N).sum() > len(normal_n) / 2:
        return "no finger was on the beam"
    if at_limit.mean() > 0.1:
        return "a sensor was at its limit"
    return "the tangential force was not positive"


def _stick_slip(tangential_n: FloatArray, size: int, counted: BoolArray, noise_n2: float) -> float:
    """Return the SD within windows about a straight line, without the noise, over the mean."""
    long, whole = size * WINDOW_BLOCKS, len(counted) // WINDOW_BLOCKS
    windows = tangential_n[: whole * long].reshape(whole, long)
    windows = windows[counted[: whole * WINDOW_BLOCKS].reshape(whole, -1).all(axis=1)]
    if long < 8 or not len(windows):
        return np.nan
    time = np.arange(long) - (long - 1) / 2
    away = windows - windows.mean(axis=1, keepdims=True)
    away -= np.outer(away @ time, time) / (time @ time)
    variance = (away**2).sum(axis=1) / (long - 2)
    return float(np.sqrt(max(variance.mean() - noise_n2, 0.0)) / windows.mean())


def zero_drift_n_per_s(touches: list[TouchForces]) -> float:
    """Return how fast the tangential zero drifts: the median over neighbouring touches.

    0 with fewer than four zeros. Touches an hour apart, or of clocks that began anew, tell nothing.
    """
    zeros = [(each.zero_s, each.zero_n) for each in touches if each.zero_n is not None]
    rates = [
        (zero - before) / (at - earlier)
        for (earlier, before), (at, zero) in pairwise(zeros)
        if 0 < at - earlier < 600
    ]
    return float(np.median(rates)) if len(rates) >= 3 else 0.0
