"""The rules of a session: its languages, what it asks of the operator, consent, resuming."""

from typing import Annotated, Literal

from pydantic import Field

from protocol.study.fields import Positive, Record
from protocol.study.languages import KnownCode

OperatorQuestion = Literal["skin state", "room temperature", "humidity", "cleaning"]


class SessionRules(Record):
    """What a session is read in, what it asks of the operator, and when it may be resumed."""

    languages: Annotated[
        tuple[KnownCode, ...],
        Field(min_length=1, description="in which all that participants read must be there"),
    ] = ("en", "zh")
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
