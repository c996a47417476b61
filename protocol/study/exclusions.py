"""The rules by which the report leaves out participants and trials."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from protocol.study.fields import Count, Positive, Record, Share


class Exclusions(Record):
    """Rules that were settled beforehand; the report applies them and says whom they met."""

    max_false_alarms: Annotated[
        Share | None, Field(description="share of catch trials on which a change was reported")
    ] = None
    max_missing_scores: Annotated[
        Share | None, Field(description="share of a participant's scores that is missing")
    ] = None
    # A limit of more than half a minute would leave out everybody: it is in ms.
    min_reaction_s: Annotated[
        Positive | None, Field(le=30, description="a trial answered sooner is left out")
    ] = None
    # Nobody answers within 0.1 s, and 600 s leave out nobody.
    max_reaction_s: Annotated[
        Positive | None, Field(ge=0.1, le=600, description="a trial answered later is left out")
    ] = None
    min_trials: Annotated[
        Count | None, Field(description="a participant with fewer valid trials is left out")
    ] = None

    @model_validator(mode="after")
    def _some_time_is_left(self) -> Self:
        fastest, slowest = self.min_reaction_s, self.max_reaction_s
        if fastest is not None and slowest is not None and fastest >= slowest:
            raise ValueError(
                f"min_reaction_s must be less than max_reaction_s = {slowest:g}, got {fastest:g}"
            )
        return self
