"""The beam as three segments, before, under and beyond the patches: waves and natural frequencies.

Timoshenko's equations, of which Euler-Bernoulli's are the case without shear and rotary inertia:

    κGA (W'' - ψ') + ρA ω² W = 0,    EI ψ'' + κGA (W' - ψ) + ρI ω² ψ = 0

A wave e^{λx} of the deflection W has rotation ψ = λ + β/λ, moment M = EI(λ² + β) and shear force
V = -ρA ω²/λ, with β = ρA ω²/κGA. In this form V stays finite without shear too. Derived in
docs/mathematics/beam.md, (20) to (26).
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from device.beam.beam import Beam
from device.beam.modes import ComplexArray, FloatArray
from device.errors import OutOfRangeError, whole


@dataclass(frozen=True, kw_only=True, eq=False)
class Sections:
    """The three segments' lengths, and stiffness and inertia, damping aside; shape (3, 1) each."""

    length_m: FloatArray
    bending_stiffness_n_m2: FloatArray
    shear_flexibility_per_n: FloatArray
    mass_kg_per_m: FloatArray
    rotary_inertia_kg_m: FloatArray

    @property
    def cut_off_hz(self) -> float:
        """The first's √(κGA/ρI)/2π, above which both waves travel; infinite without shear."""
        product = float((self.shear_flexibility_per_n * self.rotary_inertia_kg_m)[0, 0])
        return math.inf if product == 0 else 1 / (2 * math.pi * math.sqrt(product))


def shear_stiffness_n(modulus_pa: float, poisson_ratio: float, area_m2: float) -> float:
    """Return κGA of a rectangle, with Cowper's κ = 10(1+ν)/(12+11ν) and G = E/2(1+ν)."""
    factor = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio)
    return factor * modulus_pa / (2 * (1 + poisson_ratio)) * area_m2


@lru_cache(maxsize=64)
def sections(beam: Beam, *, patched: bool, shear: bool) -> Sections:
    """Return the three segments; unless `patched`, the sheets add no stiffness and no mass."""
    patches, scale = beam.patches, beam.frequency_scale**2
    lengths_m = patches.start_m, patches.length_m, beam.length_m - patches.end_m
    # (25): stiffness in bending and shear, mass and rotary inertia of the beam and the sheets.
    own = (
        beam.youngs_modulus_pa * beam.second_moment_m4,
        shear_stiffness_n(beam.youngs_modulus_pa, beam.poisson_ratio, beam.area_m2),
        beam.density_kg_m3 * beam.area_m2,
        beam.density_kg_m3 * beam.second_moment_m4,
    )
    offset_m = (beam.thickness_m + patches.thickness_m) / 2
    area = patches.count * patches.width_m * patches.thickness_m
    second_moment = area * (patches.thickness_m**2 / 12 + offset_m**2)
    more = (
        patches.youngs_modulus_pa * second_moment,
        shear_stiffness_n(patches.youngs_modulus_pa, patches.poisson_ratio, area),
        patches.density_kg_m3 * area,
        patches.density_kg_m3 * second_moment,
    )
    sheets = np.array([0.0, float(patched), 0.0])[:, None]
    bending, stiffness, mass, rotary = (
        each + sheets * extra for each, extra in zip(own, more, strict=True)
    )
    return Sections(
        length_m=np.array(lengths_m)[:, None],
        bending_stiffness_n_m2=bending * scale,
        shear_flexibility_per_n=shear / (stiffness * scale),
        mass_kg_per_m=mass,
        rotary_inertia_kg_m=shear * rotary,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Waves:
    """Two wave pairs of each section at n frequencies, shape (3, 2, n): travelling, near-field.

    `exponent` is λ with Re λ ≥ 0; rotation, moment and shear force are per unit deflection of the
    wave that grows with x (the decaying one has the opposite rotation and shear force).
    """

    exponent: ComplexArray
    rotation: ComplexArray
    moment: ComplexArray
    shear_force: ComplexArray


def waves(parts: Sections, omega: FloatArray, damping_ratio: float) -> Waves:
    """Return the waves at angular frequencies `omega`, shape (n,); moduli are E(1 + 2jζ)."""
    loss = 1 + 2j * damping_ratio
    bending = parts.bending_stiffness_n_m2 * loss
    inertia = parts.mass_kg_per_m * omega**2
    flexibility = parts.shear_flexibility_per_n / loss
    beta = inertia * flexibility
    rotary = parts.rotary_inertia_kg_m * omega**2
    # (22) and (23)
    half_sum = (beta + rotary / bending) / 2
    product = inertia / bending * (1 - rotary * flexibility)
    larger = half_sum + np.sqrt(half_sum**2 + product)
    exponent = np.sqrt(np.stack([-larger, product / larger], axis=1))
    return Waves(
        exponent=exponent,
        rotation=exponent + beta[:, None] / exponent,
        moment=bending[:, None] * (exponent**2 + beta[:, None]),
        shear_force=-inertia[:, None] / exponent,
    )


def system_matrix(parts: Sections, wave: Waves) -> ComplexArray:
    """Return the conditions on the waves' weights, shape (12, 12, n), rows of similar size.

    Rows: W and ψ at the clamp; W, ψ, M, V across each patch end; M and V at the tip. Columns: in
    each segment the two decaying waves and the two growing ones. Each has size 1 at the end from
    which it decays, so nothing overflows.
    """
    growing = np.stack([np.ones_like(wave.exponent), wave.rotation, wave.moment, wave.shear_force])
    growing /= np.abs(growing[:, :1, :1])
    decaying = growing * np.array([1.0, -1.0, 1.0, -1.0])[:, None, None, None]
    fade = np.exp(-wave.exponent * parts.length_m[:, None])
    # W, ψ, M, V of the four waves at each segment's left and right end.
    left = np.concatenate([decaying, growing * fade], axis=2)
    right = np.concatenate([decaying * fade, growing], axis=2)
    matrix = np.zeros((12, 12, fade.shape[-1]), dtype=np.complex128)
    matrix[0:2, 0:4] = left[0:2, 0]
    for joint in (0, 1):
        rows = slice(2 + 4 * joint, 6 + 4 * joint)
        matrix[rows, 4 * joint : 4 * joint + 4] = -right[:, joint]
        matrix[rows, 4 * joint + 4 : 4 * joint + 8] = left[:, joint + 1]
    matrix[10:12, 8:12] = right[2:4, 2]
    return matrix


_STEPS_PER_MODE = 12


def _determinant(parts: Sections, frequency_hz: FloatArray) -> FloatArray:
    """Return a real function of frequency, shape (n,), that changes sign at each natural frequency.

    It is the determinant in cosines and sines about each segment's middle, and in exponentials
    where a wave does not travel. Where one begins to, at λ = 0, the sine's rotation β/λ turns.
    """
    wave = waves(parts, 2 * math.pi * frequency_hz, 0.0)
    columns = system_matrix(parts, wave).reshape(12, 3, 4, -1)
    decaying, growing = columns[:, :, :2], columns[:, :, 2:]
    wave_number = wave.exponent.imag
    sign = np.sign(wave_number)
    growing *= np.exp(0.5j * wave_number * parts.length_m[:, None])
    odd = np.where(sign, growing.imag * sign, decaying.real)
    pairs = np.concatenate([growing.real, odd], axis=2).reshape(12, 12, -1)
    return np.asarray(np.linalg.det(np.moveaxis(pairs, -1, 0)))


def _host_frequency_hz(parts: Sections, wave_number_per_m: FloatArray) -> FloatArray:
    """Return the frequency at which a travelling wave in the first segment has that wave number.

    (26): the lower root of ρI/κGA·ω⁴ - (1 + k²(ρI/ρA + EI/κGA))ω² + EI k⁴/ρA = 0.
    """
    k2 = wave_number_per_m**2
    flexibility, mass = parts.shear_flexibility_per_n[0], parts.mass_kg_per_m[0]
    bending, rotary = parts.bending_stiffness_n_m2[0], parts.rotary_inertia_kg_m[0]
    linear = 1 + k2 * (rotary / mass + bending * flexibility)
    constant = bending * k2**2 / mass
    root = np.sqrt(linear**2 - 4 * rotary * flexibility * constant)
    return np.asarray(np.sqrt(2 * constant / (linear + root)) / (2 * math.pi))


def _refined(parts: Sections, between: tuple[float, float], values: tuple[float, float]) -> float:
    """Return the root between two frequencies with values of opposite sign, by Illinois' method."""
    (low, high), (f_low, f_high) = between, values
    for _ in range(60):
        middle = high - f_high * (high - low) / (f_high - f_low)
        if abs(high - low) <= 2e-8 * middle:  # a secant's error goes by the bracket's square
            return middle
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
    """Return the natural frequency of mode `mode` of the segmented, undamped beam, Hz.

    Sign changes of the frequency determinant are counted from below, twelve samples to the
    spacing of two modes of the bare beam. `patched` says whether the patches' stiffness and mass
    count, and `shear` whether the beam is Timoshenko's or Euler-Bernoulli's. Raise
    `OutOfRangeError` for a mode beyond the beam's cut-off, where numbering is ambiguous.
    """
    whole("mode", mode, 1)
    parts = sections(beam, patched=patched, shear=shear)
    steps = np.arange(1, _STEPS_PER_MODE * (mode + 1) + 1, dtype=np.float64)
    wave_numbers = np.asarray(steps * (math.pi / (_STEPS_PER_MODE * beam.length_m)))
    trial_hz = _host_frequency_hz(parts, wave_numbers)
    trial_hz = trial_hz[trial_hz < parts.cut_off_hz]
    values = _determinant(parts, trial_hz)
    positive = values > 0
    changes = np.flatnonzero(positive[1:] != positive[:-1])
    if changes.size < mode:
        cut_off = f"{parts.cut_off_hz / 1e3:.0f} kHz ({changes.size} modes)"
        raise OutOfRangeError("mode", f"must lie below the beam's cut-off at {cut_off}", mode)
    pair = slice(changes[mode - 1], changes[mode - 1] + 2)
    return _refined(parts, tuple(trial_hz[pair].tolist()), tuple(values[pair].tolist()))


def segmented_natural_frequencies_hz(
    beam: Beam, most: int, *, patched: bool, shear: bool
) -> FloatArray:
    """Return the lowest natural frequencies below the cut-off, at most `most` of them, Hz."""
    parts = sections(beam, patched=patched, shear=shear)
    steps = np.arange(1, _STEPS_PER_MODE * (most + 1) + 1) * (math.pi / _STEPS_PER_MODE)
    trial_hz = _host_frequency_hz(parts, np.asarray(steps / beam.length_m))
    trial_hz = trial_hz[trial_hz < parts.cut_off_hz]
    value = _determinant(parts, trial_hz)
    first = np.flatnonzero((value[1:] > 0) != (value[:-1] > 0))[:most]
    low, f_low, high, f_high = trial_hz[first], value[first], trial_hz[first + 1], value[first + 1]
    for _ in range(60):
        middle = high - f_high * (high - low) / np.where(f_high == f_low, 1.0, f_high - f_low)
        settled = np.abs(middle - high) <= 4e-16 * middle
        f_middle = _determinant(parts, middle)
        crossed = f_middle * f_high < 0
        low, f_low = np.where(crossed, high, low), np.where(crossed, f_high, f_low / 2)
        high, f_high = middle, f_middle
        if settled.all():
            break
    return high
