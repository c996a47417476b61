"""The study as data: the records that a study file is made of.

Every record is frozen and refuses unknown keys. Quantities are in SI units; a voltage is an
amplitude (peak), a frequency is relative to the resonance that the rig measures.
"""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from protocol.questions import ANSWERS, Question

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=64)]


class Record(BaseModel):
    """Frozen, keyword-only, no unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=False, populate_by_name=True)


class Rig(Record):
    """The device and the limits that no trial may exceed."""

    device: str = "sim"
    nominal_resonance_hz: Positive = 24_221.0
    max_voltage_v: Annotated[float, Field(gt=0, le=200)] = 200.0
    max_frequency_hz: Annotated[float, Field(gt=0, le=100_000)] = 40_000.0
    ramp_v_per_s: Annotated[float, Field(gt=0, le=2_000)] = 400.0
    watchdog_s: Annotated[float, Field(ge=0.1, le=5)] = 0.5


class TouchDefaults(Record):
    """How the finger touches unless a trial says otherwise."""

    force_n: Positive = 0.5
    contact_m: Positive = 0.010
    sliding_speed_m_s: Positive = 0.04
    path_m: tuple[NotNegative, Positive] = (0.010, 0.081)
    smooth_place_m: NotNegative = 0.0414
    hold_s: Positive = 2.0
    beam: Name | None = None

    @model_validator(mode="after")
    def _path_leads_right(self) -> Self:
        if self.path_m[0] >= self.path_m[1]:
            raise ValueError(f"path_m must lead from left to right, got {list(self.path_m)}")
        return self


class Touch(Record):
    """One touch of the beam and what the device does meanwhile.

    `ramp_to_v` lets the amplitude rise while the finger is on the beam; `press` is the touch
    force relative to the study's own.
    """

    place: Literal["path", "smooth"]
    voltage_v: NotNegative
    ramp_to_v: NotNegative | None = None
    frequency: Positive = 1.0
    direction: Literal["right", "left"] = "right"
    press: Positive = 1.0
    beam: Name | None = None
    duration_s: Positive | None = None

    @property
    def end_voltage_v(self) -> float:
        """Amplitude at the end of the touch, V."""
        return self.voltage_v if self.ramp_to_v is None else self.ramp_to_v

    @property
    def peak_voltage_v(self) -> float:
        """Largest amplitude during the touch, V."""
        return max(self.voltage_v, self.end_voltage_v)


class Item(Record):
    """Something to touch and, unless `question` is missing, to answer."""

    question: Question | None = None
    expected: str | None = None
    touches: Annotated[tuple[Touch, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _expected_fits_question(self) -> Self:
        allowed = ANSWERS[self.question] if self.question else (None,)
        if self.expected not in allowed:
            raise ValueError(
                f"expected must be one of {', '.join(map(str, allowed))} "
                f"for the question {self.question}, got {self.expected!r}"
            )
        return self


class Opening(Item):
    """A trial that every session begins with; it is not scored."""

    kind: Literal["baseline", "signal"]


class Condition(Item):
    """A parameter that changes; its effect is scored."""

    name: Name
    question: Question
    expected: str


class Band(Record):
    """The name of a range of scores, in each language."""

    first: Annotated[int, Field(ge=0, alias="from")]
    last: Annotated[int, Field(ge=0, alias="to")]
    en: str
    zh: str


class Rating(Record):
    """When the effect is scored, and how the scores are named (0-10, paper section 5.2)."""

    score_when: Literal["agrees", "always"] = "agrees"
    minimum: Literal[0] = 0
    maximum: Literal[10] = 10
    bands: tuple[Band, ...] = ()

    def checked_score(self, score: int) -> int:
        """Return `score` if it lies on the scale.

        Raises:
            ValueError: it does not.
        """
        if not self.minimum <= score <= self.maximum:
            raise ValueError(f"rating must lie in [{self.minimum}, {self.maximum}], got {score}")
        return score


class Design(Record):
    """How the conditions are ordered over the cohort."""

    order: Literal["williams", "fixed"] = "williams"


class Header(Record):
    """Which study this is."""

    schema_version: Annotated[Literal[1], Field(alias="schema")] = 1
    name: Name
    seed: Annotated[int, Field(ge=0)] = 1


class Study(Record):
    """A whole study, as `study.toml` gives it."""

    study: Header
    rig: Rig = Rig()
    touch: TouchDefaults = TouchDefaults()
    beams: dict[Name, NotNegative] = {}
    design: Design = Design()
    rating: Rating = Rating()
    opening: tuple[Opening, ...] = ()
    condition: Annotated[tuple[Condition, ...], Field(min_length=1)]

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions in the order of the file."""
        return tuple(condition.name for condition in self.condition)
