"""The pauses of a session, and the durations from which its length is estimated.

A session waits for as long as a pause says. What is assumed is waited for by nobody: it enters the
length that `touchbeam check` foresees, the time left that the operator sees, and the limit on it.
"""

from typing import Annotated

from pydantic import Field

from protocol.study.fields import NotNegative, Positive, Record

Pause = Annotated[NotNegative, Field(le=600)]
"""Within a trial or before it, s: more than 10 minutes are in ms."""
ReadableTime = Annotated[NotNegative, Field(le=10)]
"""Of a page, s: with more than 10 s people take the button for broken."""
LongPause = Annotated[NotNegative, Field(le=3_600)]
"""Between trials, s: more than an hour ends the session."""


class Timing(Record):
    """Pauses that the session keeps, and assumptions from which its duration is estimated."""

    between_touches_s: Annotated[Pause, Field(description="pause within a trial")] = 1.0
    inter_trial_s: Annotated[Pause, Field(description="pause before a trial")] = 2.0
    readable_s: Annotated[
        ReadableTime, Field(description="a page stands this long before its button works")
    ] = 1.0
    reading_s: Annotated[Pause, Field(description="assumed, to read an instruction")] = 4.0
    answer_s: Annotated[Pause, Field(description="assumed, to answer a question")] = 5.0
    score_s: Annotated[Pause, Field(description="assumed, to give a score")] = 5.0
    beam_swap_s: Annotated[LongPause, Field(description="assumed, to mount another beam")] = 60.0
    max_session_s: Annotated[
        Positive, Field(le=14_400, description="longest session that may be planned")
    ] = 5_400.0
