"""The base of a study's records: what their numbers, names and lines of text may be."""

import re
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo
from pydantic_core import PydanticKnownError

# Control characters could rewrite a terminal, and signs that turn the direction of writing could
# make a text read as another one. Halves of a character (surrogates) cannot be written to a file.
_UNPRINTABLE = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
UNWANTED = "must hold no control characters and none that turn the direction of writing"


def unprintable(text: str) -> bool:
    """Return whether `text` holds control characters or such as turn the direction of writing.

    Tabs and line ends are neither.
    """
    return _UNPRINTABLE.search(text) is not None


def printable(text: str) -> str:
    r"""Return `text` with U+FFFD in place of such characters.

    >>> ascii(printable("bell \x07"))
    "'bell \\ufffd'"
    """
    return _UNPRINTABLE.sub("\ufffd", text)


def require_printable(text: str) -> str:
    """Return `text`, or raise a ValueError if it holds such characters."""
    if unprintable(text):
        raise ValueError(UNWANTED)
    return text


def required(holds: Callable[[str], object], rule: str) -> AfterValidator:
    """Return what refuses a text of which something does not hold, and says the rule."""

    def fitting(text: str) -> str:
        if not holds(text):
            raise ValueError(rule)
        return text

    return AfterValidator(fitting)


LONGEST_NAME = 64

# `strict`: a number in quotes is a slip in the file, and must not pass for a number.
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False, strict=True)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False, strict=True)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False, strict=True)]
Whole = Annotated[int, Field(ge=0, strict=True)]
Count = Annotated[int, Field(ge=1, strict=True)]
Name = Annotated[
    str, Field(min_length=1, max_length=LONGEST_NAME), AfterValidator(require_printable)
]
Line = Annotated[str, Field(min_length=1, max_length=500)]

Names = Callable[[], Iterable[str]]
"""Of what there is, looked up when somebody asks."""


def known_as(kind: str) -> BeforeValidator:
    """Return what refuses a name that the validation's context does not list under `kind`.

    The context holds `Names`. Where it has none of that kind, any name will do.
    """

    def known(name: Any, info: ValidationInfo) -> Any:
        names: Names | None = (info.context or {}).get(kind)
        there = None if names is None else tuple(names())
        # pydantic's own error, so that it reads as the one for a choice that stands in the schema.
        if there is not None and name not in there:
            raise PydanticKnownError("literal_error", {"expected": alternatives(there)})
        return name

    return BeforeValidator(known)


def alternatives(names: Sequence[str]) -> str:
    """Return `names` as a choice.

    >>> alternatives(["board", "keysight", "rigol"])
    "'board', 'keysight' or 'rigol'"
    """
    *first, last = map(repr, names)
    return f"{', '.join(first)} or {last}" if first else last


class Record(BaseModel):
    """Frozen, keyword-only, no unknown keys; a number is never read from a text."""

    # An unknown key is refused, because a misspelt limit would otherwise be no limit.
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)


def setting(default: Any, meaning: str | None = None, **limits: Any) -> Any:
    """Return a key of a record that may be left out: its value then, its meaning, its limits.

    A meaning that takes more than the line of the key stands below it; docs/study-file.md has both.
    """
    return Field(default, description=meaning, **limits)
