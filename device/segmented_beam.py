"""The beam as three segments - before, under and beyond the patches - and the waves in each.

Timoshenko's equations, of which Euler-Bernoulli's are the case without shear and rotary inertia:

    κGA (W'' - ψ') + ρA ω² W = 0,    EI ψ'' + κGA (W' - ψ) + ρI ω² ψ = 0

A wave e^{λx} of the deflection W has rotation ψ = λ + β/λ, moment M = EI(λ² + β) and shear force
V = -ρA ω²/λ, with β = ρA ω²/κGA. In this form V stays finite without shear too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from device.beam import Beam, Patches
from device.mode_shapes import FloatArray
from device.response import ComplexArray


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
    """ΚGA of a rectangle, with Cowper's κ = 10(1+ν)/(12+11ν) and G = E/2(1+ν)."""
    factor = 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio)
    return factor * modulus_pa / (2 * (1 + poisson_ratio)) * area_m2


def _patch_second_moment_m4(beam: Beam, patches: Patches) -> float:
    """The sheets' second moment of area about the beam's neutral axis."""
    own = patches.thickness_m**2 / 12
    offset = ((beam.thickness_m + patches.thickness_m) / 2) ** 2
    return patches.count * patches.width_m * patches.thickness_m * (own + offset)


def sections(beam: Beam, *, patched: bool, shear: bool) -> tuple[Section, Section, Section]:
    """The three segments; without `patched` the sheets drive the beam but add nothing to it."""
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
        second_moment = _patch_second_moment_m4(beam, patches)
        area = patches.count * patches.width_m * patches.thickness_m
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
    """The waves at angular frequencies `omega`, shape (n,); moduli are E(1 + 2jζ)."""
    loss = 1 + 2j * damping_ratio
    bending = section.bending_stiffness_n_m2 * loss
    inertia = section.mass_kg_per_m * omega**2
    beta = inertia * (section.shear_flexibility_per_n / loss)
    rotary = section.rotary_inertia_kg_m * omega**2
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


def _end_states(wave: Waves, length_m: float) -> tuple[ComplexArray, ComplexArray]:
    """(W, ψ, M, V) of the four waves at a segment's left and right end, shape (n, 4, 4).

    Each wave has size 1 at the end from which it decays, so nothing overflows.
    """
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    growing = np.stack(
        [np.ones_like(wave.exponent), wave.rotation, wave.moment, wave.shear_force], axis=1
    )
    decaying = growing * signs[:, None]
    fade = np.exp(-wave.exponent * length_m)[:, None, :]
    left = np.concatenate([decaying, growing * fade], axis=-1)
    right = np.concatenate([decaying * fade, growing], axis=-1)
    return left, right


def system_matrix(parts: Sequence[Section], segment_waves: Sequence[Waves]) -> ComplexArray:
    """The conditions on the waves' weights, shape (n, 12, 12), rows scaled to be alike.

    Rows: W and ψ at the clamp; W, ψ, M, V across each patch end; M and V at the tip.
    """
    host, count = segment_waves[0], segment_waves[0].exponent.shape[0]
    scale = np.abs(
        np.stack([np.ones(count), host.rotation[:, 0], host.moment[:, 0], host.shear_force[:, 0]])
    ).T[:, :, None]
    ends = [
        tuple(state / scale for state in _end_states(wave, part.length_m))
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
