"""SIGKILL at 1,000 random moments of sessions with tracks: all go on as if nothing had happened."""

import os
import random
import signal
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from device.friction.calibration import NOMINAL
from protocol.journal.events import Answered, StoredEvent
from protocol.journal.records import TrackAnswer
from runner.journal.opening import open_journal
from runner.journal.store import Journal
from runner.journal.verification import verdicts
from runner.session.loop import run
from runner.study.tracks import solved_volts
from tests.runner.fakes import FakeDevice, context
from tests.runner.session.test_track_levels import SHORT, Answering

KILLS = int(os.environ.get("KILLS", "1000"))
TEXTS = (SHORT, SHORT.replace("trials = 5", "trials = 9").replace("reversals = 2", "reversals = 4"))

pytestmark = pytest.mark.soak


def session(journal: Journal, text: str) -> Any:
    made = context(journal, FakeDevice(), Answering(), text)
    made.session = replace(made.session, volts=solved_volts(made.session.study, NOMINAL))
    return made


def finish(path: Path, text: str) -> list[StoredEvent]:
    with open_journal(path) as journal:
        made = session(journal, text)
        if made.log.state.name != "completed":
            run(made)
        (verdict,) = verdicts(journal)
        assert verdict.ok, verdict
        return journal.events("P01/1")


def told(events: list[StoredEvent]) -> list[tuple[int, str | None, TrackAnswer | None]]:
    found = [event.record for event in events if isinstance(event.record, Answered)]
    return [(each.index, each.change, each.track) for each in found]


def killed(path: Path, text: str, after_s: float) -> bool:
    """Run the session in a process that is killed; return whether it was still running."""
    child = os.fork()
    if child == 0:
        try:
            finish(path, text)
        finally:
            os._exit(0)  # and not on as a second pytest
    time.sleep(after_s)
    os.kill(child, signal.SIGKILL)
    return os.WIFSIGNALED(os.waitpid(child, 0)[1])


def test_a_thousand_kills_change_nothing(tmp_path: Path) -> None:
    drawn, kills, within = random.Random(30), 0, 0
    wholes, lasts_s = [], []
    for number, text in enumerate(TEXTS):
        begun_s = time.monotonic()
        wholes.append(told(finish(tmp_path / f"whole-{number}.db", text)))
        lasts_s.append(time.monotonic() - begun_s)
    while kills < KILLS:
        which = drawn.randrange(len(TEXTS))
        path = tmp_path / f"{kills}.db"
        for _ in range(drawn.choice((1, 2, 3))):
            kills += killed(path, TEXTS[which], drawn.uniform(0, 1.2 * lasts_s[which]))
        if path.exists():
            with open_journal(path) as journal:
                kept = journal.events("P01/1")
            within += any(event.tag == "trial-started" for event in kept) and not any(
                event.tag == "session-completed" for event in kept
            )
        else:
            kept = []
        events = finish(path, TEXTS[which])
        assert events[: len(kept)] == kept, "no event is lost"
        assert told(events) == wholes[which]
        for left in tmp_path.glob(f"{path.name}*"):
            left.unlink(missing_ok=True)
    assert within > kills / 10, "most kills must fall between the first trial and the end"
    print(f"{kills} kills, {within} sessions among their trials; all went on alike")
