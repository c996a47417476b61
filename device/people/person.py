"""A virtual person: its parameters, each with unit, limits, meaning and source."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from hashlib import shake_128
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np

from device.arrays import FloatArray, IndexArray
from device.friction.changes import LAW, RUNG
from device.friction.contact import Number, contact_of
from device.friction.prediction import LawChoice, law_terms
from device.friction.rungs import rung_field, rung_resonance_hz
from device.friction.scenes import Direction, Drive, FingerContact, Scene, Structure
from device.friction.surfaces import (
    PAPERS,
    AnySurface,
    BeamSurface,
    FrictionTable,
    GivenSurface,
    MeasuredSurface,
)
from protocol.journal.records import VirtualTruth

TABLE_4 = "the paper's Table 4"
ASSUMED = "assumed"


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """In which unit and between which limits a parameter is, and where it is from."""

    unit: str
    source: str
    low: float = 0.0
    high: float = 1.0


def _of(
    default: float, unit: str, source: str = ASSUMED, low: float = 0.0, high: float = 1.0
) -> Any:
    of = Parameter(unit=unit, source=source, low=low, high=high)
    return field(default=default, metadata={"of": of})


def _points(default: float, source: str = TABLE_4, low: float = -50.0, high: float = 50.0) -> Any:
    return _of(default, "points", source, low, high)


def _share(default: float, source: str = ASSUMED, low: float = 0.0) -> Any:
    return _of(default, "share", source, low)


_LINE = "Table 4, over a straight line in the contrast"
_LAPSES = (
    "assumed, as usual for psychometric functions: Wichmann and Hill 2001, doi 10.3758/BF03194544"
)
_SKINS = "assumed; that skins differ: Gueorguiev et al. 2017, doi 10.1098/rsif.2017.0641"
_WEBER = "Gueorguiev et al. 2017, doi 10.1098/rsif.2017.0641"
_EXPECTED = "assumed: people expect a change, and report one on a third of catch trials"
_SERIAL = "assumed; assimilation in absolute judgement: Holland and Lockhead 1968"


@dataclass(frozen=True, kw_only=True)
class Person:
    """A virtual person.

    Scores are on the paper's scale of 0 to 10, whatever the study's. A felt change is one of log
    friction:

        score = bias + gain · |felt| + what the kind of change adds + drift + noise

    Without a question about a change it follows the level that is felt, ln(friction / at rest):

        score = bias + gain · level + drift + noise

    The defaults are a person who errs in nothing but feeling and scoring.
    """

    bias: float = _points(7.0)
    """score of no change"""
    gain: float = _points(4.0, TABLE_4, -200.0, 200.0)
    """score points per unit of felt change"""
    felt_noise: float = _of(0.11, "log friction", _WEBER, 0.0, 10.0)
    """Weber fraction of friction: SD of a felt change"""
    criterion: float = _of(0.08, "log friction", _EXPECTED, -10.0, 10.0)
    """a larger felt change is answered as smoother, stronger or swapped"""
    criterion_less: float = _of(0.13, "log friction", ASSUMED, -10.0, 10.0)
    """a larger felt change the other way is answered as rougher or weaker"""
    lapse: float = _share(0.0, _LAPSES)
    """trials answered at random and scored as no change, whatever is felt"""
    rating_noise: float = _points(1.0, low=0.0)
    """SD of the noise of a score"""
    beyond_swing: float = _points(0.0, _LINE)
    """added to a stronger or weaker swing along the path"""
    beyond_strength: float = _points(0.0, _LINE)
    """added to a stronger or weaker effect at a place"""
    beyond_ramp: float = _points(0.0, _LINE)
    """added to a change of roughness during a touch"""
    beyond_swap: float = _points(0.0, _LINE)
    """added to places that swap"""
    beyond_press: float = _points(0.0, _LINE)
    """added to a change of roughness under a harder press"""
    ceiling: float = _points(10.0, ASSUMED, 0.0, 10.0)
    """the highest score given"""
    number_step: float = _points(1.0, ASSUMED, 1.0, 10.0)
    """scores are multiples of it: a person who uses few numbers"""
    end_aversion: float = _share(0.0)
    """scores at an end of the scale that are moved one step inwards"""
    serial: float = _share(0.0, _SERIAL, low=-1.0)
    """weight of the previous score in this one; below 0: contrast"""
    adaptation: float = _share(0.0)
    """by how much of the previous felt change this one is felt as smaller"""
    drift: float = _points(0.0, ASSUMED)
    """score points added per trial"""
    fatigue: float = _share(0.0)
    """growth of the noise of feeling and scoring per trial"""
    force_factor: float = _of(1.0, "ratio", low=0.2, high=5.0)
    """mean force, relative to the instructed one"""
    force_error: float = _share(0.0)
    """SD of the force from touch to touch, relative to its mean"""
    speed_factor: float = _of(1.0, "ratio", low=0.2, high=5.0)
    """mean speed, relative to the mark's"""
    speed_error: float = _share(0.0)
    """SD of the speed from touch to touch, relative to its mean"""
    place_offset_m: float = _of(0.0, "m", low=-0.02, high=0.02)
    """how far right of the mark the finger is"""
    tremor: float = _share(0.0)
    """SD of the force within a touch, relative to its mean"""
    skin: float = _of(1.0, "ratio", _SKINS, 0.0, 10.0)
    """what the skin multiplies the change of log friction by"""
    mu0: float = _of(1.0, "ratio", low=0.01, high=10.0)
    """what the skin multiplies friction at rest by"""
    reaction_shift_s: float = _of(0.3, "s", high=60.0)
    """shortest reaction time"""
    reaction_median_s: float = _of(0.8, "s", high=600.0)
    """median of what a reaction time has beyond the shortest"""
    reaction_spread: float = _of(0.4, "", high=5.0)
    """SD of the logarithm of that"""
    dropout: float = _share(0.0)
    """chance of leaving at a question, for good"""


PARAMETERS: dict[str, Parameter] = {entry.name: entry.metadata["of"] for entry in fields(Person)}


class People:
    """Many persons: each parameter is an array of shape (people,), under its name."""

    def __init__(self, values: FloatArray) -> None:
        """Take the parameters in the order of `PARAMETERS`, shape (people, parameters)."""
        # A column each, because everything is computed over all persons, one parameter at a time.
        self._columns = dict(zip(PARAMETERS, np.ascontiguousarray(values.T), strict=True))
        self.size = len(values)

    @classmethod
    def of(cls, persons: Sequence[Person]) -> "People":
        return cls(np.array([list(vars(person).values()) for person in persons]))

    def __getattr__(self, name: str) -> FloatArray:
        # Underscores are refused first: a copy asks for such names before `_columns` is there.
        if name.startswith("_") or name not in PARAMETERS:
            raise AttributeError(name)
        return np.asarray(self._columns[name])

    def rows(self, which: IndexArray) -> "People":
        """Return the persons at these positions, in this order; one may come more than once."""
        return People(np.stack([column[which] for column in self._columns.values()], axis=-1))

    def __getitem__(self, number: int) -> Person:
        return Person(**{name: float(column[number]) for name, column in self._columns.items()})


# Random numbers of a virtual person, each at a known place of a stream that its name determines.
#
# SHAKE-128 defines them, so that they are the same on every machine, and a session, which draws
# them one row at a time, gets those that a simulated cohort draws at once.


def uniforms(stream: str, rows: int, columns: int) -> FloatArray:
    """Return the first rows of a stream: numbers between 0 and 1, shape (rows, columns).

    >>> bool((uniforms("a", 3, 2)[:2] == uniforms("a", 2, 2)).all())
    True
    """
    return np.asarray(uniforms_of([stream], rows, columns)[0])


def uniforms_of(streams: Sequence[str], rows: int, columns: int) -> FloatArray:
    """Return the first rows of each stream, shape (streams, rows, columns)."""
    size = 8 * rows * columns
    digests = b"".join([shake_128(name.encode()).digest(size) for name in streams])
    # Least byte first on every machine, or the same name would give other numbers on some.
    words = np.frombuffer(digests, dtype="<u8").reshape(len(streams), rows, columns)
    # 53 bits are what a float holds. The half keeps 0 and 1 out, whose quantiles are infinite.
    return np.asarray(((words >> 11) + 0.5) * 2.0**-53)


def normal_quantile(u: FloatArray) -> FloatArray:
    """Return the quantiles of the standard normal distribution at `u`."""
    from scipy.special import ndtri  # a third of the start of a session that has no virtual person

    return np.asarray(ndtri(u))


@dataclass(frozen=True, kw_only=True)
class World:
    """What a simulated beam obeys, which need not be what the analysis assumes.

    `gain` is how much of the amplitude reaches the beam. The beam's resonance is not among it:
    drives are relative to it. Of a surface whose friction is not known, `effect` says by how many
    points each condition changes a score (see `answering.change_worth`).
    """

    law: str = LAW
    rung: str = RUNG
    damping_ratio: float = PAPERS.structure.beam.damping_ratio
    gain: float = 1.0
    surface: AnySurface = PAPERS
    effect: Mapping[str, float] | None = None

    @cached_property
    def structure(self) -> Structure:
        """The beam with this damping; the paper's where friction does not come from a model."""
        own = self._beam_surface.structure
        return replace(own, beam=replace(own.beam, damping_ratio=self.damping_ratio))

    @property
    def mode(self) -> int:
        return self._beam_surface.mode

    @cached_property
    def resonance_hz(self) -> float:
        """The resonance of the beam on this rung."""
        return rung_resonance_hz(self.rung, self.structure.beam, self.mode)

    def points(self, condition: str | None, kind: str, level: float) -> float | None:
        """Return by how many points a trial changes a score; None where people are told nothing.

        A trial without a condition has that of its kind, such as `signal`.
        """
        return None if self.effect is None else level * self.effect.get(condition or kind, 0.0)

    @property
    def _beam_surface(self) -> BeamSurface:
        return self.surface if isinstance(self.surface, BeamSurface) else PAPERS


@dataclass(frozen=True, kw_only=True, eq=False)
class Fingers:
    """Fingers on the beam; arrays of shape (n,), or numbers that are those of all of them.

    `voltage_v` is the amplitude that was asked for.
    """

    place_m: FloatArray
    force_n: Number
    speed_m_s: Number
    voltage_v: FloatArray
    body_height_m: Number
    skin: Number
    mu0: Number
    beam: str = ""
    """The name of the mounted one, on which a table may depend."""


def felt_friction(
    world: World, fingers: Fingers, model_hz: float, direction: Direction
) -> FloatArray:
    """Return the friction coefficient `mu0 · μ · (μ'/μ)^skin` that each finger feels, shape (n,).

    `model_hz` is the frequency of the drive where `world.resonance_hz` is that of the beam. Without
    a model a finger feels what was measured, at the nearest place, force and speed that were; and
    nothing of the drive on a surface that has neither.
    """
    if isinstance(world.surface, MeasuredSurface):
        measured = _measured(world.surface.table, world, fingers, model_hz, direction)
        off = replace(fingers, voltage_v=0.0 * fingers.voltage_v)
        untouched = _measured(world.surface.table, world, off, model_hz, direction)
        return np.asarray(fingers.mu0 * untouched * (measured / untouched) ** fingers.skin)
    structure = world.structure
    choice = LawChoice(name=world.law).on(structure.beam)
    resting = structure.friction_coefficient
    at_rest = isinstance(world.surface, GivenSurface) or not fingers.voltage_v.any()
    if at_rest and not choice.law.as_printed:  # no rung need be set up
        return np.asarray(fingers.mu0 * resting * np.ones(fingers.place_m.shape))
    # The field is computed for 1 V and scaled, because it is linear in the amplitude.
    drive = Drive(voltage_v=world.gain, frequency_hz=model_hz, mode=world.mode)
    contact = replace(
        contact_of(
            Scene(structure=structure, touch=FingerContact(x_m=0.0), direction=direction),
            fingers.place_m,
        ),
        finger_load_n=fingers.force_n,
        body_height_m=fingers.body_height_m,
        sliding_speed_m_s=fingers.speed_m_s,
    )
    field = rung_field(world.rung, structure.beam, drive).scaled(fingers.voltage_v)
    driven = choice.law(law_terms(contact, field, world.rung, choice))
    # The sign is kept apart: the printed law can give friction below 0, which has no such power.
    size = np.abs(driven / resting) ** fingers.skin
    return np.asarray(fingers.mu0 * resting * np.copysign(size, driven))


def _measured(
    table: FrictionTable, world: World, fingers: Fingers, model_hz: float, direction: Direction
) -> FloatArray:
    at = {
        "voltage_v": world.gain * fingers.voltage_v,
        "frequency": np.array(model_hz / world.resonance_hz),
        "place_m": fingers.place_m,
        "direction": direction,
        "force_n": np.asarray(fingers.force_n),
        "speed_m_s": np.asarray(fingers.speed_m_s),
        "beam": fingers.beam,
    }
    return table.friction(at, nearest=True) * np.ones(fingers.place_m.shape)


class Distribution(Protocol):
    """How a parameter differs between persons."""

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:
        """Return the quantiles at `u`, between 0 and 1, of the part within the limits."""


@dataclass(frozen=True, kw_only=True)
class Normal:
    """A normal distribution, cut off at the parameter's limits."""

    mean: float
    sd: float

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:
        if self.sd == 0:
            return np.full(u.shape, self.mean)
        from scipy.special import ndtr

        # Quantiles of the part within the limits: clipping would heap people at the ends.
        low, high = (ndtr((end - self.mean) / self.sd) for end in (limits.low, limits.high))
        return np.asarray(self.mean + self.sd * normal_quantile(low + (high - low) * u))


@dataclass(frozen=True, kw_only=True)
class LogNormal:
    """A log-normal distribution, cut off at the parameter's limits."""

    median: float
    log_sd: float

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:
        low = np.log(limits.low) if limits.low > 0 else -np.inf
        inner = Normal(mean=float(np.log(self.median)), sd=self.log_sd)
        return np.exp(inner.values(u, replace(limits, low=low, high=np.log(limits.high))))


@dataclass(frozen=True, kw_only=True)
class Uniform:
    """All values between two ends, equally likely."""

    low: float
    high: float

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:  # noqa: ARG002 - within them
        return self.low + (self.high - self.low) * u


@dataclass(frozen=True, kw_only=True)
class OneOf:
    """Some values, each with its share of the persons."""

    values_of: tuple[float, ...]
    shares: tuple[float, ...]

    def values(self, u: FloatArray, limits: Parameter) -> FloatArray:  # noqa: ARG002 - within them
        ends = np.cumsum(self.shares) / np.sum(self.shares)
        # Without the last end, which rounding may leave below 1.
        return np.array(self.values_of)[np.searchsorted(ends[:-1], u, side="right")]


@dataclass(frozen=True, kw_only=True)
class Population:
    """Persons to draw: a typical one, and the distributions of what differs between them.

    Those of some of a study's `groups` may be drawn from populations of their own. `effect` is what
    conditions are to all of them where friction is not known: see `World`.
    """

    typical: Person = field(default_factory=Person)
    varied: Mapping[str, Distribution] = field(default_factory=dict)
    groups: Mapping[str, "Population"] = field(default_factory=dict)
    effect: Mapping[str, float] | None = None

    def of_group(self, name: str | None) -> "Population":
        """Return the population of a group: this one unless it has one of its own."""
        return self.groups.get(name or "", self)


def people_of(population: Population, names: Sequence[str]) -> People:
    """Return the person of each name: the same one wherever that name is drawn.

    A name holds seed and participant, such as `1/P01`: see `person_name`.
    """
    values = np.tile(list(vars(population.typical).values()), (len(names), 1))
    columns = list(PARAMETERS)
    # A column for each, drawn or not: a population that varies one more leaves the others.
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
        effect=world.effect,
    )


def person_of(truth: VirtualTruth) -> Person:
    """Return the person with these true parameters."""
    # An earlier build did not write every parameter; the default is what it had.
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
    "force_factor", "force_error", "speed_factor", "speed_error", "place_offset_m", "tremor",
)  # fmt: skip
SENSITIVE = Population(
    typical=replace(
        DEFAULT.typical, felt_noise=0.015, **{name: getattr(_EXACT, name) for name in _OF_TOUCHES}
    ),
    varied=MappingProxyType(
        {name: how for name, how in DEFAULT.varied.items() if name not in _OF_TOUCHES}
        | dict.fromkeys(("criterion", "criterion_less"), LogNormal(median=0.025, log_sd=0.2))
    ),
)
"""As `DEFAULT`, but they touch as instructed and feel small changes.

The paper's nine people said what was expected in all 45 trials.
"""
