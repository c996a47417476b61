"""What a column of exported trials is: name, meaning, unit, levels, where a value comes from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from analysis.trial_records import TrialRecord

Scalar = str | int | float | bool | None
Cell = Scalar | tuple[Scalar, ...]
"""A value, None if there is none; a tuple holds one value per touch."""


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column. A column `per_touch` lists a value for each touch of the trial."""

    name: str
    description: str
    of: Callable[[TrialRecord], Cell]
    unit: str | None = None
    levels: Mapping[str, str] = field(default_factory=dict)
    per_touch: bool = False


YES_NO = {"true": "yes", "false": "no"}
