"""A virtual person: its parameters, each with unit, limits, meaning and source."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Annotated, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from device.beam.modes import FloatArray

TABLE_4 = "the paper's Table 4"
ASSUMED = "assumed"


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """What a parameter means, in which unit and between which limits, and where it is from."""

    meaning: str
    unit: str
    source: str
    low: float = 0.0
    high: float = 1.0


def _points(
    meaning: str, source: str = TABLE_4, low: float = -50.0, high: float = 50.0
) -> Parameter:
    return Parameter(meaning=meaning, unit="points", source=source, low=low, high=high)


def _share(meaning: str, source: str, low: float = 0.0, high: float = 1.0) -> Parameter:
    return Parameter(meaning=meaning, unit="share", source=source, low=low, high=high)


_OFF_THE_LINE = "Table 4: what its column means leave over a straight line in the contrast"


@dataclass(frozen=True, kw_only=True)
class Person:
    """A virtual person.

    Scores are on the paper's scale of 0 to 10, whatever the study's. A felt change is one of log
    friction:

        score = bias + gain · |felt| + what the kind of change adds + drift + noise

    The defaults are a person who errs in nothing but feeling and scoring.
    """

    bias: Annotated[float, _points("score of no change")] = 7.0
    gain: Annotated[
        float,
        Parameter(
            meaning="score points per unit of felt change",
            unit="points",
            source=TABLE_4,
            low=-200.0,
            high=200.0,
        ),
    ] = 4.0
    felt_noise: Annotated[
        float,
        Parameter(
            meaning="Weber fraction of friction: SD of a felt change",
            unit="log friction",
            source="Gueorguiev et al. 2017, doi 10.1098/rsif.2017.0641",
            high=10.0,
        ),
    ] = 0.11
    criterion: Annotated[
        float,
        Parameter(
            meaning="a larger felt change is answered as smoother, stronger or swapped",
            unit="log friction",
            source="assumed: people expect a change, and report one on a third of catch trials",
            low=-10.0,
            high=10.0,
        ),
    ] = 0.08
    criterion_less: Annotated[
        float,
        Parameter(
            meaning="a larger felt change the other way is answered as rougher or weaker",
            unit="log friction",
            source="assumed, likewise",
            low=-10.0,
            high=10.0,
        ),
    ] = 0.13
    lapse: Annotated[
        float,
        _share(
            "trials answered at random and scored as no change, whatever is felt",
            "assumed, as usual for psychometric functions: Wichmann and Hill 2001, "
            "doi 10.3758/BF03194544",
        ),
    ] = 0.0
    rating_noise: Annotated[float, _points("SD of the noise of a score", low=0.0)] = 1.0
    beyond_swing: Annotated[
        float, _points("added to a stronger or weaker swing along the path", _OFF_THE_LINE)
    ] = 0.0
    beyond_strength: Annotated[
        float, _points("added to a stronger or weaker effect at a place", _OFF_THE_LINE)
    ] = 0.0
    beyond_ramp: Annotated[
        float, _points("added to a change of roughness during a touch", _OFF_THE_LINE)
    ] = 0.0
    beyond_swap: Annotated[float, _points("added to places that swap", _OFF_THE_LINE)] = 0.0
    beyond_press: Annotated[
        float, _points("added to a change of roughness under a harder press", _OFF_THE_LINE)
    ] = 0.0
    ceiling: Annotated[float, _points("the highest score given", ASSUMED, 0.0, 10.0)] = 10.0
    number_step: Annotated[
        float,
        _points("scores are multiples of it: a person who uses few numbers", ASSUMED, 1.0, 10.0),
    ] = 1.0
    end_aversion: Annotated[
        float, _share("scores at an end of the scale that are moved one step inwards", ASSUMED)
    ] = 0.0
    serial: Annotated[
        float,
        _share(
            "weight of the previous score in this one; below 0: contrast",
            "assumed; assimilation in absolute judgement: Holland and Lockhead 1968",
            low=-1.0,
        ),
    ] = 0.0
    adaptation: Annotated[
        float,
        _share("by how much of the previous felt change this one is felt as smaller", ASSUMED),
    ] = 0.0
    drift: Annotated[float, _points("score points added per trial", ASSUMED)] = 0.0
    fatigue: Annotated[
        float, _share("growth of the noise of feeling and scoring per trial", ASSUMED)
    ] = 0.0
    force_factor: Annotated[
        float,
        Parameter(
            meaning="mean force, relative to the instructed one",
            unit="ratio",
            source=ASSUMED,
            low=0.2,
            high=5.0,
        ),
    ] = 1.0
    force_error: Annotated[
        float, _share("SD of the force from touch to touch, relative to its mean", ASSUMED)
    ] = 0.0
    speed_factor: Annotated[
        float,
        Parameter(
            meaning="mean speed, relative to the mark's",
            unit="ratio",
            source=ASSUMED,
            low=0.2,
            high=5.0,
        ),
    ] = 1.0
    speed_error: Annotated[
        float, _share("SD of the speed from touch to touch, relative to its mean", ASSUMED)
    ] = 0.0
    place_offset_m: Annotated[
        float,
        Parameter(
            meaning="how far right of the mark the finger is",
            unit="m",
            source=ASSUMED,
            low=-0.02,
            high=0.02,
        ),
    ] = 0.0
    tremor: Annotated[
        float, _share("SD of the force within a touch, relative to its mean", ASSUMED)
    ] = 0.0
    skin: Annotated[
        float,
        Parameter(
            meaning="what the skin multiplies the change of log friction by",
            unit="ratio",
            source="assumed; that skins differ: Gueorguiev et al. 2017, doi 10.1098/rsif.2017.0641",
            high=10.0,
        ),
    ] = 1.0
    mu0: Annotated[
        float,
        Parameter(
            meaning="what the skin multiplies friction at rest by",
            unit="ratio",
            source=ASSUMED,
            low=0.01,
            high=10.0,
        ),
    ] = 1.0
    reaction_shift_s: Annotated[
        float,
        Parameter(
            meaning="shortest reaction time",
            unit="s",
            source="assumed, as that the rest is log-normal",
            high=60.0,
        ),
    ] = 0.3
    reaction_median_s: Annotated[
        float,
        Parameter(
            meaning="median of what a reaction time has beyond the shortest",
            unit="s",
            source=ASSUMED,
            high=600.0,
        ),
    ] = 0.8
    reaction_spread: Annotated[
        float,
        Parameter(meaning="SD of the logarithm of that", unit="", source=ASSUMED, high=5.0),
    ] = 0.4
    dropout: Annotated[float, _share("chance of leaving at a question, for good", ASSUMED)] = 0.0


def _parameters() -> dict[str, Parameter]:
    hints = get_type_hints(Person, include_extras=True)
    return {entry.name: get_args(hints[entry.name])[1] for entry in fields(Person)}


PARAMETERS = _parameters()


class People:
    """Many persons: each parameter is an array of shape (people,), under its name."""

    def __init__(self, values: FloatArray) -> None:
        """Take the parameters in the order of `PARAMETERS`, shape (people, parameters)."""
        self._columns = dict(zip(PARAMETERS, np.ascontiguousarray(values.T), strict=True))
        self.size = len(values)

    @classmethod
    def of(cls, persons: Sequence[Person]) -> "People":
        """Return these persons."""
        return cls(np.array([list(vars(person).values()) for person in persons]))

    def __getattr__(self, name: str) -> FloatArray:
        """Return a parameter of all persons."""
        if name.startswith("_") or name not in PARAMETERS:
            raise AttributeError(name)
        return np.asarray(self._columns[name])

    def rows(self, which: NDArray[np.intp]) -> "People":
        """Return the persons at these positions, in this order; one may come more than once."""
        return People(np.stack([column[which] for column in self._columns.values()], axis=-1))

    def __getitem__(self, number: int) -> Person:
        """Return one person."""
        return Person(**{name: float(column[number]) for name, column in self._columns.items()})
