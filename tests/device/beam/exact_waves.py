"""Exact Timoshenko waves of any beam: the reference for sum of modes and friction.

Written from the equations, and from nothing in `device` but the record of the beam. A state is W,
ψ, the moment M and the shear force V. Its own Taylor series carries it along pieces of at most one
radian, with so many digits that what grows and what decays both survive. The supports leave two
numbers of the left end open, and the right end determines them.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import mpmath as mp
import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial.legendre import leggauss

from device.arrays import ComplexArray, FloatArray
from device.beam.beam import Beam
from device.friction.scenes import Scene

TERMS = 26
HELD = {"clamped": (0, 1), "pinned": (0, 2), "free": (2, 3)}
"""What a support keeps at 0 of W, ψ, M and V; the rest is open."""


class Stretch(NamedTuple):
    """A uniform stretch: length, EI, 1/κGA, ρA, ρI and the patches' moment per volt."""

    length: mp.mpf
    bending: mp.mpf
    flexibility: mp.mpf
    mass: mp.mpf
    rotary: mp.mpf
    moment: mp.mpf


def stretches(beam: Beam, patched: bool, shear: bool) -> Iterator[Stretch]:
    """Yield the uniform stretches of a beam, from its numbers taken exactly."""
    total, sheets = mp.mpf(beam.length_m), []
    for patch in beam.patches:
        ends = (mp.mpf(patch.centre_m) + s * mp.mpf(patch.length_m) / 2 for s in (-1, 1))
        low, high = (min(max(end, mp.mpf(0)), total) for end in ends)
        away = (mp.mpf(beam.thickness_m) + mp.mpf(patch.thickness_m)) / 2
        for face, z in (("upper", away), ("lower", -away)):
            if patch.faces in {face, "both"}:
                sheets.append((low, high, patch, z))
    joints = sorted({mp.mpf(0), total, *(end for sheet in sheets for end in sheet[:2])})
    for low, high in pairwise(joints):
        if high - low < total * mp.mpf("1e-12"):  # two ends that differ by rounding
            continue
        here = [(p, z) for start, end, p, z in sheets if start < (low + high) / 2 < end]
        layers = [(beam, mp.mpf(0)), *(here if patched else ())]
        areas = [mp.mpf(one.width_m) * one.thickness_m for one, _ in layers]
        pulls = [a * one.youngs_modulus_pa for a, (one, _) in zip(areas, layers, strict=True)]
        axis = mp.fdot(pulls, [z for _, z in layers]) / mp.fsum(pulls)
        turns = [mp.mpf(one.thickness_m) ** 2 / 12 + (z - axis) ** 2 for one, z in layers]
        masses = [a * one.density_kg_m3 for a, (one, _) in zip(areas, layers, strict=True)]
        # Cowper's factor times G/E: 10 (1 + ν)/(12 + 11 ν) / (2 (1 + ν))
        shears = [5 / (12 + 11 * mp.mpf(one.poisson_ratio)) for one, _ in layers]
        scale = mp.mpf(beam.frequency_scale) ** 2
        yield Stretch(
            length=high - low,
            bending=scale * mp.fdot(pulls, turns),
            flexibility=shear / (scale * mp.fdot(pulls, shears)),
            mass=mp.fsum(masses),
            rotary=shear * mp.fdot(masses, turns),
            moment=mp.fsum(
                mp.mpf(p.stress_constant_c_m2) * p.width_m * abs(z - axis) for p, z in here
            ),
        )


class Waves:
    """A beam driven at one frequency: its determinant and, once solved, W and ψ per volt."""

    def __init__(
        self,
        beam: Beam,
        frequency_hz: mp.mpf | float,
        damping_ratio: float = 0.0,
        patched: bool = True,
        shear: bool = True,
    ) -> None:
        self.length_m = beam.length_m
        self.omega, self.loss = 2 * mp.pi * mp.mpf(frequency_hz), 1 + 2j * mp.mpf(damping_ratio)
        self.rows = list(stretches(beam, patched, shear))
        self.pieces = [max(1, int(mp.ceil(self._radians(row)))) for row in self.rows]
        self.left, self.right = (HELD[support] for support in beam.supports)
        self.digits = 26 + sum(self.pieces)  # e^radians must still cancel to 20 digits
        with mp.workdps(self.digits):
            self.omega = 2 * mp.pi * mp.mpf(frequency_hz)
            self.rows = list(stretches(beam, patched, shear))
            self._meet()

    def _radians(self, row: Stretch) -> mp.mpf:
        slow = (row.mass / row.bending) ** mp.mpf("0.25") * mp.sqrt(self.omega)
        fast = mp.sqrt(row.rotary / row.bending) + mp.sqrt(row.mass * row.flexibility)
        return row.length * (slow + self.omega * fast)

    def _series(self, row: Stretch, start: Sequence[mp.mpc], volts: int, terms: int) -> list[Any]:
        """Return the Taylor series of a state: W' = ψ + V/κGA, EIψ' = M + m, M' = …, V' = …."""
        inertia, turning = row.mass * self.omega**2, row.rotary * self.omega**2
        series = [list(start)]
        for n in range(1, terms):
            w, psi, moment, force = series[-1]
            bent = moment + (row.moment if volts and n == 1 else 0)
            slopes = (
                psi + force * row.flexibility / self.loss,
                bent / (row.bending * self.loss),
                -force - turning * psi,
                -inertia * w,
            )
            series.append([slope / n for slope in slopes])
        return series

    def _meet(self) -> None:
        """Carry both open numbers of the left end, and the volts alone, to the right end."""
        units = [[mp.mpf(row == column) for row in range(4)] for column in range(5)]
        self.steps = []  # for each piece of a stretch: the state at its end of each start
        for row, pieces in zip(self.rows, self.pieces, strict=True):
            powers = [(row.length / pieces) ** n for n in range(self.digits)]
            columns = []
            for number, unit in enumerate(units):
                series = self._series(row, unit, number == 4, self.digits)
                columns.append([mp.fdot(powers, kind) for kind in zip(*series, strict=True)])
            self.steps.append([list(row) for row in zip(*columns, strict=True)])
        self.open = [index for index in range(4) if index not in self.left]
        starts = [[*units[index], 0] for index in self.open] + [[*units[4], 1]]
        ends = []
        for start in starts:
            state = start
            for step, pieces in zip(self.steps, self.pieces, strict=True):
                for _ in range(pieces):
                    state = [*(mp.fdot(line, state) for line in step), state[4]]
            ends.append([state[index] for index in self.right])
        (a, c), (b, d), (p, q) = ends
        self.determinant = a * d - b * c
        self.numerators = b * q - d * p, c * p - a * q

    def solve(self) -> "Waves":
        """Compute the motion along the beam, in Taylor series of doubles."""
        with mp.workdps(self.digits):
            state, terms, widths = [mp.mpf(0)] * 4 + [mp.mpf(1)], [], []
            for index, numerator in zip(self.open, self.numerators, strict=True):
                state[index] = numerator / self.determinant
            for row, step, pieces in zip(self.rows, self.steps, self.pieces, strict=True):
                width = row.length / pieces
                for _ in range(pieces):
                    series = self._series(row, state[:4], 1, TERMS)
                    terms.append(
                        [[complex(x * width**n) for x in term[:2]] for n, term in enumerate(series)]
                    )
                    widths.append(float(width))
                    state = [*(mp.fdot(line, state) for line in step), state[4]]
        self.terms = np.moveaxis(np.array(terms), 0, -1)  # (terms, W and ψ, pieces)
        self.widths_m, self.ends_m = np.array(widths), np.append(0.0, np.cumsum(widths))
        self.ends_m[-1] = self.length_m
        return self

    def state(self, x_m: FloatArray) -> ComplexArray:
        """Return W, m/V, and ψ, 1/V, at places, shape (2, n)."""
        piece = np.clip(self.ends_m.searchsorted(x_m, side="right") - 1, 0, self.widths_m.size - 1)
        tau = (x_m - self.ends_m[piece]) / self.widths_m[piece]
        total = np.zeros((2, x_m.size), dtype=np.complex128)
        for term in self.terms[::-1]:
            total = total * tau + term[:, piece]
        return total

    def roots(self, curve: Callable[[ComplexArray], FloatArray], derivative: int = 0) -> FloatArray:
        """Return the places at which a smooth function of W and ψ, or a derivative, is 0."""
        places = [np.zeros(0)]
        for low, high in pairwise(self.ends_m):
            series = Chebyshev.interpolate(lambda x: curve(self.state(x)), 40, (low, high))
            kept = np.flatnonzero(np.abs(series.coef) > 1e-15 * np.abs(series.coef).max())
            series = series.truncate(max(2 + derivative, *(kept + 1))).deriv(derivative)
            real = series.roots()[np.abs(series.roots().imag) < 1e-9 * (high - low)].real
            places.append(real[(real > low) & (real <= high)])
        return np.sort(np.concatenate(places))

    def rms(self) -> FloatArray:
        """Return the rms of |W|, m/V, and of |ψ|, 1/V, along the beam."""
        x_m, width_m = _nodes(self.ends_m)
        square = (np.abs(self.state(x_m)) ** 2 * width_m).sum(axis=1)
        return np.asarray(np.sqrt(square / self.length_m))

    def under(self, x_m: FloatArray, contact_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return what moves right, m, and ∫|W|dx, m²/V, under fingers that end at x."""
        low_m = np.maximum(x_m - contact_m, 0.0)
        edges_m = self.roots(lambda state: -(state[0] * state[1].conj()).real)
        # |W| is almost a corner at its minima: pieces are halved towards them.
        corners_m = self.roots(lambda state: np.abs(state[0]) ** 2, derivative=1)
        steps_m = np.outer([-1, 0, 1], self.length_m * 0.5 ** np.arange(1, 50)).ravel()
        graded_m = np.clip(np.add.outer(corners_m, steps_m).ravel(), 0.0, self.length_m)
        ends_m = np.unique(np.concatenate([self.ends_m, edges_m, graded_m, low_m, x_m]))
        nodes_m, widths_m = _nodes(ends_m)
        size = (np.abs(self.state(nodes_m)[0]) * widths_m).reshape(-1, 16).sum(axis=1)
        w, psi = self.state((ends_m[1:] + ends_m[:-1]) / 2)
        right = np.where(-(w * psi.conj()).real > 0, np.diff(ends_m), 0.0)
        sums = np.array([np.append(0.0, np.cumsum(part)) for part in (right, size)])
        right, area = (
            sums[:, np.searchsorted(ends_m, x_m)] - sums[:, np.searchsorted(ends_m, low_m)]
        )
        return right, area


def _nodes(ends_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return 16 Gauss nodes in each piece with their weights."""
    xi, weights = leggauss(16)
    half_m = np.diff(ends_m)[:, None] / 2
    return (ends_m[:-1, None] + half_m * (xi + 1)).ravel(), (half_m * weights).ravel()


def natural_frequency(
    beam: Beam, near_hz: float, patched: bool = True, shear: bool = True
) -> mp.mpf:
    """Return the natural frequency next to a guess, Hz."""

    def value(frequency_hz: mp.mpf) -> mp.mpf:
        return mp.re(Waves(beam, frequency_hz, patched=patched, shear=shear).determinant)

    with mp.workdps(30):
        around = mp.mpf(near_hz) * (1 - mp.mpf("1e-9")), mp.mpf(near_hz) * (1 + mp.mpf("1e-9"))
        return mp.findroot(value, around, solver="secant", maxsteps=3, verify=False)


TIP_SPEED_RATIO = 0.98292153
"""Of the bodies' tips over the finger, at which η is ½; of the paper's scene."""


def friction(scene: Scene, waves: Waves, x_m: FloatArray) -> dict[str, FloatArray]:
    """Return μ' of the repaired laws at places for a finger load; model.md, section 3."""
    touch, structure = scene.touch, scene.structure
    right_m, area = waves.under(x_m, np.full(x_m.size, touch.contact_m))
    covered_m = np.minimum(x_m, touch.contact_m)
    r = right_m / covered_m
    r = r if scene.direction == "right" else 1 - r
    omega, volts = float(waves.omega), scene.drive.voltage_v
    lever_m = structure.beam.thickness_m / 2 + structure.body_height_m
    tip = np.sqrt(2) * omega * lever_m * waves.rms()[1] * volts
    eta = np.tanh(np.log(3) / 2 * tip / touch.sliding_speed_m_s / TIP_SPEED_RATIO)
    assert touch.finger_load_n is not None
    load = touch.finger_load_n / touch.contact_m
    p = structure.body_mass_kg * omega**2 * volts * area / covered_m / (np.pi * load)
    mu = structure.friction_coefficient
    return {
        "consistent": mu * (1 + eta * (1 - 2 * r) + np.tanh(np.pi * p) / np.pi),
        "coulomb": mu * (1 - eta * r),
    }
