"""All modes of a beam at once, and the motion that its patches drive, as sums of them.

Unknowns are the deflection W(0) of the left end, the rotation ψ and the shear strain g = W' - ψ,
per element polynomials; W is the integral of ψ + g, so that nothing cancels in a slender beam, and
without g it is Euler and Bernoulli's. (10) to (20) of docs/mathematics/beam.md.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from device.arrays import ComplexArray, FloatArray, IndexArray
from device.beam.beam import Beam, Section
from device.errors import OutOfRangeError, whole
from protocol.study.surface import Support


class Mesh(NamedTuple):
    """How finely a beam is divided: polynomials of a degree, radians of a wave per element."""

    degree: int = 14
    radians: float = 4.0


MESH = Mesh()


def gauss(count: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of Gauss and Legendre's rule on [-1, 1], by Golub and Welsch."""
    # Not numpy.polynomial, which takes as long to import as a beam to solve.
    k = np.arange(1, count)
    beside = k / np.sqrt(4.0 * k**2 - 1)
    nodes, vectors = np.linalg.eigh(np.diag(beside, 1) + np.diag(beside, -1))
    return nodes, 2 * vectors[0] ** 2


def _lobatto(degree: int) -> FloatArray:
    """Return the ends of [-1, 1] and the zeros of P' between, the nodes of a rotation."""
    k = np.arange(1, degree - 1)
    beside = np.sqrt(k * (k + 2.0) / ((2 * k + 1) * (2 * k + 3)))
    inner = np.linalg.eigvalsh(np.diag(beside, 1) + np.diag(beside, -1))
    return np.concatenate([[-1.0], inner, [1.0]])


def _legendre(degree: int, xi: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return P_0 … P_degree at places, shape (places, degree + 1), with slopes and integrals."""
    values, slopes = np.ones((2, degree + 2, xi.size))
    values[1], slopes[0] = xi, 0.0
    for n in range(1, degree + 1):
        values[n + 1] = ((2 * n + 1) * xi * values[n] - n * values[n - 1]) / (n + 1)
        slopes[n + 1] = slopes[n - 1] + (2 * n + 1) * values[n]
    integrals = np.empty((degree + 1, xi.size))
    integrals[0] = xi + 1
    orders = np.arange(1, degree + 1)[:, None]
    integrals[1:] = (values[2:] - values[:-2]) / (2 * orders + 1)
    return values[:-1].T, slopes[:-1].T, integrals.T


class _Reference(NamedTuple):
    """What the nodes of an element on [-1, 1] give at places, and the integral from -1.

    `derivatives` are the value and its first three, shape (4, places, nodes).
    """

    derivatives: FloatArray
    integral: FloatArray


@lru_cache(maxsize=16)
def _series(nodes: bytes) -> tuple[FloatArray, FloatArray]:
    """Return the matrices from values at nodes to Legendre's series, and to slopes at the nodes."""
    places = np.frombuffer(nodes)
    values, slopes, _ = _legendre(places.size - 1, places)
    to_series = np.asarray(np.linalg.inv(values), dtype=np.float64)
    return to_series, np.asarray(slopes @ to_series)


@lru_cache(maxsize=256)
def _reference(nodes: bytes, xi: bytes) -> _Reference:
    """Return the matrices of nodes at places, both as the bytes of arrays; (places, nodes) each."""
    to_series, to_slope = _series(nodes)
    parts = _legendre(to_slope.shape[0] - 1, np.frombuffer(xi))
    values, slopes, integrals = (part @ to_series for part in parts)
    bends = slopes @ to_slope
    return _Reference(np.array([values, slopes, bends, bends @ to_slope]), integrals)


@dataclass(frozen=True, kw_only=True, eq=False)
class Elements:
    """A beam in elements; `rows` turns unknowns into motion.

    The unknowns are W(0), ψ at the nodes, of which neighbours share one, and g at the elements'
    own.
    """

    supports: tuple[Support, Support]
    sections: tuple[Section, ...]
    start_m: FloatArray
    half_m: FloatArray
    section: tuple[int, ...]
    degree: int
    shear: bool

    @property
    def count(self) -> int:
        return len(self.section)

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.degree * self.count * (1 + self.shear) + 2

    def of(self, name: str) -> FloatArray:
        """Return a property of the sections, one value per element."""
        return np.array([getattr(self.sections[place], name) for place in self.section])

    @property
    def length_m(self) -> float:
        return self.sections[-1].end_m

    def places_m(self, places: Sequence[FloatArray]) -> FloatArray:
        """Return where places ξ, an array for each element, lie along the beam, shape (places,)."""
        ends_m = pairwise([*self.start_m, self.length_m])
        # Interpolated, which gives a joint the same number from its left and from its right.
        pairs = zip(places, ends_m, strict=True)
        return np.concatenate([np.interp(xi, (-1.0, 1.0), ends) for xi, ends in pairs])

    def rows(self, places: Sequence[FloatArray], derivatives: int = 0) -> FloatArray:
        """Return rows of W and ψ, and g if there is shear, at places ξ, an array for each element.

        Shape (3 or 2, 1 + derivatives, places, unknowns): each with its derivatives along the beam.
        """
        p, stops = self.degree, np.cumsum([xi.size for xi in places]).tolist()
        rows = np.zeros((2 + self.shear, 4, stops[-1], self.size))
        to_end = np.zeros(self.size)
        to_end[0] = 1.0  # W at the left end of the element
        lobatto, inner, end = _lobatto(p).tobytes(), gauss(p)[0].tobytes(), np.ones(1).tobytes()
        for k, (half_m, xi) in enumerate(zip(self.half_m.tolist(), places, strict=True)):
            here = slice(stops[k] - xi.size, stops[k])
            psi = slice(1 + p * k, 2 + p * (k + 1))
            g = slice(2 + p * (self.count + k), 2 + p * (self.count + k + 1))
            deflection, per_m = rows[0, :, here], half_m ** -np.arange(4.0)[:, None, None]
            turning = _reference(lobatto, xi.tobytes())
            deflection[0] = to_end
            rows[1, :, here, psi] = turning.derivatives * per_m
            deflection[1:, :, psi] = rows[1, :3, here, psi]
            deflection[0, :, psi] += half_m * turning.integral
            to_end[psi] += half_m * _reference(lobatto, end).integral[0]
            if self.shear:
                shearing = _reference(inner, xi.tobytes())
                rows[2, :, here, g] = shearing.derivatives * per_m
                deflection[1:, :, g] = rows[2, :3, here, g]
                deflection[0, :, g] += half_m * shearing.integral
                to_end[g] += half_m * _reference(inner, end).integral[0]
        return rows[:, : 1 + derivatives]

    def deflection_at(self, unknowns: FloatArray, x_m: FloatArray) -> FloatArray:
        """Return W of one motion at places, shape (n,)."""
        element = self._element(x_m)
        xi = (x_m - self.start_m[element]) / self.half_m[element] - 1
        values = np.empty(x_m.size)
        places = [xi[element == number] for number in range(self.count)]
        values[np.argsort(element, kind="stable")] = self.rows(places)[0, 0] @ unknowns
        return values

    def _element(self, x_m: FloatArray) -> IndexArray:
        """Return in which element each place lies."""
        return np.clip(np.searchsorted(self.start_m, x_m, side="right") - 1, 0, self.count - 1)

    def rotation_at(self, unknowns: FloatArray, x_m: FloatArray) -> FloatArray:
        """Return ψ of one motion at places, shape (n,)."""
        element = self._element(x_m)
        xi = (x_m - self.start_m[element]) / self.half_m[element] - 1
        psi = unknowns[1 : 2 + self.degree * self.count]
        values = _reference(_lobatto(self.degree).tobytes(), xi.tobytes()).derivatives[0]
        own = psi[self.degree * element[:, None] + np.arange(self.degree + 1)]
        return np.asarray((values * own).sum(axis=1))

    def conditions(self) -> FloatArray:
        """Return what the supports hold at 0, shape (conditions, unknowns); the rest is natural."""
        ends = self.rows([np.array([-1.0, 1.0])] * self.count)[:2, 0]
        left, right = ends[:, 0], ends[:, -1]
        held = {"clamped": 2, "pinned": 1, "free": 0}
        return np.concatenate(
            [end[: held[name]] for end, name in zip((left, right), self.supports, strict=True)]
        )


def elements(beam: Beam, highest_hz: float, mesh: Mesh, *, patched: bool, shear: bool) -> Elements:
    """Return the beam in elements for drives up to `highest_hz`; they end at every joint."""
    sections = beam.sections(patched=patched)
    start_m, half_m, section = [], [], []
    for number, part in enumerate(sections):
        length_m = part.end_m - part.start_m
        radians = part.wave_number_per_m(highest_hz, shear=shear) * length_m
        pieces = max(1, math.ceil(radians / mesh.radians))
        start_m += [part.start_m + length_m * piece / pieces for piece in range(pieces)]
        half_m += [length_m / pieces / 2] * pieces
        section += [number] * pieces
    return Elements(
        supports=beam.supports,
        sections=sections,
        start_m=np.array(start_m),
        half_m=np.array(half_m),
        section=tuple(section),
        degree=mesh.degree,
        shear=shear,
    )


_ZERO = 1e-12
"""Part of the largest μ below which a mode is rounding."""
_ALIKE = 1e-7
"""Two μ that differ by a smaller part are one, of which any mixture is a mode."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Spectrum:
    """The modes of a beam, for drives up to `highest_hz`.

    Attributes:
        elements: in which it is divided.
        highest_hz: for which they are fine enough.
        frequencies_hz: of the modes, rising; rigid ones are 0.
        shapes: shape (unknowns, modes), of which the strain energy, or for a rigid one the kinetic
            one, is 1 unit.
        forces: the work of the patches' moments per volt on each shape, rad/s.
        still: the unknowns under a static voltage, m/V, shape (unknowns,).
        values: μ of M v = μ (K + sM) v, s²/rad², with s of `highest_hz`; (18).
    """

    elements: Elements
    highest_hz: float
    frequencies_hz: FloatArray
    shapes: FloatArray
    forces: FloatArray
    still: FloatArray
    values: FloatArray

    def mode_hz(self, rigid: int, mode: int) -> float:
        """Return the frequency of a mode that is counted from 1 after the rigid motions."""
        return float(self.frequencies_hz[rigid + mode - 1])

    def weights(self, frequency_hz: FloatArray, damping_ratio: FloatArray) -> ComplexArray:
        """Return the weight of each shape and then of `still`, shape (drives, modes + 1); (19)."""
        own_hz, drive_hz = self.frequencies_hz, frequency_hz[:, None]
        loss = 2j * damping_ratio[:, None]
        # l ω_i² - ω² without a difference of squares, which would lose digits at resonance
        gap = loss * own_hz**2 + (own_hz - drive_hz) * (own_hz + drive_hz)
        poles = ((1 + loss) * self.highest_hz**2 + drive_hz**2) / ((1 + loss) * gap)
        return np.concatenate([poles * self.forces, 1 / (1 + loss)], axis=1)


def _moment_load(parts: Elements) -> FloatArray:
    """Return the work of the patches' moments on each unknown, per volt; (12)."""
    load = np.zeros(parts.size)
    moments = parts.of("moment_n_m_per_v")
    for k, moment in enumerate(moments.tolist()):
        load[1 + parts.degree * k] -= moment
        load[1 + parts.degree * (k + 1)] += moment
    return load


def _free_of(conditions: FloatArray, size: int) -> FloatArray:
    """Return an orthonormal basis of the unknowns that obey the conditions, shape (size, rest)."""
    if not len(conditions):
        return np.eye(size)
    scaled = conditions / np.linalg.norm(conditions, axis=1, keepdims=True)
    return np.asarray(np.linalg.qr(scaled.T, mode="complete")[0][:, len(conditions) :])


def _mended(strain: FloatArray, motion: FloatArray, shift: float, shapes: FloatArray) -> FloatArray:
    """Return shapes without what rounding mixed into them of each other; (17).

    An eigensolver errs by a part of the largest μ, which is large beside that of a high mode. Sums
    of squares over the beam err by a part of the mode's own; they tell what is left to mix.
    """
    strains, motions = strain @ shapes, motion @ shapes
    inertia = motions.T @ motions
    energy = strains.T @ strains + shift * inertia
    values = inertia.diagonal() / energy.diagonal()
    gap = values - values[:, None]
    apart = np.abs(gap) > _ALIKE * np.maximum(values, values[:, None])
    mixed = np.where(apart, inertia - values * energy, 0.0) / np.where(apart, gap, 1.0)
    return np.asarray((shapes + shapes @ mixed) / np.sqrt(energy.diagonal()))


def solved(beam: Beam, highest_hz: float, parts: Elements) -> Spectrum:
    """Return the modes of a beam in elements."""
    xi, weights = gauss(parts.degree + 2)
    rows = parts.rows([xi] * parts.count, 1)
    share = parts.half_m[:, None] * weights

    def scaled(motion: FloatArray, name: str) -> FloatArray:
        """Return √(property dx) motion at the nodes, of which the sum of squares is an energy."""
        return np.sqrt(parts.of(name)[:, None] * share).reshape(-1, 1) * motion

    strain, motion = scaled(rows[1, 1], "bending_n_m2"), scaled(rows[0, 0], "mass_kg_per_m")
    if parts.shear:
        strain = np.concatenate([strain, scaled(rows[2, 0], "shear_n")])
        motion = np.concatenate([motion, scaled(rows[1, 0], "rotary_kg_m")])
    basis = _free_of(parts.conditions(), parts.size)
    stiffness, inertia = (basis.T @ (part.T @ part) @ basis for part in (strain, motion))
    # Modes about the highest drive are then as exact as the first; rigid ones have an energy.
    shift = (2 * math.pi * highest_hz) ** 2
    root = np.linalg.cholesky(stiffness + shift * inertia)
    half = np.linalg.solve(root, inertia)
    values, vectors = np.linalg.eigh(np.linalg.solve(root, half.T))
    values, vectors = values[::-1], vectors[:, ::-1]
    vectors = vectors[:, values > _ZERO * values[0]]
    shapes = basis @ np.linalg.solve(root.T, vectors)
    shapes = _mended(strain, motion, shift, shapes)
    values = ((motion @ shapes) ** 2).sum(axis=0)
    squares = ((strain @ shapes) ** 2).sum(axis=0) / values
    squares[: beam.rigid_modes] = 0.0
    load = _moment_load(parts)
    forces = shapes.T @ load
    forces[: beam.rigid_modes] = 0.0  # two opposite moments move no rigid beam
    still = np.linalg.solve(root, basis.T @ load)
    still -= vectors[:, : beam.rigid_modes] @ (vectors[:, : beam.rigid_modes].T @ still)
    return Spectrum(
        elements=parts,
        highest_hz=highest_hz,
        frequencies_hz=np.sqrt(squares) / (2 * math.pi),
        shapes=shapes,
        forces=forces,
        still=basis @ np.linalg.solve(root.T, still),
        values=values,
    )


HIGHEST_MODE = 40
_STEP = math.sqrt(2.0)


@lru_cache(maxsize=64)
def _solved(beam: Beam, highest_hz: float, mesh: Mesh, *, patched: bool, shear: bool) -> Spectrum:
    return solved(beam, highest_hz, elements(beam, highest_hz, mesh, patched=patched, shear=shear))


def fine_to_hz(beam: Beam, frequency_hz: FloatArray) -> FloatArray:
    """Return for each drive how far, in frequency, the elements it is solved in are fine enough.

    Steps of √2, so that a drive is solved alike whatever others are solved with it.
    """
    first_hz = beam.bare.frequency_hz(math.pi / beam.length_m)
    steps = np.ceil(np.log(np.maximum(frequency_hz / first_hz, 1.0)) / math.log(_STEP))
    return np.asarray(first_hz * _STEP**steps)


def spectrum(
    beam: Beam, highest_hz: float, mesh: Mesh = MESH, *, patched: bool = True, shear: bool = True
) -> Spectrum:
    """Return the modes of a beam for drives up to `highest_hz`, without damping and scale."""
    return _solved(beam.undamped, highest_hz, mesh, patched=patched, shear=shear)


def spectrum_with_mode(
    beam: Beam, mode: int, mesh: Mesh = MESH, *, patched: bool = True, shear: bool = True
) -> Spectrum:
    """Return a spectrum that is fine enough for a mode, counted from 1 without rigid motions.

    Raise `OutOfRangeError` for a mode above 40, or above the beam's cut-off.
    """
    whole("mode", mode, 1)
    if mode > HIGHEST_MODE:
        raise OutOfRangeError("mode", f"must be at most {HIGHEST_MODE}", mode)
    bare = beam.bare
    # Its half waves, and up to half a one more between two ends that are held or free.
    wave_number = (mode + _MORE_HALF_WAVES[frozenset(beam.supports)]) * math.pi / beam.length_m
    reach_hz = 1.1 * bare.frequency_hz(wave_number, shear=shear)
    while True:
        highest_hz = float(fine_to_hz(beam, np.array(reach_hz)))
        modes = spectrum(beam, highest_hz, mesh, patched=patched, shear=shear)
        own_hz = modes.mode_hz(beam.rigid_modes, mode)
        if own_hz <= highest_hz:
            break
        reach_hz = 1.1 * own_hz
    if shear and own_hz > beam.cut_off_hz:
        below = modes.frequencies_hz < beam.cut_off_hz
        count = int(below.sum()) - beam.rigid_modes
        cut_off = f"{beam.frequency_scale * beam.cut_off_hz / 1e3:.0f} kHz ({count} modes)"
        raise OutOfRangeError("mode", f"must lie below the beam's cut-off at {cut_off}", mode)
    return modes


_MORE_HALF_WAVES = {
    frozenset({"clamped", "free"}): -0.5,
    frozenset({"pinned"}): 0.0,
    frozenset({"clamped", "pinned"}): 0.25,
    frozenset({"pinned", "free"}): 0.25,
    frozenset({"clamped"}): 0.5,
    frozenset({"free"}): 0.5,
}


def natural_frequency_hz(
    beam: Beam, mode: int, mesh: Mesh = MESH, *, patched: bool = True, shear: bool = True
) -> float:
    """Return the frequency of a beam's mode, Hz; raise as `spectrum_with_mode`."""
    modes = spectrum_with_mode(beam, mode, mesh, patched=patched, shear=shear)
    return beam.frequency_scale * modes.mode_hz(beam.rigid_modes, mode)
