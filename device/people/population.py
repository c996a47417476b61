"""Populations to draw virtual persons from; the default one scores as the people of Table 4."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Protocol

import numpy as np
from scipy.special import ndtr, ndtri

from device.beam.modes import FloatArray
from device.people.person import PARAMETERS, Parameter, People, Person
from device.people.random_numbers import uniforms_of
from device.people.world import World
from protocol.journal.records import VirtualTruth


class Distribution(Protocol):
    """How a parameter differs between persons."""

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:
        """Return the quantiles at `u`, between 0 and 1, of the part within the limits."""
        ...


@dataclass(frozen=True, kw_only=True)
class Normal:
    """A normal distribution, cut off at the parameter's limits."""

    mean: float
    sd: float

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:
        """Return the quantiles at `u`."""
        if self.sd == 0:
            return np.full(u.shape, self.mean)
        low, high = (ndtr((end - self.mean) / self.sd) for end in (limits.low, limits.high))
        return np.asarray(self.mean + self.sd * ndtri(low + (high - low) * u))


@dataclass(frozen=True, kw_only=True)
class LogNormal:
    """A log-normal distribution, cut off at the parameter's limits."""

    median: float
    log_sd: float

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:
        """Return the quantiles at `u`."""
        ends = (np.log(limits.low) if limits.low > 0 else -np.inf, np.log(limits.high))
        inner = Normal(mean=float(np.log(self.median)), sd=self.log_sd)
        low, high = ends
        cut = Parameter(meaning="", unit="", source="", low=low, high=high)
        return np.exp(inner.values(u, cut))


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """All values between two ends, equally likely."""

    low: float
    high: float

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:  # noqa: ARG002 - within them
        """Return the quantiles at `u`."""
        return self.low + (self.high - self.low) * u


@dataclass(frozen=True, kw_only=True)
class OneOf:
    """Some values, each with its share of the persons."""

    values_of: tuple[float, ...]
    shares: tuple[float, ...]

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:  # noqa: ARG002 - within them
        """Return the quantiles at `u`."""
        ends = np.cumsum(self.shares) / np.sum(self.shares)
        return np.array(self.values_of)[np.searchsorted(ends[:-1], u, side="right")]


@dataclass(frozen=True, kw_only=True)
class Population:
    """Persons to draw: a typical one, and the distributions of what differs between them."""

    typical: Person = field(default_factory=Person)
    varied: Mapping[str, Distribution] = field(default_factory=dict)


def people_of(population: Population, names: Sequence[str]) -> People:
    """Return the person of each name: the same one wherever that name is drawn.

    A name holds seed and participant, such as `1/P01`: see `person_name`.
    """
    values = np.tile(list(vars(population.typical).values()), (len(names), 1))
    columns = list(PARAMETERS)
    u = uniforms_of([f"person/{name}" for name in names], 1, len(columns))[:, 0]
    for parameter, distribution in population.varied.items():
        column = columns.index(parameter)
        values[:, column] = distribution.values(u[:, column], PARAMETERS[parameter])
    return People(values)


def drawn_person(population: Population, name: str) -> Person:
    """Return the person of that name."""
    return people_of(population, [name])[0]


def person_name(seed: int | str, participant: str) -> str:
    """Return the name of the participant of a study that is run with this seed.

    A seed may be a spawn key: any text.
    """
    return f"{seed}/{participant}"


def session_name(seed: int | str, participant: str, session: int) -> str:
    """Return the name that the random numbers of a session are drawn under."""
    return f"{seed}/{participant}/{session}"


def truth_of(person: Person, world: World) -> VirtualTruth:
    """Return the true parameters of a person and of a simulated beam."""
    return VirtualTruth(
        **vars(person),
        law=world.law,
        rung=world.rung,
        damping_ratio=world.damping_ratio,
        beam_gain=world.gain,
    )


def person_of(truth: VirtualTruth) -> Person:
    """Return the person with these true parameters."""
    known = {name: getattr(truth, name) for name in PARAMETERS}
    return Person(**{name: value for name, value in known.items() if value is not None})


DEFAULT = Population(
    typical=Person(
        rating_noise=1.0,
        beyond_swing=0.55,
        beyond_strength=1.55,
        beyond_ramp=2.4,
        beyond_press=-1.65,
        force_error=0.05,
        speed_error=0.05,
        tremor=0.03,
    ),
    varied=MappingProxyType(
        {
            "bias": Normal(mean=7.0, sd=1.0),
            "gain": Normal(mean=4.0, sd=1.0),
            "criterion": LogNormal(median=0.08, log_sd=0.2),
            "criterion_less": LogNormal(median=0.13, log_sd=0.2),
            "lapse": Uniform(low=0.0, high=0.04),
            "number_step": OneOf(values_of=(1.0, 2.0), shares=(0.9, 0.1)),
            "end_aversion": Uniform(low=0.0, high=0.1),
            "serial": Normal(mean=0.05, sd=0.05),
            "drift": Normal(mean=0.0, sd=0.01),
            "fatigue": Uniform(low=0.0, high=0.004),
            "force_factor": Uniform(low=0.85, high=1.15),
            "speed_factor": Uniform(low=0.9, high=1.1),
            "place_offset_m": Uniform(low=-1e-3, high=1e-3),
            "skin": LogNormal(median=1.0, log_sd=0.2),
            "mu0": LogNormal(median=1.0, log_sd=0.15),
            "reaction_median_s": LogNormal(median=0.8, log_sd=0.25),
        }
    ),
)
"""Bias, gain, noise and what each kind of change adds are fitted to Table 4: see docs/people.md."""

_EXACT = Person()
_OF_TOUCHES = (
    "force_factor",
    "force_error",
    "speed_factor",
    "speed_error",
    "place_offset_m",
    "tremor",
)
SENSITIVE = Population(
    typical=replace(
        DEFAULT.typical,
        felt_noise=0.015,
        **{name: getattr(_EXACT, name) for name in _OF_TOUCHES},
    ),
    varied=MappingProxyType(
        {name: how for name, how in DEFAULT.varied.items() if name not in _OF_TOUCHES}
        | dict.fromkeys(("criterion", "criterion_less"), LogNormal(median=0.025, log_sd=0.2))
    ),
)
"""As `DEFAULT`, but they touch as instructed and feel small changes.

The paper's nine people said what was expected in all 45 trials.
"""
