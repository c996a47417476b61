"""Natural frequencies of the segmented beam: roots of its frequency determinant, counted up."""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from device.beam import Beam
from device.mode_shapes import FloatArray
from device.ranges import OutOfRangeError, whole
from device.segmented_beam import Section, sections, system_matrix, waves

_STEPS_PER_MODE = 12


def _determinant(parts: Sequence[Section], frequency_hz: FloatArray) -> FloatArray:
    """A real function of frequency, shape (n,), that changes sign at each natural frequency.

    The determinant in travelling waves e^{±jks} is the one in sines and cosines times a known
    phase per pair, which is taken out.
    """
    omega = 2 * math.pi * frequency_hz
    segment_waves = [waves(part, omega, 0.0) for part in parts]
    determinant = np.linalg.det(system_matrix(parts, segment_waves))
    for part, wave in zip(parts, segment_waves, strict=True):
        wave_number = wave.exponent.imag
        phase = 1j * np.sign(wave_number) * np.exp(1j * wave_number * part.length_m)
        determinant *= np.prod(np.where(wave_number != 0, phase, 1.0), axis=-1)
    return np.asarray(determinant.real)


def _host_frequency_hz(host: Section, wave_number_per_m: FloatArray) -> FloatArray:
    """The frequency at which a travelling wave in the bare section has that wave number.

    The lower root of ρI/κGA·ω⁴ - (1 + k²(ρI/ρA + EI/κGA))ω² + EI k⁴/ρA = 0.
    """
    k2 = wave_number_per_m**2
    flexibility, mass = host.shear_flexibility_per_n, host.mass_kg_per_m
    bending, rotary = host.bending_stiffness_n_m2, host.rotary_inertia_kg_m
    linear = 1 + k2 * (rotary / mass + bending * flexibility)
    constant = bending * k2**2 / mass
    root = np.sqrt(linear**2 - 4 * rotary * flexibility * constant)
    return np.asarray(np.sqrt(2 * constant / (linear + root)) / (2 * math.pi))


def _refined(parts: Sequence[Section], low: float, high: float) -> float:
    """The root between two frequencies of opposite sign, by the Illinois method."""
    f_low, f_high = (float(value) for value in _determinant(parts, np.array([low, high])))
    for _ in range(60):
        middle = high - f_high * (high - low) / (f_high - f_low)
        f_middle = float(_determinant(parts, np.array([middle]))[0])
        if f_middle == 0 or abs(middle - high) <= 2e-16 * middle:
            return middle
        if f_middle * f_high < 0:
            low, f_low = high, f_high
        else:
            f_low /= 2
        high, f_high = middle, f_middle
    return high


@lru_cache(maxsize=256)
def segmented_natural_frequency_hz(beam: Beam, mode: int, *, patched: bool, shear: bool) -> float:
    """The natural frequency of mode `mode` of the segmented, undamped beam, Hz.

    Sign changes of the frequency determinant are counted from below, twelve samples to the
    spacing of two modes of the bare beam.

    Args:
        beam: the beam and its patches.
        mode: its number, from 1.
        patched: whether the patches' stiffness and mass count.
        shear: Timoshenko's beam (True) or Euler-Bernoulli's.

    Raises:
        OutOfRangeError: the mode lies beyond the beam's cut-off, where numbering is ambiguous.
    """
    whole("mode", mode, 1)
    parts = sections(beam, patched=patched, shear=shear)
    steps = np.arange(1, _STEPS_PER_MODE * (mode + 1) + 1, dtype=np.float64)
    wave_numbers = np.asarray(steps * (math.pi / (_STEPS_PER_MODE * beam.length_m)))
    trial_hz = _host_frequency_hz(parts[0], wave_numbers)
    trial_hz = trial_hz[trial_hz < parts[0].cut_off_hz]
    positive = _determinant(parts, trial_hz) > 0
    changes = np.flatnonzero(positive[1:] != positive[:-1])
    if changes.size < mode:
        cut_off = f"{parts[0].cut_off_hz / 1e3:.0f} kHz ({changes.size} modes)"
        raise OutOfRangeError("mode", f"must lie below the beam's cut-off at {cut_off}", mode)
    first = changes[mode - 1]
    return _refined(parts, float(trial_hz[first]), float(trial_hz[first + 1]))
