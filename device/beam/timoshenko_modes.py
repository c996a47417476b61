"""The patched Timoshenko beam's response as a sum of its modes, with a correction for the others.

All moduli are E(1 + 2jζ), so undamped modes decouple the damped beam too, and its motion per volt
is a function of z = ω²/(1 + 2jζ) alone:

    W(x) = U(x, z)/(1 + 2jζ),    U = Σ C_i(x)/(ω_i² - z) + Σ D_p(x) T_p(z)

C_i is the mode's shape times its modal force over its modal mass. The polynomials T_p (Chebyshev's)
stand for the modes that are not summed: their poles lie beyond the range of z. It is (28) of
docs/mathematics/beam.md.
"""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from device.beam.beam import Beam
from device.beam.modes import ComplexArray, FloatArray
from device.beam.motion import segmented_motion
from device.beam.timoshenko import segmented_natural_frequencies_hz

MOST_MODES = 30
_REACH = 0.92  # of the highest summed mode's frequency: a drive may go so far
_DEGREE = 14
_POLE_DAMPING, _LINE_DAMPING = 5e-7, 0.3  # of the drives at which the terms are fitted
_CELLS = 512
_CLAMP = 1e-5  # part of the length next to the clamp where rounding exceeds the motion
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_PANELS = 16  # per segment, for the means over the beam


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalBasis:
    """The terms of the sum at fixed places along a beam; a drive only weights them.

    Attributes:
        highest_hz: the highest frequency of a drive, before the beam's frequency scale.
        squares: ω_i² of the summed modes, rad²/s².
        places_m: shape (places,), rising; each joint is there twice, seen from either side.
        terms: shape (4, terms, places): deflection, its slope, rotation and its slope.
        deflection_products: mean products of two terms' deflections over the beam.
        rotation_products: the same of their rotations.
    """

    highest_hz: float
    squares: FloatArray
    places_m: FloatArray
    terms: FloatArray
    deflection_products: FloatArray
    rotation_products: FloatArray

    def weights(
        self, frequency_hz: FloatArray, damping_ratio: FloatArray, frequency_scale: float
    ) -> ComplexArray:
        """Return each term's weight for drives of shape (n,), shape (n, terms)."""
        loss = (1 + 2j * damping_ratio) * frequency_scale**2
        z = (2 * math.pi * frequency_hz) ** 2 / loss
        return _term_values(self.squares, self.highest_hz, z) / loss[:, None]


def _term_values(squares: FloatArray, highest_hz: float, z: ComplexArray) -> ComplexArray:
    """Return ω_i²/(ω_i² - z) for each mode and then the polynomials, shape (n, terms)."""
    poles = squares / (squares - z[:, None])
    line = 2 * z / (2 * math.pi * highest_hz) ** 2 - 1
    return np.concatenate([poles, chebvander(line, _DEGREE)], axis=1)


def _grid(beam: Beam) -> FloatArray:
    """Return places about evenly along the beam, each joint twice."""
    length_m = beam.length_m
    even = np.linspace(0.0, length_m, _CELLS + 1)
    even[0] = _CLAMP * length_m
    start_m = beam.patches.start_m
    joints = np.array([start_m, start_m + beam.patches.length_m])
    before = np.nextafter(joints, 0.0)
    return np.union1d(even, np.concatenate([before, joints]))


def _panels(beam: Beam) -> tuple[FloatArray, FloatArray]:
    """Return places and weights of a mean over the beam, split at the joints."""
    joints = (0.0, beam.patches.start_m, beam.patches.end_m, beam.length_m)
    pieces = [np.linspace(*ends, _PANELS + 1) for ends in pairwise(joints)]
    low = np.concatenate([piece[:-1] for piece in pieces])
    half = np.concatenate([np.diff(piece) for piece in pieces])[:, None] / 2
    places = low[:, None] + half * (1 + _NODES)
    return places.ravel(), (half * _WEIGHTS / beam.length_m).ravel()


def _response(
    beam: Beam, frequency_hz: float, damping_ratio: float, places_m: FloatArray
) -> ComplexArray:
    """Return U at places, shape (4, n): deflection, its slope, rotation and its slope."""
    damped = replace(beam, damping_ratio=damping_ratio)
    state = segmented_motion(damped, frequency_hz, patched=True, shear=True).state(places_m, 2)
    return state.reshape(4, -1) * (1 + 2j * damping_ratio)


@lru_cache(maxsize=8)
def modal_basis(beam: Beam) -> ModalBasis:
    """Return the sum's terms for a beam, of which damping and frequency scale do not count.

    The terms follow by least squares from the beam's motion under some well damped drives, one at
    each mode and the others from 0 to the highest frequency.
    """
    plain = replace(beam, damping_ratio=Beam().damping_ratio, frequency_scale=1.0)
    if plain != beam:
        return modal_basis(plain)
    natural_hz = segmented_natural_frequencies_hz(beam, MOST_MODES, patched=True, shear=True)
    highest_hz = _REACH * float(natural_hz[-1])
    grid, (inner, weights) = _grid(beam), _panels(beam)
    places, index = np.unique(np.concatenate([grid, inner]), return_inverse=True)
    squares = (2 * math.pi * natural_hz) ** 2
    # Close to a pole the mode is all there is: the rest of the sum is almost real there.
    near = np.array([_response(beam, float(hz), _POLE_DAMPING, places) for hz in natural_hz])
    small = 1 - 1 / (1 + 2j * _POLE_DAMPING)
    modes = (small * near).real
    line_hz = highest_hz * np.sin(np.linspace(0.02, math.pi / 2, _DEGREE + 3))
    line_z = (2 * math.pi * line_hz) ** 2 * (1 / (1 + 2j * _LINE_DAMPING))
    values = _term_values(squares, highest_hz, line_z.astype(np.complex128))
    far = np.array([_response(beam, float(hz), _LINE_DAMPING, places) for hz in line_hz])
    count = squares.size
    rest = far.reshape(line_hz.size, -1) - values[:, :count] @ modes.reshape(count, -1)
    polynomials = values[:, count:]
    inverse = np.linalg.pinv(np.concatenate([polynomials.real, polynomials.imag]))
    others = (inverse @ np.concatenate([rest.real, rest.imag])).reshape(-1, 4, places.size)
    terms = np.moveaxis(np.concatenate([modes, others]), 1, 0)
    at_grid, at_panels = terms[:, :, index[: grid.size]], terms[:, :, index[grid.size :]]
    return ModalBasis(
        highest_hz=highest_hz,
        squares=squares,
        places_m=grid,
        terms=np.ascontiguousarray(at_grid),
        deflection_products=(at_panels[0] * weights) @ at_panels[0].T,
        rotation_products=(at_panels[2] * weights) @ at_panels[2].T,
    )
