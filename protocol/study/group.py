"""Groups of participants: what they are called, how large they are, and who belongs to which."""

from typing import Annotated

from pydantic import Field

from protocol.study.fields import Count, Name, Record, setting
from protocol.study.study_question import AskedIf


class Group(Record):
    """Participants who are compared with those of other groups."""

    name: Annotated[Name, Field(description="name in tables and reports")]
    size: Annotated[Count, Field(le=10_000, description="planned number of participants")]
    when: AskedIf | None = setting(
        None,
        'for `assign_groups = "by an answer"`: the answer that leads into this group; a table as '
        "`asked_if` of a question",
    )
