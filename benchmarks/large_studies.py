"""Studies of people with different gains, 40 scored trials each, and nine of other kinds."""

from pathlib import Path

import numpy as np

from protocol.study_file.loading import parsed_study, template
from runner.journal.opening import open_journal
from tests.analysis.chains import chain
from tests.analysis.reports import session_events

TEXT = template("extended").replace("repeats = 4", "repeats = 8")
STUDY = parsed_study(TEXT)
ARRANGEMENTS = 20


def large_study(folder: Path, participants: int) -> Path:
    """Make the study of so many participants in `folder`, and return that."""
    folder.mkdir()
    (folder / "study.toml").write_text(TEXT)
    rng = np.random.default_rng(1)
    # In one transaction: how long sessions take to be recorded is measured elsewhere.
    with open_journal(folder / "study.db") as journal, journal.alone():
        for number in range(participants):
            name = f"P{number + 1:04d}"
            gain = rng.normal(1.2, 0.4)
            events = session_events(STUDY, number % ARRANGEMENTS, rng, who=name, gain=gain)
            for stored in chain(events):
                journal.append(f"{name}/1", stored)
    return folder
