"""Factors, what varies between touches, crossed into named conditions; groups of participants."""

from collections.abc import Iterator, Sequence
from itertools import product
from math import prod
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    StrictFloat,
    StrictInt,
    StrictStr,
    ValidationError,
    ValidationInfo,
    field_validator,
)

from protocol.study.fields import Count, Name, Record
from protocol.study.study_question import AskedIf
from protocol.study.touch import Touch

Varied = Literal[
    "voltage_v", "ramp_to_v", "frequency", "frequency_hz", "sweep_to", "sweep_to_hz", "press",
    "sliding_speed_m_s", "direction", "place", "coverage", "beam", "duration_s", "instruction",
]  # fmt: skip
_UNITS = {"_v": "V", "_hz": "Hz", "_m_s": "m/s", "_s": "s"}
MOST_CONDITIONS = 30
"""Written or crossed: with more a session is too long, and a table cannot be read."""
CONDITION = "condition"
"""Names the factor whose values are the conditions of the file, where it has several."""


def _plain(value: object) -> object:
    # Asked first, because each kind of the union would have an error of its own.
    if type(value) in {str, int, float}:
        return value
    raise ValueError("must be a text or a number")


_Value = Annotated[StrictStr | StrictInt | StrictFloat, BeforeValidator(_plain)]


class Factor(Record):
    """What varies: each value of it meets each value of every other factor, in each condition."""

    name: Annotated[Name, Field(description="name in tables and reports")]
    varies: Annotated[Varied, Field(description="the key of a touch that it sets")]
    values: tuple[_Value, ...] = Field(min_length=2, max_length=MOST_CONDITIONS)
    """what the key is set to"""
    touches: Literal["first", "last", "all"] = "last"
    """which touches of a condition it sets"""
    labels: tuple[Name, ...] = ()
    """names of the values, in their order; without them a name says the value and its unit"""

    @field_validator("values")
    @classmethod
    def _of_a_touch(cls, values: tuple[Any, ...], info: ValidationInfo) -> tuple[Any, ...]:
        for number, value in enumerate(values):
            try:
                Touch.model_validate({"place": "path", "voltage_v": 0, info.data["varies"]: value})
            except ValidationError as error:
                wrong = error.errors()[0]
                # pydantic's own error, so that it reads as one of the touch itself; of this entry.
                own: Any = {**wrong, "loc": (number,)}
                raise ValidationError.from_exception_data("values", [own]) from None
            except KeyError:
                return values  # what it varies is wrong, and that is told
        if len(set(values)) < len(values):
            raise ValueError("must differ")
        return values

    @field_validator("labels")
    @classmethod
    def _one_each(cls, labels: tuple[str, ...], info: ValidationInfo) -> tuple[str, ...]:
        count = len(info.data.get("values", labels))
        if labels and (len(labels) != count or len(set(labels)) != count):
            raise ValueError(f"must be as many as values, {count}, and differ")
        return labels

    @property
    def named(self) -> tuple[str, ...]:
        """What each value is called."""
        return self.labels or tuple(map(self._said, self.values))

    @property
    def unit(self) -> str | None:
        """The unit of the values, if they have one."""
        return next((unit for ending, unit in _UNITS.items() if self.varies.endswith(ending)), None)

    def _said(self, value: float | str) -> str:
        if isinstance(value, str):
            return f"{self.name} {value}"
        if self.unit == "Hz":
            return f"{value / 1000:.10g} kHz"
        return f"{value:g} {self.unit}" if self.unit else f"{self.name} {value:g}"

    def set_in(self, touches: Sequence[Touch], value: float | str) -> tuple[Touch, ...]:
        """Return a condition's touches with this value."""
        chosen = self.numbers(len(touches))
        update = {str(self.varies): value if isinstance(value, str) else float(value)}
        return tuple(
            touch.model_copy(update=update if number in chosen else {})
            for number, touch in enumerate(touches)
        )

    def numbers(self, count: int) -> set[int]:
        """Return which of a condition's `count` touches it sets, from 0."""
        return {"first": {0}, "last": {count - 1}, "all": set(range(count))}[self.touches]

    def given_twice(self, touches: Sequence[Touch]) -> tuple[int, ...]:
        """Return which of a condition's touches give the key themselves, and need not."""
        # Place and voltage have no default, so that a touch must say something there.
        if Touch.model_fields[self.varies].is_required():
            return ()
        chosen = self.numbers(len(touches))
        return tuple(number for number in chosen if self.varies in touches[number].model_fields_set)


def cells(factors: Sequence[Factor]) -> Iterator[tuple[tuple[int, ...], tuple[str, ...]]]:
    """Yield each combination of the factors: places among their values, and what they are called.

    The last factor varies fastest.
    """
    for at in product(*(range(len(factor.values)) for factor in factors)):
        yield at, tuple(factor.named[place] for factor, place in zip(factors, at, strict=True))


def combinations(factors: Sequence[Factor]) -> int:
    """Return how many conditions each one of the file becomes."""
    return prod(len(factor.values) for factor in factors)


class Group(Record):
    """Participants who are compared with those of other groups."""

    name: Annotated[Name, Field(description="name in tables and reports")]
    size: Annotated[Count, Field(le=10_000, description="planned number of participants")]
    when: AskedIf | None = None
    """for `assign_groups = "by an answer"`: the answer that leads into this group; a table as
    `asked_if` of a question"""
