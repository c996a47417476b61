"""Forced response of the beam's modes to the patches (the paper prints none).

    Q_i = M0 [φ_i'(x2) - φ_i'(x1)],    q_i = Q_i / (ρWhL (ω_i² - ω² + 2jζω_iω))

with x1 and x2 the ends of the patches and M0 their moment (`Beam.patch_moment_n_m_per_v`).
"""

import math
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from device.beam import Beam
from device.mode_shapes import FloatArray, ModeConstants, mode_constants

ComplexArray = NDArray[np.complex128]


def natural_frequency_hz(beam: Beam, mode: int) -> float:
    """The bare Euler-Bernoulli beam's natural frequency b²/(2πL²) √(EI/ρA), Hz.

    >>> round(natural_frequency_hz(Beam(), 6), 3)
    24105.149
    """
    wave_number = mode_constants(mode).root / beam.length_m
    return wave_number**2 * beam.wave_constant_m2_s / (2 * math.pi)


def _exact_phase(constants: ModeConstants, xi: Fraction) -> float:
    """The phase bξ - lag at one place, with whole turns taken out exactly."""
    turns = float((Fraction(2 * constants.order - 1, 2) * xi) % 2)
    return math.pi * turns + constants.root_offset * float(xi) - constants.lag


@lru_cache(maxsize=1024)
def modal_force_n_per_v(beam: Beam, mode: int) -> float:
    """The modal force Q/V of the patches on one mode, N/V; signed.

    The difference of slopes is taken as a product about the patches' middle, so that a patch at a
    place where both slopes nearly agree loses no digits.
    """
    c, patches = mode_constants(mode), beam.patches
    middle = Fraction(patches.centre_m) / Fraction(beam.length_m)
    reach = Fraction(patches.length_m) / Fraction(beam.length_m) / 2
    half = c.root * float(reach)
    near_clamp = c.clamp_weight * math.exp(-c.root * float(middle - reach))
    near_tip = c.tip_weight * math.exp(-c.root * float(1 - middle - reach))
    waves = -2 * c.amplitude * math.sin(_exact_phase(c, middle))
    swing = math.sin(
        math.pi * float(Fraction(2 * c.order - 1, 2) * reach % 2) + (c.root_offset * float(reach))
    )
    difference = c.root * (waves * swing - (near_clamp + near_tip) * math.expm1(-2 * half))
    return beam.patch_moment_n_m_per_v * difference / beam.length_m


def _stiffness_terms(
    beam: Beam, mode: int, frequency_hz: FloatArray, damping_ratio: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Real and imaginary part of (ω_i² - ω² + 2jζω_iω)/(2π)², without squaring first."""
    natural_hz = natural_frequency_hz(beam, mode)
    real = (natural_hz - frequency_hz) * (natural_hz + frequency_hz)
    return real, 2 * damping_ratio * natural_hz * frequency_hz


def modal_displacement_m(
    beam: Beam,
    mode: int,
    voltage_v: ArrayLike,
    frequency_hz: ArrayLike,
    damping_ratio: ArrayLike | None = None,
) -> FloatArray:
    """The amplitude |q| of one mode, m, so that the tip moves by 2|q|.

    Args:
        beam: the beam; its damping ratio holds when none is given.
        mode: the mode's number.
        voltage_v: amplitude of the drive, at least 0; any shape that broadcasts.
        frequency_hz: of the drive, above 0.
        damping_ratio: of the mode, above 0.
    """
    damping = np.asarray(beam.damping_ratio if damping_ratio is None else damping_ratio)
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    real, imaginary = _stiffness_terms(beam, mode, frequency, damping)
    force = abs(modal_force_n_per_v(beam, mode)) * np.asarray(voltage_v, dtype=np.float64)
    return force / (beam.mass_kg * (2 * math.pi) ** 2 * np.hypot(real, imaginary))


def modal_amplitude_m_per_v(beam: Beam, mode: int, frequency_hz: float) -> complex:
    """The complex amplitude q/V of one mode at the beam's own damping ratio, m/V."""
    frequency, damping = np.asarray(frequency_hz), np.asarray(beam.damping_ratio)
    real, imaginary = _stiffness_terms(beam, mode, frequency, damping)
    force = modal_force_n_per_v(beam, mode)
    return complex(
        force / (beam.mass_kg * (2 * math.pi) ** 2 * complex(float(real), float(imaginary)))
    )
