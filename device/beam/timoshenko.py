"""The beam as three segments, before, under and beyond the patches: waves and natural frequencies.

Timoshenko's equations, of which Euler-Bernoulli's are the case without shear and rotary inertia:

    κGA (W'' - ψ') + ρA ω² W = 0,    EI ψ'' + κGA (W' - ψ) + ρI ω² ψ = 0

A wave e^{λx} of the deflection W has rotation ψ = λ + β/λ, moment M = EI(λ² + β) and shear force
V = -ρA ω²/λ, with β = ρA ω²/κGA. In this form V stays finite without shear too. Derived in
docs/mathematics/beam.md, (20) to (26).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from device.beam.beam import Beam
from device.beam.modes import ComplexArray, FloatArray
from device.errors import OutOfRangeError, whole


@dataclass(frozen=True, kw_only=True)
class Section:
    """A segment's length and its section's stiffness and inertia, damping aside."""

    length_m: float
    bending_stiffness_n_m2: float
    shear_flexibility_per_n: float
    mass_kg_per_m: float
    rotary_inertia_kg_m: float

    @property
    def cut_off_hz(self) -> float:
        """The frequency √(κGA/ρI)/2π above which both waves travel; infinite without shear."""
        product = self.shear_flexibility_per_n * self.rotary_inertia_kg_m
        return math.inf if product == 0 else 1 / (2 * math.pi * math.sqrt(product))


def shear_stiffness_n(modulus_pa: float, poisson_ratio: float, area_m2: float) -> float:
    """Return κGA of a rectangle, with Cowper's κ = 10(1+ν)/(12+11ν) and G = E/2(1+ν)."""
    factor = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio)
    return factor * modulus_pa / (2 * (1 + poisson_ratio)) * area_m2


def sections(beam: Beam, *, patched: bool, shear: bool) -> tuple[Section, Section, Section]:
    """Return the three segments; unless `patched`, the sheets add no stiffness and no mass."""
    patches, scale = beam.patches, beam.frequency_scale**2
    bending = beam.youngs_modulus_pa * beam.second_moment_m4
    mass = beam.density_kg_m3 * beam.area_m2
    rotary = beam.density_kg_m3 * beam.second_moment_m4
    stiffness = shear_stiffness_n(beam.youngs_modulus_pa, beam.poisson_ratio, beam.area_m2)

    def section(length_m: float) -> Section:
        return Section(
            length_m=length_m,
            bending_stiffness_n_m2=bending * scale,
            shear_flexibility_per_n=1 / (stiffness * scale) if shear else 0.0,
            mass_kg_per_m=mass,
            rotary_inertia_kg_m=rotary if shear else 0.0,
        )

    before, beyond = section(patches.start_m), section(beam.length_m - patches.end_m)
    if patched:
        # (25)
        offset_m = (beam.thickness_m + patches.thickness_m) / 2
        area = patches.count * patches.width_m * patches.thickness_m
        second_moment = area * (patches.thickness_m**2 / 12 + offset_m**2)
        bending += patches.youngs_modulus_pa * second_moment
        mass += patches.density_kg_m3 * area
        rotary += patches.density_kg_m3 * second_moment
        stiffness += shear_stiffness_n(patches.youngs_modulus_pa, patches.poisson_ratio, area)
    return before, section(patches.length_m), beyond


@dataclass(frozen=True, kw_only=True, eq=False)
class Waves:
    """The two wave pairs of a section at n frequencies, shape (n, 2): travelling, near-field.

    `exponent` is λ with Re λ ≥ 0; rotation, moment and shear force are per unit deflection of the
    wave that grows with x (the decaying one has the opposite rotation and shear force).
    """

    exponent: ComplexArray
    rotation: ComplexArray
    moment: ComplexArray
    shear_force: ComplexArray


def waves(section: Section, omega: FloatArray, damping_ratio: float) -> Waves:
    """Return the waves at angular frequencies `omega`, shape (n,); moduli are E(1 + 2jζ)."""
    loss = 1 + 2j * damping_ratio
    bending = section.bending_stiffness_n_m2 * loss
    inertia = section.mass_kg_per_m * omega**2
    beta = inertia * (section.shear_flexibility_per_n / loss)
    rotary = section.rotary_inertia_kg_m * omega**2
    # (22) and (23)
    half_sum = (beta + rotary / bending) / 2
    product = inertia / bending * (1 - rotary * (section.shear_flexibility_per_n / loss))
    larger = half_sum + np.sqrt(half_sum**2 + product)
    exponent = np.sqrt(np.stack([-larger, product / larger], axis=-1))
    return Waves(
        exponent=exponent,
        rotation=exponent + beta[:, None] / exponent,
        moment=bending * (exponent**2 + beta[:, None]),
        shear_force=-inertia[:, None] / exponent,
    )


def waves_of(
    parts: Sequence[Section], omega: FloatArray, damping_ratio: float
) -> tuple[Waves, Waves, Waves]:
    """Return the waves of the three segments, of which the outer two differ only in length."""
    host, middle = (waves(part, omega, damping_ratio) for part in parts[:2])
    return host, middle, host


def _end_states(
    wave: Waves, length_m: float, scale: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return (W, ψ, M, V) of the four waves at a segment's left and right end, shape (n, 4, 4).

    They are relative to `scale`, shape (n, 4, 1). Each wave has size 1 at the end from which it
    decays, so nothing overflows.
    """
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    growing = np.stack(
        [np.ones_like(wave.exponent), wave.rotation, wave.moment, wave.shear_force], axis=1
    )
    growing /= scale
    decaying = growing * signs[:, None]
    fade = np.exp(-wave.exponent * length_m)[:, None, :]
    left = np.concatenate([decaying, growing * fade], axis=-1)
    right = np.concatenate([decaying * fade, growing], axis=-1)
    return left, right


def system_matrix(parts: Sequence[Section], segment_waves: Sequence[Waves]) -> ComplexArray:
    """Return the conditions on the waves' weights, shape (n, 12, 12), rows of similar size.

    Rows: W and ψ at the clamp; W, ψ, M, V across each patch end; M and V at the tip.
    """
    host, count = segment_waves[0], segment_waves[0].exponent.shape[0]
    scale = np.abs(
        np.stack([np.ones(count), host.rotation[:, 0], host.moment[:, 0], host.shear_force[:, 0]])
    ).T[:, :, None]
    ends = [
        _end_states(wave, part.length_m, scale)
        for part, wave in zip(parts, segment_waves, strict=True)
    ]
    matrix = np.zeros((count, 12, 12), dtype=np.complex128)
    matrix[:, 0:2, 0:4] = ends[0][0][:, 0:2]
    for joint in (0, 1):
        rows = slice(2 + 4 * joint, 6 + 4 * joint)
        matrix[:, rows, 4 * joint : 4 * joint + 4] = -ends[joint][1]
        matrix[:, rows, 4 * joint + 4 : 4 * joint + 8] = ends[joint + 1][0]
    matrix[:, 10:12, 8:12] = ends[2][1][:, 2:4]
    return matrix


_STEPS_PER_MODE = 12


def _determinant(parts: Sequence[Section], frequency_hz: FloatArray) -> FloatArray:
    """Return a real function of frequency, shape (n,), that changes sign at each natural frequency.

    The determinant in travelling waves e^{±jks} is the one in sines and cosines times a known
    phase per pair, which is divided out.
    """
    omega = 2 * math.pi * frequency_hz
    segment_waves = waves_of(parts, omega, 0.0)
    determinant = np.linalg.det(system_matrix(parts, segment_waves))
    wave_number = np.concatenate([wave.exponent.imag for wave in segment_waves], axis=-1)
    lengths_m = np.repeat([part.length_m for part in parts], 2)
    phase = 1j * np.sign(wave_number) * np.exp(1j * wave_number * lengths_m)
    phases = np.where(wave_number != 0, phase, 1.0).prod(axis=-1)
    return np.asarray((determinant * phases).real)


def _host_frequency_hz(host: Section, wave_number_per_m: FloatArray) -> FloatArray:
    """Return the frequency at which a travelling wave in the bare section has that wave number.

    (26): the lower root of ρI/κGA·ω⁴ - (1 + k²(ρI/ρA + EI/κGA))ω² + EI k⁴/ρA = 0.
    """
    k2 = wave_number_per_m**2
    flexibility, mass = host.shear_flexibility_per_n, host.mass_kg_per_m
    bending, rotary = host.bending_stiffness_n_m2, host.rotary_inertia_kg_m
    linear = 1 + k2 * (rotary / mass + bending * flexibility)
    constant = bending * k2**2 / mass
    root = np.sqrt(linear**2 - 4 * rotary * flexibility * constant)
    return np.asarray(np.sqrt(2 * constant / (linear + root)) / (2 * math.pi))


def _refined(
    parts: Sequence[Section], between: tuple[float, float], values: tuple[float, float]
) -> float:
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
    trial_hz = _host_frequency_hz(parts[0], wave_numbers)
    trial_hz = trial_hz[trial_hz < parts[0].cut_off_hz]
    values = _determinant(parts, trial_hz)
    positive = values > 0
    changes = np.flatnonzero(positive[1:] != positive[:-1])
    if changes.size < mode:
        cut_off = f"{parts[0].cut_off_hz / 1e3:.0f} kHz ({changes.size} modes)"
        raise OutOfRangeError("mode", f"must lie below the beam's cut-off at {cut_off}", mode)
    pair = slice(changes[mode - 1], changes[mode - 1] + 2)
    return _refined(parts, tuple(trial_hz[pair].tolist()), tuple(values[pair].tolist()))


def segmented_natural_frequencies_hz(
    beam: Beam, most: int, *, patched: bool, shear: bool
) -> FloatArray:
    """Return the lowest natural frequencies below the cut-off, at most `most` of them, Hz."""
    parts = sections(beam, patched=patched, shear=shear)
    steps = np.arange(1, _STEPS_PER_MODE * (most + 1) + 1) * (math.pi / _STEPS_PER_MODE)
    trial_hz = _host_frequency_hz(parts[0], np.asarray(steps / beam.length_m))
    trial_hz = trial_hz[trial_hz < parts[0].cut_off_hz]
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
