"""The rules of a study: what a session asks, allows and repeats, and what the report leaves out."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from protocol.study.fields import Count, Positive, Record, Share, Whole
from protocol.study.languages import KnownCode

Hand = Literal["left", "right"]
Finger = Literal["thumb", "index", "middle", "ring", "little"]
OperatorQuestion = Literal["skin state", "room temperature", "humidity", "cleaning"]


class SessionRules(Record):
    """What a session is read in, what it asks of the operator, and when it may be resumed."""

    languages: Annotated[
        tuple[KnownCode, ...],
        Field(
            min_length=1, description="languages in which every text for participants must be given"
        ),
    ] = ("en", "zh")
    hand: Annotated[Hand, Field(description="the hand that touches; the texts name it")] = "left"
    finger: Annotated[
        Finger,
        Field(description="the finger of that hand, if one finger touches; the texts name it"),
    ] = "index"
    language: Annotated[
        KnownCode, Field(description="language of the texts unless `--language` names another")
    ] = "en"
    answer_order: Annotated[
        Literal["fixed", "counterbalanced"],
        Field(
            description="`counterbalanced`: every other participant sees the answers of choices "
            "from last to first"
        ),
    ] = "fixed"
    operator_asks: Annotated[
        tuple[OperatorQuestion, ...],
        Field(
            description="what the operator notes before the first trial: the skin is dry, normal "
            "or moist, the temperature 0 to 50 °C, the humidity 0 to 100%; Enter skips a question"
        ),
    ] = ()
    blind_operator: Annotated[
        bool,
        Field(
            strict=True,
            description="hide conditions, levels, drives and answers from the operator until the "
            "session ends; whether the output is on, alarms and limits stay",
        ),
    ] = False
    consent_required: Annotated[
        bool, Field(strict=True, description="refuse a session without a reference to the consent")
    ] = False
    resume_within_h: Annotated[
        Positive, Field(le=720, description="an interrupted session older than this is not resumed")
    ] = 24.0
    practise_again: Annotated[
        Literal["never", "on resume"], Field(description="whether a resumed session practises")
    ] = "never"


class TouchRules(Record):
    """When a touch was made as instructed, and what follows if it was not.

    Force and position must be measured: on a rig without sensors no touch is judged.
    """

    force_within: Annotated[
        Positive,
        Field(
            le=10,
            description="largest deviation of the median force, relative to the instructed one",
        ),
    ] = 0.5  # people do not press evenly
    place_within_m: Annotated[
        Positive,
        Field(le=0.1, description="largest distance of the finger from the place to touch"),
    ] = 0.005  # half the length of a finger's contact
    path_within: Annotated[
        Positive,
        Field(le=10, description="largest deviation of the distance slid, relative to the path"),
    ] = 0.5
    speed_within: Annotated[
        Positive | None,
        Field(
            le=10,
            description="largest deviation of the median speed of a slide, relative to the "
            "mark's; not judged without this",
        ),
    ] = None
    retries: Annotated[
        Whole,
        Field(
            le=20,
            description="how often a trial comes again, later in its block, if one of its touches "
            "was not as instructed; the last attempt counts in any case",
        ),
    ] = 0
    feedback: Annotated[
        Literal["never", "practice", "always"],
        Field(description="in which trials participants see their own force and movement"),
    ] = "never"
    practise_until: Annotated[
        Whole,
        Field(
            le=100,
            description="practice is repeated until this many of the last `practise_of` touches "
            "were as instructed; 0: practice comes once",
        ),
    ] = 0
    practise_of: Annotated[Count, Field(le=100, description="see `practise_until`")] = 1
    practice_rounds: Annotated[
        Count,
        Field(
            le=20,
            description="largest number of times that practice comes, the first time included",
        ),
    ] = 3

    @model_validator(mode="after")
    def _enough_touches_are_looked_at(self) -> Self:
        if self.practise_until > self.practise_of:
            raise ValueError(
                f"practise_until must be at most practise_of = {self.practise_of}, "
                f"got {self.practise_until}"
            )
        return self


class Exclusions(Record):
    """Rules that were settled beforehand; the report applies them and says whom they met."""

    max_false_alarms: Annotated[
        Share | None,
        Field(
            description="a participant who reports a change on a larger share of catch trials "
            "is left out"
        ),
    ] = None
    max_missing_scores: Annotated[
        Share | None,
        Field(description="a participant with a larger share of missing scores is left out"),
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
