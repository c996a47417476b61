"""The board's force channel: it samples what the finger feels, with noise, drift and a gain.

Noise depends on seed, recording and sample number alone, so that asking again changes nothing.
"""

from array import array
from functools import lru_cache

import numpy as np

from device.beam.modes import FloatArray
from device.force_channel.blocks import Block
from device.force_channel.samples import FULL_SCALE, Scale, most_in_block
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.power_stage import Instrument

RATE_RANGE_HZ = (50.0, 1_000.0)
SCALE: Scale = (2.5e-4, 2.5e-4, 5e-6)
BUFFER_S = 2.0
_TURN_S = 900.0
"""Zero drift turns round after so long, or a day would fill the sensor's range."""
_CHUNK = 256
_STREAMS = 4
"""Noise of the three channels, and what drives the jitter."""
_TANGENTIAL, _NORMAL = 0, 1


class ForceSampler:
    """The samples of a recording: taken as time passes, kept for `BUFFER_S`, given as blocks."""

    def __init__(self, beam: SimulatedBeam) -> None:
        self._beam = beam
        self.rate_hz = RATE_RANGE_HZ[1]
        self.on = False
        self._recording = 0
        self._first_s = 0.0
        self._taken = 0
        self._kept: array[int] = array("h")

    def switch(self, on: bool, instrument: Instrument) -> None:
        """Start anew at sample 0, or stop; what is kept stays."""
        if on:
            self._recording += 1
            self._first_s, self._taken, self._kept = instrument.time_s, 0, array("h")
        self.on = on

    def restart(self) -> None:
        """Lose power: nothing is on, and nothing is kept."""
        self.on, self.rate_hz = False, RATE_RANGE_HZ[1]
        self._kept, self._taken = array("h"), 0

    def take_until(self, time_s: float, instrument: Instrument) -> None:
        """Take the samples up to a device time, to which `instrument` has not moved yet."""
        if not self.on:
            return
        end = int((time_s - self._first_s) * self.rate_hz + 1e-9) + 1
        begin = max(self._taken, end - round(BUFFER_S * self.rate_hz))
        if end <= self._taken:
            return
        if begin > self._taken:
            self._kept = array("h")
        self._kept.extend(self._counts(begin, end, instrument))
        self._taken = end
        most = 3 * round(BUFFER_S * self.rate_hz)
        del self._kept[: max(len(self._kept) - most, 0)]

    def lose(self) -> None:
        """Forget what is kept, as a board that is too slow, and at least one sample."""
        self._kept, self._taken = array("h"), self._taken + 1

    def block(self, first: int) -> Block:
        """Return the samples from number `first` on, or from the oldest that is still kept."""
        oldest = self._taken - len(self._kept) // 3
        begin = min(max(first, oldest), self._taken)
        place = 3 * (begin - oldest)
        return Block(
            first=begin,
            first_s=self._first_s + begin / self.rate_hz,
            counts=self._kept[place : place + 3 * most_in_block(self.rate_hz)],
            lost=begin > first,
        )

    def _counts(self, begin: int, end: int, instrument: Instrument) -> "array[int]":
        numbers = np.arange(begin, end)
        times_s = self._first_s + numbers / self.rate_hz
        sensor = self._beam.sensor
        noise = self._noise(begin, end)
        values = self._beam.forces(times_s, instrument)
        values[_TANGENTIAL] *= np.exp(sensor.jitter * noise[3])
        gains = (sensor.tangential_gain, sensor.normal_gain, 1.0)
        sizes = (sensor.tangential_noise_n, sensor.normal_noise_n, sensor.position_noise_m)
        drift_n = self._drift_n(times_s)
        shifts = (drift_n, drift_n, np.zeros_like(drift_n))
        rows = [
            np.rint((gain * value + shift + size * white) / count)
            for gain, value, shift, size, white, count in zip(
                gains, values, shifts, sizes, noise, SCALE, strict=False
            )
        ]
        if self._beam.is_saturated:
            rows[_TANGENTIAL] = np.full(end - begin, FULL_SCALE)
        counts = np.clip(np.stack(rows, axis=1), -FULL_SCALE, FULL_SCALE)
        return array("h", counts.astype(np.int16).tobytes())

    def _drift_n(self, times_s: FloatArray) -> FloatArray:
        """Return the zero of the force sensors: a triangle, whose period is four turns."""
        phase = np.mod(times_s + _TURN_S, 4 * _TURN_S)
        away_s = np.minimum(phase, 4 * _TURN_S - phase) - _TURN_S
        return np.asarray(self._beam.drift_factor * self._beam.sensor.drift_n_per_min / 60 * away_s)

    def _noise(self, begin: int, end: int) -> FloatArray:
        """Return four rows of standard noise; the last has the jitter's correlation."""
        key = (self._beam.seed, self._recording, self.rate_hz * self._beam.sensor.jitter_s)
        first = begin // _CHUNK
        chunks = [_chunk(*key, number) for number in range(first, (end - 1) // _CHUNK + 1)]
        offset = first * _CHUNK
        return np.concatenate(chunks, axis=1)[:, begin - offset : end - offset]


@lru_cache(maxsize=16)
def _white(seed: int, recording: int, chunk: int) -> FloatArray:
    words = np.random.SeedSequence([seed % 2**64, recording, chunk])
    return np.random.default_rng(words).standard_normal((_STREAMS, _CHUNK))


@lru_cache(maxsize=16)
def _chunk(seed: int, recording: int, correlation: float, chunk: int) -> FloatArray:
    """Return a chunk of noise; the jitter begins in the chunk before, which it forgets."""
    kept = np.exp(-1 / correlation) if correlation > 0 else 0.0
    fresh = np.sqrt(1 - kept**2)
    noise = _white(seed, recording, chunk).copy()
    before = _white(seed, recording, chunk - 1)[-1] if chunk else np.zeros(0)
    state, states = 0.0 if chunk else noise[-1, 0] / fresh, []
    for shock in (*before, *noise[-1]):
        state = kept * state + fresh * shock
        states.append(state)
    noise[-1] = states[-_CHUNK:]
    return noise
