"""The rules of a study: what a session asks, allows and repeats, and what the report leaves out."""

from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from protocol.study.fields import Count, Line, NotNegative, Positive, Record, Share, Whole
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


# The design of a study, the pauses and durations of its sessions, and facts for publication.

Order = Literal["williams", "blocks", "random", "fixed"]
Grouping = Literal["no", "block", "session"]
MOST_REPEATS = 20
"""Of a condition in a session."""
Pause = Annotated[NotNegative, Field(le=600)]
"""Within a trial or before it, s: more than 10 minutes are in ms."""
ReadableTime = Annotated[NotNegative, Field(le=10)]
"""Of a page, s: with more than 10 s people take the button for broken."""
LongPause = Annotated[NotNegative, Field(le=3_600)]
"""Between trials, s: more than an hour ends the session."""


class Design(Record):
    """Which trials there are and how they are ordered over the cohort."""

    order: Annotated[
        Order,
        Field(
            description="`williams`: balanced over the cohort; `blocks`: every block a random "
            "order of all conditions; `random`: all trials shuffled, as many to a block as there "
            "are conditions; `fixed`: as in the file"
        ),
    ] = "williams"
    repeats: Annotated[
        Count,
        Field(
            le=MOST_REPEATS, description="how often a participant gets each condition, per session"
        ),
    ] = 1
    max_alike_in_row: Annotated[
        Count,
        Field(description="largest number of scored trials of one condition in a row"),
    ] = 2
    practice_trials: Annotated[
        Whole,
        Field(
            le=20,
            description="number of trials before the first block, of conditions on the study's own "
            "beam, at the last of their levels; never analysed",
        ),
    ] = 0
    catch_trials: Annotated[
        Whole,
        Field(
            le=50,
            description="number of trials at 0 V among the others, in which nothing changes; of "
            "any condition on the mounted beam, also the one that was just felt",
        ),
    ] = 0
    catch_apart: Annotated[
        Count, Field(description="smallest number of other trials between two catch trials")
    ] = 1
    opposite_repeats: Annotated[
        Whole,
        Field(
            description="number of repeats of a condition in which the touches come in the "
            "opposite order, so that the opposite answer is expected"
        ),
    ] = 0
    group_by_beam: Annotated[
        Grouping,
        Field(
            description="whether trials with the same beam come together, within each block or "
            "over the session; carry-over is then not balanced"
        ),
    ] = "no"
    max_beam_swaps: Annotated[
        Whole | None,
        Field(
            description="largest number per session; trials are grouped further if this is "
            "necessary"
        ),
    ] = None
    break_every_blocks: Annotated[
        Whole, Field(description="number of blocks between two breaks; 0: no break")
    ] = 0
    break_s: Annotated[LongPause, Field(description="shortest duration of a break")] = 60.0
    sessions: Annotated[
        Count, Field(le=50, description="number of sessions of each participant")
    ] = 1
    participants: Annotated[
        Count | None, Field(le=10_000, description="planned size of the cohort")
    ] = None

    @model_validator(mode="after")
    def _some_repeats_are_not_opposite(self) -> Self:
        if self.opposite_repeats >= self.repeats:
            raise ValueError(
                f"opposite_repeats must be less than repeats = {self.repeats}, "
                f"got {self.opposite_repeats}"
            )
        return self


class Timing(Record):
    """Pauses that the session keeps, and assumptions from which its duration is estimated.

    A session waits for as long as a pause says. What is assumed is waited for by nobody: it enters
    the length that `touchbeam check` foresees, the time left that the operator sees, and the limit
    on it.
    """

    between_touches_s: Annotated[Pause, Field(description="pause within a trial")] = 1.0
    inter_trial_s: Annotated[Pause, Field(description="pause before a trial")] = 2.0
    readable_s: Annotated[
        ReadableTime, Field(description="how long a page is shown before its button works")
    ] = 1.0
    reading_s: Annotated[Pause, Field(description="assumed time to read an instruction")] = 4.0
    answer_s: Annotated[Pause, Field(description="assumed time to answer a question")] = 5.0
    score_s: Annotated[Pause, Field(description="assumed time to give a score")] = 5.0
    beam_swap_s: Annotated[LongPause, Field(description="assumed time to mount another beam")] = (
        60.0
    )
    max_session_s: Annotated[
        Positive, Field(le=14_400, description="longest session that may be planned")
    ] = 5_400.0


class Publication(Record):
    """Facts that only the study's author knows, for exported data; none is ever invented."""

    title: Annotated[Line | None, Field(description="title of the data set")] = None
    authors: Annotated[tuple[Line, ...], Field(description="authors in the order of citation")] = ()
    licence: Annotated[Line | None, Field(description="such as `CC0`")] = None
    institution: Annotated[Line | None, Field(description="where the study was done")] = None
    institution_address: Annotated[Line | None, Field(description="address of the institution")] = (
        None
    )
    ethics_approvals: Annotated[
        tuple[Line, ...], Field(description="committee and reference number")
    ] = ()
    funding: Annotated[tuple[Line, ...], Field(description="grants")] = ()
    references: Annotated[tuple[Line, ...], Field(description="what to read and cite")] = ()
    doi: Annotated[Line | None, Field(description="DOI of the data set")] = None
    keywords: Annotated[tuple[Line, ...], Field(description="keywords of the data set")] = ()


# The scale of scores: its ends, its ticks and its bands; and the spread expected of scores.

Score = Annotated[Whole, Field(le=1_000)]
"""Whole, so that it can be typed and counted."""


class Band(Record):
    """A range of scores, and its name in each language by the language's code."""

    # Languages are keys beside `from` and `to`. Which of them exist only the whole study knows.
    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[
        str, Annotated[Line, Field(description="its name in that language, such as `en`")]
    ] = Field(init=False)

    first: Annotated[Score, Field(alias="from", description="lowest score of the band")]
    last: Annotated[Score, Field(alias="to", description="highest score of the band")]

    @property
    def names(self) -> dict[str, str]:
        """The names that the study file gives, by language."""
        return self.__pydantic_extra__


PAPERS_BANDS = {
    (0, 0): "no effect",
    (1, 4): "very weak",
    (5, 7): "general",
    (8, 10): "very effective",
}
"""The paper's names of its scores (section 5.2): first and last score, and the key in languages."""


class Rating(Record):
    """When and on which scale the effect is scored, and how the scores are named."""

    score_when: Annotated[
        Literal["agrees", "always"],
        Field(description="ask for the score only if the answer agrees with the expectation"),
    ] = "agrees"
    minimum: Annotated[Score, Field(description="lowest score")] = 0
    maximum: Annotated[Score, Field(description="highest score, above the lowest")] = 10
    ticks: Annotated[
        Literal["all", "bands", "ends"], Field(description="which scores are marked on the scale")
    ] = "all"
    bands: Annotated[
        tuple[Band, ...], Field(description="names of ranges, which together cover the scale")
    ] = ()

    @model_validator(mode="after")
    def _ends_are_apart(self) -> Self:
        if self.minimum >= self.maximum:
            raise ValueError(f"maximum must be above minimum = {self.minimum}, got {self.maximum}")
        return self

    @model_validator(mode="after")
    def _bands_cover_the_scale(self) -> Self:
        # Every score once and in order: overlaps, gaps and bands out of order all differ from that
        # list.
        covered = [score for band in self.bands for score in range(band.first, band.last + 1)]
        if self.bands and covered != list(range(self.minimum, self.maximum + 1)):
            spans = ", ".join(f"{band.first}-{band.last}" for band in self.bands)
            raise ValueError(
                f"bands must follow one another from {self.minimum} to {self.maximum}, got {spans}"
            )
        return self

    @property
    def span(self) -> int:
        """How far the ends of the scale are apart."""
        return self.maximum - self.minimum


# Validated as any study's scale, so that the paper's bands are known to cover it.
PAPERS_SCALE = Rating.model_validate(
    {
        "bands": [
            {"from": first, "to": last, "en": name} for (first, last), name in PAPERS_BANDS.items()
        ]
    }
)
"""From 0 to 10 (section 5.2)."""


class Forecast(Record):
    """Standard deviations of ratings on the paper's scale of 0 to 10, from its Table 4.

    `residual_sd` is that about each person's own line (27 df); the others are M2's medians.
    """

    residual_sd: Annotated[
        Positive,
        Field(le=10, description="SD of a score about the participant's own line, points"),
    ] = 1.48
    off_the_line_sd: Annotated[
        NotNegative,
        Field(
            le=10,
            description="SD between conditions of what they add for everybody beside the "
            "predicted contrast, points",
        ),
    ] = 1.8
    gain_sd: Annotated[
        NotNegative,
        Field(le=1000, description="SD of gains between people, points per unit of contrast"),
    ] = 4.1
