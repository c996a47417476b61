"""Tables of a journal that were kept are the tables that were read, to the type of each value."""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd
import pytest

from analysis.kept import Kept
from analysis.loading.kept_sessions import KeptSessions, kept_sessions
from analysis.loading.sessions import load_sessions
from protocol.journal.events import StoredEvent, StudyAmended, StudyRegistered
from tests.analysis.chains import chain, published_chain
from tests.analysis.export.test_recordings import recorded
from tests.analysis.hostile_study import sessions, study_text
from tests.analysis.reports import EXTENDED, cohort
from tests.analysis.tracks import TRACKS, session

BROKEN = ["P-01/1"]
DECISIONS = chain(
    [
        StudyRegistered(registration="1" * 64, study_sha256="2" * 64, text="a registration"),
        StudyAmended(study_sha256="3" * 64, reason="a slip", breaks="1" * 64),
    ]
)
JOURNALS: dict[str, Callable[[], list[Sequence[StoredEvent]]]] = {
    "nothing": list,
    "spoilt, with answers and notes": lambda: [one.events for one in sessions(study_text())],
    "virtual people, measured": lambda: list(cohort(EXTENDED, 3)),
    "recorded touches": lambda: [recorded().events],
    "tracks": lambda: [session(TRACKS, "P01"), session(TRACKS, "P02", 1)],
    "published": lambda: [published_chain("1", {"voltage": 7.0, "structure": None})],
    "a registered study": lambda: [DECISIONS, *cohort(EXTENDED, 1)],
}


class Shelf(dict[str, bytes]):
    """Keeps bytes in memory."""

    def put(self, name: str, content: bytes) -> None:
        self[name] = content


def never() -> KeptSessions:
    raise AssertionError("it was kept")


@pytest.mark.parametrize("name", JOURNALS)
def test_kept_tables_are_those_that_were_read(name: str) -> None:
    shelf, found = Shelf(), load_sessions(JOURNALS[name]())
    Kept(shelf).made(lambda: kept_sessions(found, BROKEN), KeptSessions, "digest")
    kept = Kept(shelf).made(never, KeptSessions, "digest")
    again = kept.sessions()
    for table in ("sessions", "attempts", "touches", "answers", "traces"):
        read, back = getattr(found, table), getattr(again, table)
        pd.testing.assert_frame_equal(read, back, check_exact=True)
        for column in read.columns:
            told = [(type(value), repr(value)) for value in read[column].tolist()]
            assert [(type(value), repr(value)) for value in back[column].tolist()] == told
    assert (again.incidents, again.exclusions) == (found.incidents, found.exclusions)
    counts = found.withdrawn, found.withdrawn_completed
    assert (again.withdrawn, again.withdrawn_completed, kept.broken) == (*counts, tuple(BROKEN))
    assert list(again.decisions) == list(found.decisions)
    assert again.forces.keys() == found.forces.keys()
    for touch, forces in found.forces.items():
        for field, value in vars(forces).items():
            np.testing.assert_array_equal(getattr(again.forces[touch], field), value)
