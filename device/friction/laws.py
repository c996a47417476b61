"""The friction laws, by name: from the contact's terms to the friction coefficient μ'.

`printed` is the paper's, `consistent` its smallest repair, `coulomb` a bound by Coulomb's law:
(6) to (9) of docs/mathematics/friction.md.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from device.arrays import FloatArray
from device.errors import one_of

_LN3 = math.log(3.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactTerms:
    """The terms of the contact that a law needs; all dimensionless, of shapes that broadcast.

    μ with the drive off; r (the paper's a/u), the part that moves with the finger, and 1 - r, given
    separately so that neither loses digits near 0; s, the bodies' tip speed over the finger's,
    relative to the reference; p, inertial over static load per metre; and f_p/(uf) as Eqs 9 and 11
    give it.
    """

    friction_coefficient: FloatArray
    same_direction: FloatArray
    opposing: FloatArray
    relative_tip_speed: FloatArray
    inertial_ratio: FloatArray
    printed_inertial_ratio: FloatArray
    inertial_load_n: FloatArray | float = 0.0
    """f_p, N, which results tell and no law needs."""


def anisotropy(relative_tip_speed: FloatArray) -> FloatArray:
    """Return η = tanh(½ ln3 · s): 0 at rest, ½ (the paper's constant) at s = 1, 1 far above.

    Differs from the paper: Eq 3 uses η = ½ at every voltage, even at 0 V.

    >>> round(float(anisotropy(np.array(1.0))), 12)
    0.5
    """
    decay = -_LN3 * relative_tip_speed  # (7)
    return -np.expm1(decay) / (1.0 + np.exp(decay))


def _without(relative_tip_speed: FloatArray) -> FloatArray:
    """Return 1 - η, to full relative accuracy even where η rounds to 1."""
    decay = np.exp(-_LN3 * relative_tip_speed)
    return 2.0 * decay / (1.0 + decay)


def printed(terms: ContactTerms) -> FloatArray:
    """Return μ' = μ(3/2 - a/u + f_p/(uf)), Eqs 5, 10 and 12 as printed, for comparison only."""
    bracket = 1.5 - terms.same_direction + terms.printed_inertial_ratio
    return np.asarray(terms.friction_coefficient * bracket)


def consistent(terms: ContactTerms) -> FloatArray:
    """Return μ' = μ[1 + η(1 - 2r) + tanh(πp)/π]: Eq 3 with an η that depends on the drive.

    Agrees with Eq 12 at the paper's reference point (η = ½, small p), gives μ with the drive off,
    and stays above μ(1 - η).
    """
    rest = _without(terms.relative_tip_speed)
    # (8): terms of one sign, so that nothing cancels
    inertia = np.tanh(math.pi * terms.inertial_ratio) / math.pi
    bracket = rest + 2.0 * (1.0 - rest) * terms.opposing + inertia
    return np.asarray(terms.friction_coefficient * bracket)


def coulomb(terms: ContactTerms) -> FloatArray:
    """Return μ' = μ(1 - ηr): a body that opposes the finger already exerts the full μN."""
    rest = _without(terms.relative_tip_speed)
    return terms.friction_coefficient * (terms.opposing + terms.same_direction * rest)


@dataclass(frozen=True, kw_only=True)
class Law:
    """A friction law: from the contact's terms to μ', and what a prediction must know of it.

    Attributes:
        meaning: what it is, in a few words, for tables that name laws.
        as_printed: it takes the paper's own quantities: a/u of Eq 15, η = ½ and f_p/(uf).
    """

    meaning: str
    formula: Callable[[ContactTerms], FloatArray]
    as_printed: bool = False

    def __call__(self, terms: ContactTerms) -> FloatArray:
        return self.formula(terms)


LAWS: Mapping[str, Law] = MappingProxyType(
    {
        "printed": Law(
            meaning="as the paper prints it",
            formula=printed,
            as_printed=True,
        ),
        "consistent": Law(
            meaning="its smallest repair, which the report's gains rest on",
            formula=consistent,
        ),
        "coulomb": Law(meaning="a bound by Coulomb's law", formula=coulomb),
    }
)
"""A new law is an entry here: commands, reports and exports take what this lists."""


def law_by_name(name: str) -> Law:
    """Return the law of that name; raise `OutOfRangeError` if the law does not exist."""
    one_of("law", name, LAWS)
    return LAWS[name]
