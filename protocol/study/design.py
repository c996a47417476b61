"""The design of a study, the pauses and durations of its sessions, and facts for publication."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from protocol.study.fields import Count, Line, NotNegative, Positive, Record, Whole

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
