"""The board's force channel: it samples what the finger feels, with noise, drift and a gain.

Noise depends on seed, recording and sample number alone, so that asking again changes nothing.
"""

import math
from array import array
from copy import copy
from functools import lru_cache

import numpy as np

from device.arrays import FloatArray
from device.force_channel.recording import FULL_SCALE, Block, Scale, most_in_block
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.power_stage import Instrument

RATE_RANGE_HZ = (50.0, 1_000.0)
# At full scale 8.2 N and 0.16 m: more than a finger gives on a beam of 0.1 m.
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
        self._rate_hz = RATE_RANGE_HZ[1]
        self.on = False
        self._recording = 0
        self._first_s = 0.0
        self._taken = 0
        self._kept: array[int] = array("h")
        self._due_v: list[float] = []
        """The amplitudes at the last samples, which are counted at once when they are needed."""
        self._felt, self._felt_hz = copy(beam), 0.0
        """The beam and the frequency at those samples."""

    @property
    def rate_hz(self) -> float:
        return self._rate_hz

    @rate_hz.setter
    def rate_hz(self, value: float) -> None:
        self._count()
        self._rate_hz = value

    def switch(self, on: bool, instrument: Instrument) -> None:
        """Start anew at sample 0, or stop; what is kept stays."""
        self._count()
        if on:
            self._recording += 1
            self._first_s, self._taken, self._kept = instrument.time_s, 0, array("h")
        self.on = on

    def restart(self) -> None:
        """Lose power: nothing is on, and nothing is kept."""
        self.on, self.rate_hz = False, RATE_RANGE_HZ[1]
        self._kept, self._due_v, self._taken = array("h"), [], 0

    def take_until(self, time_s: float, instrument: Instrument) -> None:
        """Take the samples up to a device time, to which `instrument` has not moved yet."""
        if not self.on:
            return
        # The small number keeps a sample that is due just now from being lost to rounding.
        end = int((time_s - self._first_s) * self.rate_hz + 1e-9) + 1
        # After a long step of the clock, only what a board would still keep is computed.
        begin = max(self._taken, end - round(BUFFER_S * self.rate_hz))
        if end <= self._taken:
            return
        if begin > self._taken:
            self._kept, self._due_v = array("h"), []
        # Samples wait until something changes: friction is computed for many of them at once.
        changed = self._felt_hz != instrument.frequency_hz or vars(self._felt) != vars(self._beam)
        if changed or len(self._due_v) >= _CHUNK:
            self._count()
            self._felt, self._felt_hz = copy(self._beam), instrument.frequency_hz
        self._due_v += [instrument.output_at(self._time_s(number)) for number in range(begin, end)]
        self._taken = end

    def lose(self) -> None:
        """Forget what is kept, as a board that is too slow, and at least one sample."""
        self._kept, self._due_v, self._taken = array("h"), [], self._taken + 1

    def block(self, first: int) -> Block:
        """Return the samples from number `first` on, or from the oldest that is still kept."""
        self._count()
        oldest = self._taken - len(self._kept) // 3
        begin = min(max(first, oldest), self._taken)
        place = 3 * (begin - oldest)
        return Block(
            first=begin,
            first_s=self._time_s(begin),
            counts=self._kept[place : place + 3 * most_in_block(self.rate_hz)],
            lost=begin > first,
        )

    def _time_s(self, number: int) -> float:
        return self._first_s + number / self.rate_hz

    def _count(self) -> None:
        if not self._due_v:
            return
        begin, felt = self._taken - len(self._due_v), self._felt
        times_s = self._first_s + np.arange(begin, self._taken) / self.rate_hz
        sensor, noise = felt.sensor, self._noise(begin, self._taken)
        gains = (sensor.tangential_gain, sensor.normal_gain, 1.0)
        sizes = (sensor.tangential_noise_n, sensor.normal_noise_n, sensor.position_noise_m)
        rows = np.array(felt.forces(times_s, np.array(self._due_v), self._felt_hz))
        # Stick-slip multiplies the friction, before gain, drift and noise of the sensor.
        rows[_TANGENTIAL] *= np.exp(sensor.jitter * noise[3])
        rows *= np.array(gains)[:, None]
        rows[: _NORMAL + 1] += self._drift_n(times_s)
        rows += np.array(sizes)[:, None] * noise[:3]
        counts = np.rint(rows / np.array(SCALE)[:, None])
        if felt.is_saturated:
            counts[_TANGENTIAL] = FULL_SCALE
        # A sensor at its limit shows full scale, and 16 bits must not wrap round.
        within = np.minimum(np.maximum(counts, -FULL_SCALE), FULL_SCALE)
        self._kept.frombytes(within.T.astype(np.int16).tobytes())
        self._due_v = []
        most = 3 * round(BUFFER_S * self.rate_hz)
        del self._kept[: max(len(self._kept) - most, 0)]

    def _drift_n(self, times_s: FloatArray) -> FloatArray:
        """Return the zero of the force sensors: a triangle, whose period is four turns."""
        phase = np.mod(times_s + _TURN_S, 4 * _TURN_S)
        away_s = np.minimum(phase, 4 * _TURN_S - phase) - _TURN_S
        return np.asarray(self._felt.drift_factor * self._felt.sensor.drift_n_per_min / 60 * away_s)

    def _noise(self, begin: int, end: int) -> FloatArray:
        key = (self._beam.seed, self._recording, self.rate_hz * self._felt.sensor.jitter_s)
        # In chunks of fixed places, so that asking in other portions gives the same samples.
        first = begin // _CHUNK
        chunks = [_chunk(*key, number) for number in range(first, (end - 1) // _CHUNK + 1)]
        offset = first * _CHUNK
        return np.concatenate(chunks, axis=1)[:, begin - offset : end - offset]


@lru_cache(maxsize=16)
def _white(seed: int, recording: int, chunk: int) -> FloatArray:
    # Words of a seed must not be negative.
    words = np.random.SeedSequence([seed % 2**64, recording, chunk])
    return np.random.default_rng(words).standard_normal((_STREAMS, _CHUNK))


@lru_cache(maxsize=16)
def _chunk(seed: int, recording: int, correlation: float, chunk: int) -> FloatArray:
    """Return a chunk of noise; the jitter begins in the chunk before, which it forgets."""
    kept = float(np.exp(-1 / correlation)) if correlation > 0 else 0.0
    # So that the variance of the jitter stays 1 whatever its correlation.
    fresh = math.sqrt(1 - kept**2)
    noise = _white(seed, recording, chunk).copy()
    before = _white(seed, recording, chunk - 1)[-1] if chunk else np.zeros(0)
    state, states = 0.0 if chunk else float(noise[-1, 0]) / fresh, []
    for shock in (*before.tolist(), *noise[-1].tolist()):
        state = kept * state + fresh * shock
        states.append(state)
    noise[-1] = states[-_CHUNK:]
    return noise
