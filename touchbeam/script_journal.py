"""What the journal keeps of a program that drives a rig: a session of kind `script`."""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from protocol.journal import events
from protocol.journal.records import ReadBack
from runner.clock import Clock
from runner.journal.names import chains_of, parsed_name, session_name
from runner.journal.opening import checked_place, journal_if_used, mounts_of_this_machine
from runner.journal.store import SessionLog
from runner.launch.locks import session_lock
from runner.session.session import versions
from runner.study.folder import StudyFolder


@dataclass
class Entries:
    """What the journal keeps, if there is one; `said` is what was read since the output went on.

    Any thread may write: the one that ends the session is not always the one that drives.
    """

    log: SessionLog | None
    why: str = "the program is done"
    said: list[ReadBack] = field(default_factory=list)
    _one_by_one: threading.RLock = field(default_factory=threading.RLock, init=False)

    def append(self, event: events.Event) -> None:
        """Store `event`, if there is a journal."""
        if self.log is not None:
            with self._one_by_one:
                self.log.append(event)

    def off(self) -> None:
        """Store what was read back, if the output was on."""
        with self._one_by_one:
            if self.log is not None and self.log.state.name == "driving":
                self.log.append(events.DriveEnded(read_back=tuple(self.said)))
            self.said = []

    def over(self, *, confirmed: bool) -> None:
        """End the session; it is complete only if the output is known to be off."""
        with self._one_by_one:
            self.off()
            self.append(events.DeviceOff(confirmed=confirmed, why=self.why))
            if confirmed:
                self.append(events.SessionCompleted())


@contextmanager
def script_session(path: Path, study: str, clock: Clock) -> Iterator[SessionLog]:
    """Open the next session of kind `script` in the journal of the study in `path`."""
    checked_place(path, mounts_of_this_machine())
    with journal_if_used(StudyFolder(path=path).journal) as journal, ExitStack() as stack:
        with journal.alone():
            before = chains_of(journal, events.SCRIPT, rehearsal=False)
            number = 1 + max((parsed_name(chain).number for chain in before), default=0)
            name = session_name(events.SCRIPT, number)
            stack.enter_context(session_lock(name, path))
            log = SessionLog(journal, name, clock)
            log.append(
                events.SessionOpened(
                    participant=events.SCRIPT,
                    session=number,
                    kind=events.SCRIPT,
                    study=study,
                    slot=None,
                    sequence=(),
                    conditions=(),
                    study_sha256=None,
                    study_text=None,
                    trials=(),
                    language=None,
                    consent=None,
                    seed=None,
                    versions=versions(),
                )
            )
        yield log
