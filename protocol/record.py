"""What all records of a study have in common, and the kinds of number they hold."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from protocol.unprintable import require_printable

LONGEST_NAME = 64

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False, strict=True)]
Whole = Annotated[int, Field(ge=0, strict=True)]
Count = Annotated[int, Field(ge=1, strict=True)]
Name = Annotated[
    str, Field(min_length=1, max_length=LONGEST_NAME), AfterValidator(require_printable)
]
Line = Annotated[str, Field(min_length=1, max_length=500)]


class Record(BaseModel):
    """Frozen, keyword-only, no unknown keys; a number is never read from a text."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)
