"""How a session is conducted, who is excluded from the analysis, and what data for others say."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from protocol.record import Count, Line, Positive, Record, Share

OperatorQuestion = Literal["skin state", "room temperature", "humidity", "cleaning"]


class Conduct(Record):
    """What a session asks of the operator, and when it may be resumed."""

    operator_asks: Annotated[
        tuple[OperatorQuestion, ...],
        Field(description="what the operator notes before the first trial"),
    ] = ()
    consent_required: Annotated[
        bool, Field(strict=True, description="refuse a session without a reference to the consent")
    ] = False
    resume_within_h: Annotated[
        Positive, Field(le=720, description="an interrupted session older than this is not resumed")
    ] = 24.0
    practise_again: Annotated[
        Literal["never", "on resume"], Field(description="whether a resumed session practises")
    ] = "never"


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
        Positive | None,
        Field(ge=0.1, le=600, description="a trial answered later is left out"),
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


class Publication(Record):
    """Facts that only the study's author knows, for exported data; none is ever invented."""

    title: Annotated[Line | None, Field(description="of the data set")] = None
    authors: Annotated[tuple[Line, ...], Field(description="in the order of citation")] = ()
    licence: Annotated[Line | None, Field(description="such as `CC0`")] = None
    institution: Annotated[Line | None, Field(description="where it was done")] = None
    institution_address: Annotated[Line | None, Field(description="of the institution")] = None
    ethics_approvals: Annotated[
        tuple[Line, ...], Field(description="committee and reference number")
    ] = ()
    funding: Annotated[tuple[Line, ...], Field(description="grants")] = ()
    references: Annotated[tuple[Line, ...], Field(description="what to read and cite")] = ()
    doi: Annotated[Line | None, Field(description="of the data set")] = None
    keywords: Annotated[tuple[Line, ...], Field(description="of the data set")] = ()
