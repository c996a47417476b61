"""The driven three-segment beam in 50 digits, by matrix exponentials, for the tests of the model.

State (W, ψ, M, V) with W' = ψ + V/κGA, ψ' = M/EI, M' = -V - ρIω²ψ, V' = -ρAω²W: the transfer
matrix of a segment is the exponential of a 4×4 matrix. Between the joints W and ψ are read off
from that matrix's own eigenvalues.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import mpmath as mp

DPS = 40


@dataclass(frozen=True)
class Model:
    """A beam model and its drive: patched or not, with shear or not."""

    patched: bool
    shear: bool
    damping: float
    mode: int = 6


def _section(model: Model, under_patch: bool) -> tuple[mp.mpf, mp.mpf, mp.mpf, mp.mpf]:
    """EI, 1/κGA, ρA, ρI of the paper's beam, from the doubles of its record taken exactly."""
    h, w, hp = (mp.mpf(value) for value in (5e-3, 5e-3, 0.3e-3))
    e, rho, nu = mp.mpf(105e9), mp.mpf(8500), mp.mpf(0.34)
    ep, rhop, nup = mp.mpf(76.5e9), mp.mpf(7500), mp.mpf(0.31)

    def stiffness(modulus: mp.mpf, poisson: mp.mpf, area: mp.mpf) -> mp.mpf:
        kappa = 10 * (1 + poisson) / (12 + 11 * poisson)
        return kappa * modulus / (2 * (1 + poisson)) * area

    ei, ra, ri, kga = e * w * h**3 / 12, rho * w * h, rho * w * h**3 / 12, stiffness(e, nu, w * h)
    if model.patched and under_patch:
        area = 2 * w * hp
        second = area * (hp**2 / 12 + ((h + hp) / 2) ** 2)
        ei, ra, ri = ei + ep * second, ra + rhop * area, ri + rhop * second
        kga += stiffness(ep, nup, area)
    if not model.shear:
        return ei, mp.mpf(0), ra, mp.mpf(0)
    return ei, 1 / kga, ra, ri


def _lengths() -> tuple[mp.mpf, mp.mpf, mp.mpf]:
    start, end = mp.mpf(0.086) - mp.mpf(0.010) / 2, mp.mpf(0.086) + mp.mpf(0.010) / 2
    return start, end - start, mp.mpf(0.1) - end


def _matrix(model: Model, under: bool, omega: mp.mpf, damping: mp.mpf) -> mp.matrix:
    ei, flexibility, ra, ri = _section(model, under)
    loss = mp.mpc(1, 2 * damping)
    return mp.matrix(
        [
            [0, 1, 0, flexibility / loss],
            [0, 0, 1 / (ei * loss), 0],
            [0, -ri * omega**2, 0, -1],
            [-ra * omega**2, 0, 0, 0],
        ]
    )


def _transfer(matrix: mp.matrix, length: mp.mpf) -> mp.matrix:
    """Exp(matrix·length) by its series on a scaled argument, squared up."""
    halvings = 14
    step = matrix * (length / 2**halvings)
    scale = mp.matrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    total, term = scale.copy(), scale.copy()
    for power in range(1, 26):
        term = term * step / power
        total += term
    for _ in range(halvings):
        total = total * total
    return total


def _chain(model: Model, omega: mp.mpf, damping: mp.mpf) -> tuple[mp.matrix, ...]:
    bare, under = (_matrix(model, flag, omega, damping) for flag in (False, True))
    first, second, third = _lengths()
    return _transfer(bare, first), _transfer(under, second), _transfer(bare, third)


def _frequency_function(model: Model, frequency_hz: mp.mpf) -> mp.mpf:
    first, second, third = _chain(model, 2 * mp.pi * frequency_hz, mp.mpf(0))
    whole = third * second * first
    return mp.re(whole[2, 2] * whole[3, 3] - whole[2, 3] * whole[3, 2])


@lru_cache(maxsize=64)
def natural_frequency(patched: bool, shear: bool, near_hz: float) -> mp.mpf:
    """The natural frequency next to a guess."""
    model = Model(patched=patched, shear=shear, damping=0.0)
    with mp.workdps(DPS + 60):
        low = mp.mpf(near_hz) * (1 - mp.mpf("1e-7"))
        high = mp.mpf(near_hz) * (1 + mp.mpf("1e-7"))
        return mp.findroot(
            lambda f: _frequency_function(model, f), (low, high), solver="secant", tol=1e-60
        )


class Driven:
    """The motion per volt at a frequency, by transfer matrices."""

    def __init__(self, model: Model, frequency_hz: mp.mpf) -> None:
        self.model, self.omega = model, 2 * mp.pi * mp.mpf(frequency_hz)
        damping = mp.mpf(model.damping)
        self.matrices = [_matrix(model, under, self.omega, damping) for under in (False, True)]
        first, second, third = _chain(model, self.omega, damping)
        thickness, sheet = mp.mpf(5e-3), mp.mpf(0.3e-3)
        jump = mp.matrix([0, 0, 2 * 2 * mp.mpf(5e-3) * (thickness + sheet) / 2, 0])
        free = third * second * first
        loaded = third * (second * jump - jump)
        block = mp.matrix([[free[2, 2], free[2, 3]], [free[3, 2], free[3, 3]]])
        root = mp.lu_solve(block, -mp.matrix([loaded[2], loaded[3]]))
        start = mp.matrix([0, 0, root[0], root[1]])
        self.starts = [start, first * start + jump]
        self.starts.append(second * self.starts[1] - jump)
        lengths = _lengths()
        self.places = [mp.mpf(0), lengths[0], lengths[0] + lengths[1]]
        self._known: dict[int, tuple[list[mp.mpc], list[mp.matrix]]] = {}
        self._tolerance = abs(self.starts[2][0]) * mp.mpf("1e-12")

    def _waves(self, index: int) -> tuple[list[mp.mpc], list[mp.matrix]]:
        """Exponents and weights of W and ψ in a segment, from its matrix and starting state."""
        if index not in self._known:
            matrix, start = self.matrices[1 if index == 1 else 0], self.starts[index]
            square = matrix * matrix
            half = (square[0, 0] + square[1, 1] + square[2, 2] + square[3, 3]) / 4
            fourth = square * square
            trace = (fourth[0, 0] + fourth[1, 1] + fourth[2, 2] + fourth[3, 3]) / 4
            gap = mp.sqrt(trace - half**2)
            roots = [mp.sqrt(half + gap), mp.sqrt(half - gap)]
            exponents = [roots[0], -roots[0], roots[1], -roots[1]]
            powers = [start, matrix * start, square * start, square * (matrix * start)]
            vandermonde = mp.matrix([[root**n for root in exponents] for n in range(4)])
            weights = [
                mp.lu_solve(vandermonde, mp.matrix([state[row] for state in powers]))
                for row in (0, 1)
            ]
            self._known[index] = exponents, weights
        return self._known[index]

    def state(self, x: mp.mpf) -> tuple[mp.mpc, mp.mpc]:
        """(W, ψ) at x."""
        index = sum(x >= place for place in self.places) - 1
        exponents, weights = self._waves(index)
        waves = [mp.exp(root * (x - self.places[index])) for root in exponents]
        return (
            mp.fdot(waves, weights[0]),
            mp.fdot(waves, weights[1]),
        )

    def direction(self, x: mp.mpf) -> mp.mpf:
        """-Re(W ψ*)."""
        deflection, rotation = self.state(x)
        return -mp.re(deflection * mp.conj(rotation))

    def edges(self) -> list[mp.mpf]:
        """Places at which the direction changes, from 0 to L."""
        count = 100 + 12 * self.model.mode
        places = [mp.mpf(0.1) * k / count for k in range(1, count + 1)]
        values = [self.direction(place) for place in places]
        found = [
            mp.findroot(self.direction, (places[k], places[k + 1]), solver="illinois", tol=1e-40)
            for k in range(count - 1)
            if values[k] * values[k + 1] < 0
        ]
        return [mp.mpf(0), *found, mp.mpf(0.1)]

    def rms_rotation(self) -> mp.mpf:
        """Root mean square of |ψ| over the beam; smooth, so that even cells do."""
        bounds = [*self.places, mp.mpf(0.1)]
        total = mp.mpf(0)
        for low, high in pairwise(bounds):
            cells = max(2, int(mp.ceil((high - low) * 40 * mp.sqrt(self.model.mode))))
            ends = [low + (high - low) * k / cells for k in range(cells + 1)]
            for left, right in pairwise(ends):
                total += self._gauss(1, 2, left, right)
        return mp.sqrt(total / mp.mpf(0.1))

    def area(self, low: mp.mpf, high: mp.mpf) -> mp.mpf:
        """∫|W|dx, with cells that halve towards the minima of |W|."""
        cuts = [low, *(p for p in self.places if low < p < high), high]
        return mp.fsum(self._cell(a, b) for a, b in pairwise(cuts))

    def _cell(self, low: mp.mpf, high: mp.mpf, depth: int = 0) -> mp.mpf:
        middle = (low + high) / 2
        whole = self._gauss(0, 1, low, high)
        halves = self._gauss(0, 1, low, middle) + self._gauss(0, 1, middle, high)
        if depth > 24 or abs(whole - halves) <= self._tolerance:
            return halves
        return self._cell(low, middle, depth + 1) + self._cell(middle, high, depth + 1)

    def _gauss(self, component: int, power: int, low: mp.mpf, high: mp.mpf) -> mp.mpf:
        half, middle = (high - low) / 2, (high + low) / 2
        values = (
            weight * abs(self.state(middle + half * node)[component]) ** power
            for node, weight in _rule()
        )
        return half * mp.fsum(values)


@lru_cache(maxsize=1)
def _rule() -> tuple[tuple[mp.mpf, mp.mpf], ...]:
    """Eight Gauss-Legendre nodes and weights."""
    rule = []
    for k in range(1, 5):
        node = mp.findroot(lambda t: mp.legendre(8, t), mp.cos(mp.pi * (k - 0.25) / 8.5))
        slope = 8 * (node * mp.legendre(8, node) - mp.legendre(7, node)) / (node**2 - 1)
        weight = 2 / ((1 - node**2) * slope**2)
        rule += [(node, weight), (-node, weight)]
    return tuple(rule)
