"""Data sets of sessions with tracks, read back as they were written."""

from pathlib import Path

import pytest

from analysis.loading.sessions import load_sessions
from protocol.errors import BadInput
from protocol.journal.shared_form import FOLDER, STUDY_FILE, SUFFIX, shared_text
from runner.study.data_set import read_data_set
from tests.analysis.tracks import BOTH, session

COLUMNS = [
    "track",
    "track_role",
    "level",
    "level_value",
    "interval",
    "correct",
    "reversal",
    "change",
]


def data_set(folder: Path, old: str = "", new: str = "") -> Path:
    place = folder / FOLDER
    place.mkdir(parents=True)
    (place / STUDY_FILE).write_text(BOTH, encoding="utf-8")
    text = shared_text(0, session(BOTH, "P01"))
    assert old in text
    (place / f"sub-P01{SUFFIX}").write_text(text.replace(old, new, 1), encoding="utf-8")
    return folder


def test_trials_of_tracks_come_back_with_their_levels_and_reversals(tmp_path: Path) -> None:
    (again,) = read_data_set(data_set(tmp_path)).sessions.values()
    tables = []
    for events in (session(BOTH, "P01"), again.events):
        found = load_sessions([events])
        tables.append(found.answered[COLUMNS])
    assert tables[0].equals(tables[1])
    assert tables[0]["reversal"].sum() == 12


def test_an_answer_that_no_track_has_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="change: must be one of first, second, got 'third'"):
        read_data_set(data_set(tmp_path, '"change": "second"', '"change": "third"'))
