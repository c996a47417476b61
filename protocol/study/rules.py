"""The rules of a study: design, timing, rating, sessions, exclusions, publication."""

from math import inf
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, model_validator

from protocol.study.fields import (
    Count,
    Line,
    Name,
    NotNegative,
    Positive,
    Record,
    Share,
    Whole,
    setting,
)
from protocol.study.languages import KnownCode

Hand = Literal["left", "right"]
Finger = Literal["thumb", "index", "middle", "ring", "little"]
OperatorQuestion = Literal["skin state", "room temperature", "humidity", "cleaning"]


class SessionRules(Record):
    """What a session is read in, what it asks of the operator, and when it may be resumed."""

    languages: tuple[KnownCode, ...] = setting(("en", "zh"), min_length=1)
    """languages in which every text for participants must be given"""
    hand: Hand = setting("left", "the hand that touches; the texts name it")
    finger: Finger = "index"
    """the finger of that hand, if one finger touches; the texts name it"""
    language: KnownCode = setting("en", "language of the texts unless `--language` names another")
    answer_order: Literal["fixed", "counterbalanced"] = "fixed"
    """`counterbalanced`: every other participant sees the answers of choices from last to first"""
    operator_asks: tuple[OperatorQuestion, ...] = ()
    """what the operator notes before the first trial: the skin is dry, normal or moist, the
    temperature 0 to 50 °C, the humidity 0 to 100%; Enter skips a question"""
    blind_operator: bool = setting(False, strict=True)
    """hide conditions, levels, drives and answers from the operator until the session ends; whether
    the output is on, alarms and limits stay"""
    consent_required: bool = setting(False, strict=True)
    """refuse a session without a reference to the consent"""
    resume_within_h: Positive = setting(24.0, le=720)
    """an interrupted session older than this is not resumed"""
    practise_again: Literal["never", "on resume"] = "never"
    """whether a resumed session practises"""


class TouchRules(Record):
    """When a touch was made as instructed, and what follows if it was not.

    Force and position must be measured: on a rig without sensors no touch is judged.
    """

    # people do not press evenly
    force_within: Positive = setting(0.5, le=10)
    """largest deviation of the median force, relative to the instructed one"""
    # half the length of a finger's contact
    place_within_m: Positive = setting(0.005, le=0.1)
    """largest distance of the finger from the place to touch"""
    path_within: Positive = setting(0.5, le=10)
    """largest deviation of the distance slid, relative to the path"""
    speed_within: Positive | None = setting(None, le=10)
    """largest deviation of the median speed of a slide, relative to the mark's; not judged without
    this"""
    retries: Whole = setting(0, le=20)
    """how often a trial comes again, later in its block, if one of its touches was not as
    instructed; the last attempt counts in any case"""
    feedback: Literal["never", "practice", "always"] = "never"
    """in which trials participants see their own force and movement"""
    practise_until: Whole = setting(0, le=100)
    """practice is repeated until this many of the last `practise_of` touches were as instructed; 0:
    practice comes once"""
    practise_of: Count = setting(1, "see `practise_until`", le=100)
    practice_rounds: Count = setting(3, le=20)
    """largest number of times that practice comes, the first time included"""

    @model_validator(mode="after")
    def _enough_touches_are_looked_at(self) -> Self:
        if self.practise_until > self.practise_of:
            most, wanted = self.practise_of, self.practise_until
            raise ValueError(f"practise_until must be at most practise_of = {most}, got {wanted}")
        return self


class Exclusions(Record):
    """Rules that were settled beforehand; the report applies them and says whom they met."""

    max_false_alarms: Share | None = None
    """a participant who reports a change on a larger share of catch trials is left out"""
    max_missing_scores: Share | None = None
    """a participant with a larger share of planned trials without an answer is left out"""
    # A limit of more than half a minute would leave out everybody: it is in ms.
    min_reaction_s: Positive | None = setting(None, "a trial answered sooner is left out", le=30)
    # Nobody answers within 0.1 s, and 600 s leave out nobody.
    max_reaction_s: Positive | None = setting(None, ge=0.1, le=600)
    """a trial answered later is left out"""
    min_trials: Count | None = setting(None, "a participant with fewer valid trials is left out")

    @model_validator(mode="after")
    def _some_time_is_left(self) -> Self:
        fastest, slowest = self.min_reaction_s, self.max_reaction_s
        if fastest is not None and slowest is not None and fastest >= slowest:
            rule = f"min_reaction_s must be less than max_reaction_s = {slowest:g}"
            raise ValueError(f"{rule}, got {fastest:g}")
        return self


SELECTS = {
    "max_false_alarms": "leaves out participants with a low criterion, who report changes where "
    "there are none; it spares those who notice little.",
    "max_missing_scores": "counts trials without an answer{kept}.",
    "min_reaction_s": "leaves out trials, also good ones where what is felt is so clear that it "
    "is answered fast.",
    "max_reaction_s": "leaves out trials, more of them where what is felt is hard to judge and "
    "takes long to answer.",
    "min_trials": "counts answered trials, whatever the answers{kept}.",
}
"""Whom or what each rule of `Exclusions` selects, which is what its author should know of it."""
_KEPT = "; a participant who notices little is kept"


def selections(rules: Exclusions, *, asked: bool = True) -> list[dict[str, str | float]]:
    """Return each rule that the study settled, with its limit and what it selects.

    Of noticing something is said only where participants are `asked` whether anything changed.
    """
    settled = rules.model_dump(exclude_none=True)
    return [
        {"rule": name, "limit": limit, "selects": SELECTS[name].format(kept=_KEPT * asked)}
        for name, limit in settled.items()
    ]


# The design of a study, the pauses and durations of its sessions, and facts for publication.

Order = Literal["williams", "blocks", "random", "fixed"]
Grouping = Literal["no", "block", "session"]
MOST_REPEATS = 20
"""Of a condition in a session."""
MOST_HOURS_BETWEEN = 87_600
"""Ten years: longer ones would leave the calendar."""
Pause = Annotated[NotNegative, Field(le=600)]
"""Within a trial or before it, s: more than 10 minutes are in ms."""
ReadableTime = Annotated[NotNegative, Field(le=10)]
"""Of a page, s: with more than 10 s people take the button for broken."""
LongPause = Annotated[NotNegative, Field(le=3_600)]
"""Between trials, s: more than an hour ends the session."""


class Design(Record):
    """Which trials there are and how they are ordered over the cohort."""

    order: Order = "williams"
    """`williams`: balanced over the cohort; `blocks`: every block a random order of all conditions;
    `random`: all trials shuffled, as many to a block as there are conditions; `fixed`: as in the
    file"""
    repeats: Count = setting(1, le=MOST_REPEATS)
    """how often a participant gets each condition, per session"""
    max_alike_in_row: Count = 2
    """largest number of scored trials of one condition in a row"""
    practice_trials: Whole = setting(0, le=20)
    """number of trials before the first block, of conditions on the study's own beam, at the last
    of their levels; never analysed"""
    catch_trials: Whole = setting(0, le=50)
    """number of trials at 0 V among the others, in which nothing changes; of any condition on the
    mounted beam, also the one that was just felt; a score is asked in them only where the
    conditions have no question"""
    catch_apart: Count = setting(1, "smallest number of other trials between two catch trials")
    opposite_repeats: Whole = 0
    """number of repeats of a condition in which the touches come in the opposite order, so that the
    opposite answer is expected"""
    group_by_beam: Grouping = "no"
    """whether trials with the same beam come together, within each block or over the session;
    carry-over is then not balanced"""
    max_beam_swaps: Whole | None = None
    """largest number per session; trials are grouped further if this is necessary"""
    break_every_blocks: Whole = setting(0, "number of blocks between two breaks; 0: no break")
    break_s: LongPause = setting(60.0, "shortest duration of a break")
    tracks: Literal["interleaved", "one after another"] = "interleaved"
    """how the trials of several `[[track]]` follow each other, after those of the conditions;
    interleaved: each comes once, in random order, before one comes again"""
    track_block: Count = setting(40, le=500)
    """number of trials of tracks in a block, between which breaks and questions come"""
    sessions: Count = setting(1, "number of sessions of each participant", le=50)
    hours_between: tuple[NotNegative, Annotated[float, Field(gt=0, strict=True)]] | None = None
    """least and most hours from the end of a participant's session to the beginning of the next;
    `[20, inf]`: at least 20; `run --override` lets one begin at another time"""
    participants: Count | None = setting(None, le=10_000)
    """planned size of the cohort; by default that of all groups together"""
    assign_groups: Literal["by the operator", "at random", "by an answer"] = "by the operator"
    """who says to which `[[group]]` a participant belongs: the operator, with `run --group`;
    chance, in blocks that hold every group in proportion to its size; or the answer to a question
    that the operator is asked"""

    @model_validator(mode="after")
    def _some_hours_are_left(self) -> Self:
        least, most = self.hours_between or (0.0, 1.0)
        if least >= most:
            raise ValueError(f"hours_between must rise, got {least:g} to {most:g}")
        if max(least, most if most != inf else 0.0) > MOST_HOURS_BETWEEN:
            rule = (
                f"hours_between must be at most {MOST_HOURS_BETWEEN}, ten years, or inf at the end"
            )
            raise ValueError(f"{rule}, got {least:g} to {most:g}")
        if self.hours_between is not None and self.sessions == 1:
            raise ValueError("sessions must be above 1 where hours_between is given, got 1")
        return self

    @model_validator(mode="after")
    def _some_repeats_are_not_opposite(self) -> Self:
        if self.opposite_repeats >= self.repeats:
            rule = f"opposite_repeats must be less than repeats = {self.repeats}"
            raise ValueError(f"{rule}, got {self.opposite_repeats}")
        return self


def hours_in_words(least: float, most: float) -> str:
    """Return how long two sessions are apart.

    >>> hours_in_words(20, 72), hours_in_words(20, inf)
    ('20 to 72 hours', 'at least 20 hours')
    """
    return f"at least {least:g} hours" if most == inf else f"{least:g} to {most:g} hours"


class Timing(Record):
    """Pauses that the session keeps, and assumptions from which its duration is estimated.

    A session waits for as long as a pause says. What is assumed is waited for by nobody: it enters
    the length that `touchbeam check` foresees, the time left that the operator sees, and the limit
    on it.
    """

    between_touches_s: Pause = setting(1.0, "pause within a trial")
    inter_trial_s: Pause = setting(2.0, "pause before a trial")
    readable_s: ReadableTime = setting(1.0, "how long a page is shown before its button works")
    reading_s: Pause = setting(4.0, "assumed time to read an instruction")
    answer_s: Pause = setting(5.0, "assumed time to answer a question")
    score_s: Pause = setting(5.0, "assumed time to give a score")
    beam_swap_s: LongPause = setting(60.0, "assumed time to mount another beam")
    max_session_s: Positive = setting(5_400.0, "longest session that may be planned", le=14_400)


class Publication(Record):
    """Facts that only the study's author knows, for exported data; none is ever invented."""

    title: Line | None = setting(None, "title of the data set")
    authors: tuple[Line, ...] = setting((), "authors in the order of citation")
    licence: Line | None = setting(None, "such as `CC0`")
    institution: Line | None = setting(None, "where the study was done")
    institution_address: Line | None = setting(None, "address of the institution")
    ethics_approvals: tuple[Line, ...] = setting((), "committee and reference number")
    funding: tuple[Line, ...] = setting((), "grants")
    references: tuple[Line, ...] = setting((), "what to read and cite")
    doi: Line | None = setting(None, "DOI of the data set")
    keywords: tuple[Line, ...] = setting((), "keywords of the data set")


# The scale of scores: its ends, its ticks and its bands; and the spread expected of scores.

Score = Annotated[int, Field(ge=-1_000, le=1_000, strict=True)]
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


ScalePlace = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False, strict=True)]
"""On a scale."""


class Label(Record):
    """An answer to choose, or a label of a place on a scale, by the language's code."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[
        str, Annotated[Line, Field(description="what is read in that language, such as `en`")]
    ] = Field(init=False)

    value: Name | None = setting(None, "what is recorded, for `choice` and `several`")
    at: ScalePlace | None = setting(None, "the place, for `scale` and `analogue` (0 or 100)")

    @property
    def names(self) -> dict[str, str]:
        """What is read, by language."""
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

    score_when: Literal["agrees", "noticed", "always"] = "agrees"
    """of conditions with a question: ask for the score only if the answer agrees with the
    expectation, if it says that anything changed, or always; never in catch trials: a missing page
    tells the participant of one"""
    minimum: Score = setting(0, "lowest score")
    maximum: Score = setting(10, "highest score, above the lowest")
    known: bool = setting(True, strict=True)
    """of imported scores: false if nobody said where the scale ends; minimum and maximum are then
    the lowest and the highest score there is"""
    ticks: Literal["all", "bands", "labels", "ends"] = "all"
    """which scores are marked on the scale"""
    bands: tuple[Band, ...] = setting((), "names of ranges, which together cover the scale")
    labels: tuple[Label, ...] = ()
    """instead of bands: names of single scores, such as both ends"""

    def asks_score(self, *, agrees: Any, noticed: Any) -> Any:
        """Return whether an answer leads to the score: truth values, or arrays of them."""
        return {"agrees": agrees, "noticed": noticed, "always": agrees | True}[self.score_when]

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

    @model_validator(mode="after")
    def _labels_name_single_scores(self) -> Self:
        if self.labels and self.bands:
            raise ValueError("labels must be left out where bands are given, got both")
        places = [label.at for label in self.labels if label.value is None]
        if len(places) < len(self.labels) or None in places:
            raise ValueError('labels must each have a score alone, such as { at = 1, en = "…" }')
        scores = range(self.minimum, self.maximum + 1)
        for number, place in enumerate(places):
            if place not in scores:
                rule = f"labels must be at whole numbers from {self.minimum} to {self.maximum}"
                raise ValueError(f"{rule}, got {place:g}")
            if place in places[:number]:
                raise ValueError(f"labels must be at scores that differ, got {place:g} twice")
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
