"""A process that opens, uses and closes a journal at each line on its standard input.

`python -m tests.runner.journal.racing SESSION SEED`: "write FILE" appends events to SESSION,
checkpointing now and then; "read FILE" opens and reads the journal a few times. It answers each
line with the number of events that it has written to the file by now. "copy FILE" copies the file
as on a full disk, and answers with the number of events in the copy.
"""

import random
import sys
import time
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

from protocol.journal.events import StoredEvent
from runner.journal.database import connected_to_copy
from runner.journal.opening import open_journal, read_journal

NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)


def write(path: Path, session: str, seq: int, draw: random.Random) -> int:
    with open_journal(path) as journal:
        for _ in range(draw.randint(1, 3)):
            payload = {"text": "x" * draw.choice((10, 5_000))}
            event = StoredEvent(seq=seq, tag="note", utc=NOON, monotonic_s=1.0, payload=payload)
            journal.append(session, event)
            seq += 1
            if draw.random() < 0.4:
                journal.checkpoint()
    return seq


def read(path: Path, draw: random.Random) -> None:
    for _ in range(draw.randint(1, 3)):
        with read_journal(path) as journal:
            for session in journal.sessions():
                journal.events(session)
        time.sleep(draw.uniform(0, 0.004))


def copied(path: Path) -> int:
    with closing(connected_to_copy(path)) as copy:
        assert copy.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        chains = copy.execute("SELECT count(*), max(seq) FROM event GROUP BY session").fetchall()
    assert all(count == last + 1 for count, last in chains), chains
    return sum(count for count, _ in chains)


def main() -> None:
    session, draw = sys.argv[1], random.Random(int(sys.argv[2]))
    written: dict[Path, int] = {}
    for line in sys.stdin:
        word, name = line.rstrip("\n").split(" ", 1)
        path = Path(name)
        before = written.get(path, 0)
        if word == "copy":
            print(copied(path), flush=True)
            continue
        if word == "write":
            written[path] = write(path, session, before, draw)
        else:
            read(path, draw)
        print(written.get(path, 0), flush=True)


if __name__ == "__main__":
    main()
