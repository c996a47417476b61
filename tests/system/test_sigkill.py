"""SIGKILL at random times in virtual sessions: they resume, and each trial is answered once."""

import random
import signal
import sqlite3
import subprocess
import time
from contextlib import closing
from pathlib import Path

import pytest

from protocol.journal.events import StoredEvent
from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.journal.verification import verdicts
from tests.runner.command_line import TOUCHBEAM

pytestmark = pytest.mark.waits

EVENTS = 48
"""Number of events in a session of the paper's study."""


@pytest.mark.parametrize("draw", range(3))
def test_a_session_killed_at_a_random_time_resumes(tmp_path: Path, draw: int) -> None:
    killed_and_resumed(tmp_path, draw)


@pytest.mark.soak
@pytest.mark.parametrize("draw", range(100, 400))
def test_sessions_killed_at_300_random_times_resume(tmp_path: Path, draw: int) -> None:
    killed_and_resumed(tmp_path, draw)


def killed_and_resumed(folder: Path, draw: int, study: str = template("paper")) -> None:
    """Kill a session once or twice at random times with seed `draw`, then let it finish."""
    (folder / "study.toml").write_text(study)
    command = [TOUCHBEAM, "run", str(folder), "--participant", "P01", "--ratings", "virtual"]
    instants = random.Random(draw)
    acknowledged: list[StoredEvent] = []
    for _ in range(instants.choice((1, 2))):
        kill_within_session(command, folder / "study.db", instants)
        events = recorded(folder)
        assert events[: len(acknowledged)] == acknowledged, "no acknowledged event is lost"
        acknowledged = events
    finish(command, already=any(event.tag == "session-completed" for event in acknowledged))
    with open_journal(folder / "study.db") as journal:
        (verdict,) = verdicts(journal)
    assert verdict.ok, verdict
    assert (verdict.state, verdict.trials_answered, verdict.missing) == ("completed", 7, 0)
    events = recorded(folder)
    assert events[: len(acknowledged)] == acknowledged
    begun = sum(event.tag == "trial-started" for event in events)
    assert begun == 7 + verdict.trials_aborted, "an interrupted trial is recorded as aborted"


def kill_within_session(command: list[str], journal: Path, instants: random.Random) -> None:
    """Kill the session at a random time after a random number of events."""
    before = len_of(journal)
    after = before + instants.randrange(max(1, EVENTS - before))
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while process.poll() is None and len_of(journal) < after:
        time.sleep(0.001)
    time.sleep(instants.uniform(0, 0.02))
    process.send_signal(signal.SIGKILL)
    process.wait()


def len_of(journal: Path) -> int:
    """Return the number of events in the journal, read while another process writes it."""
    try:
        with closing(sqlite3.connect(f"{journal.as_uri()}?mode=ro", uri=True)) as reader:
            return int(reader.execute("SELECT count(*) FROM event").fetchone()[0])
    except sqlite3.OperationalError:
        return 0


def finish(command: list[str], *, already: bool) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == (2 if already else 0), done.stderr


def recorded(folder: Path) -> list[StoredEvent]:
    if not (folder / "study.db").exists():
        return []
    with open_journal(folder / "study.db") as journal:
        return journal.events("P01/1 (rehearsal)")
