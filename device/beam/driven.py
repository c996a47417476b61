"""A beam driven by its patches: the motion as a sum of modes, at any number of drives at once."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from device.arrays import ComplexArray, FloatArray, IndexArray
from device.beam.beam import Beam
from device.beam.pattern import Motions, Patterns, patterns
from device.beam.spectral import MESH, Mesh, Spectrum, fine_to_hz, gauss, spectrum

_AT_ONCE = 256
"""Drives solved together: more leave the processor's cache."""


class Fineness(NamedTuple):
    """How finely a motion is computed: elements, cells per half wave, the first piece at a minimum.

    `theta` is the length of that piece over the distance of W = 0 in the complex plane; (32).
    """

    mesh: Mesh = MESH
    cells: int = 20
    theta: float = 0.25


FINENESS = Fineness()


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalRows:
    """What the shapes of a spectrum give at places and, for means, at Gauss's nodes.

    The last column of each is the static shape.

    Attributes:
        places_m: shape (places,), as `Motions` has them.
        ends: deflection and rotation with three derivatives, shape (8, modes + 1, places).
        nodes: deflection and rotation, shape (2, modes + 1, nodes).
        shares: the nodes' parts of the beam, shape (nodes,).
        wave_number_per_m: the largest.
    """

    places_m: FloatArray
    ends: FloatArray
    nodes: FloatArray
    shares: FloatArray
    wave_number_per_m: float


@lru_cache(maxsize=64)
def modal_rows(spectrum: Spectrum, cells: int) -> ModalRows:
    """Return the rows of a spectrum with at least so many cells in each half wave."""
    parts = spectrum.elements
    numbers = [
        parts.sections[place].wave_number_per_m(spectrum.highest_hz, shear=parts.shear)
        for place in parts.section
    ]
    joints = [*(a != b for a, b in pairwise(parts.section)), True]
    places = []
    for number, half_m, joint in zip(numbers, parts.half_m.tolist(), joints, strict=True):
        count = max(2, math.ceil(2 * number * half_m / math.pi * cells))
        # The right end of an element is the left one of the next, unless derivatives jump there.
        places.append(np.linspace(-1.0, 1.0, count + 1)[: None if joint else -1])
    shapes = np.column_stack([spectrum.shapes, spectrum.still])
    ends = parts.rows(places, 3)[:2] @ shapes
    for end, support in zip((0, -1), parts.supports, strict=True):
        # What is held is 0 and not rounding, of which the sign would pass for a direction.
        if support != "free":
            ends[0, 0, end] = 0.0
        if support == "clamped":
            ends[0, 1, end] -= ends[1, 0, end]
            ends[1, 0, end] = 0.0
    at, weights = gauss(parts.degree + 2)
    nodes = parts.rows([at] * parts.count)[:2, 0] @ shapes
    return ModalRows(
        places_m=parts.places_m(places),
        ends=np.ascontiguousarray(ends.reshape(8, *ends.shape[2:]).transpose(0, 2, 1)),
        nodes=np.ascontiguousarray(nodes.transpose(0, 2, 1)),
        shares=(parts.half_m[:, None] * weights / parts.length_m).ravel(),
        wave_number_per_m=max(numbers),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class DrivenMotion:
    """Motions per volt: patterns, rms and largest deflection, m/V, rms rotation, rad/V, of each."""

    patterns: Patterns
    deflection_m_per_v: FloatArray
    largest_m_per_v: FloatArray
    rotation_per_v: FloatArray


def moved(spectrum: Spectrum, weights: ComplexArray, fineness: Fineness) -> DrivenMotion:
    """Return motions of which each mode, and at last the static shape, has these weights.

    `weights` have the shape (drives, modes + 1).
    """
    rows = modal_rows(spectrum, fineness.cells)
    phases = np.concatenate([weights.real, weights.imag])
    # Deflection and rotation, their derivatives, phases, drives and then places.
    kinds = np.matmul(phases, rows.ends).reshape(2, 4, 2, weights.shape[0], -1)
    squares = (np.matmul(phases, rows.nodes) ** 2) @ rows.shares
    rms, turn = np.sqrt(squares.reshape(2, 2, -1).sum(axis=1))
    motions = Motions(
        length_m=spectrum.elements.length_m,
        wave_number_per_m=rows.wave_number_per_m,
        places_m=rows.places_m,
        deflection=kinds[0].reshape(4, 2, -1),
        rotation=kinds[1].reshape(4, 2, -1),
    )
    return DrivenMotion(
        patterns=patterns(motions, rms, fineness.theta),
        deflection_m_per_v=rms,
        # Of the cells' ends: between them it may be larger by a part in a thousand.
        largest_m_per_v=np.sqrt((kinds[0, 0] ** 2).sum(axis=0).max(axis=1)),
        rotation_per_v=turn,
    )


def driven(
    beam: Beam,
    frequency_hz: FloatArray,
    damping_ratio: FloatArray,
    fineness: Fineness,
    *,
    patched: bool = True,
    shear: bool = True,
) -> Iterator[tuple[IndexArray, DrivenMotion]]:
    """Yield parts of the drives, both of shape (drives,), and their motions per volt."""
    scale = beam.frequency_scale
    own_hz = frequency_hz / scale
    reach_hz = fine_to_hz(beam, own_hz)
    for highest_hz in sorted(set(reach_hz.tolist())):
        modes = spectrum(beam, highest_hz, fineness.mesh, patched=patched, shear=shear)
        alike = np.flatnonzero(reach_hz == highest_hz)
        for first in range(0, alike.size, _AT_ONCE):
            which = alike[first : first + _AT_ONCE]
            weights = modes.weights(own_hz[which], damping_ratio[which]) / scale**2
            yield which, moved(modes, weights, fineness)
