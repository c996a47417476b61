"""The journal of one session: every event is checked against the state, stored, then folded."""

from protocol.journal.events import DeviceOff, Event, StoredEvent, TrialAborted
from protocol.journal.state import SessionState, folded
from protocol.journal.transitions import next_state
from runner.clock import Clock
from runner.journal.store import Journal
from runner.signals import stops_deferred


class SessionLog:
    """Appends a session's events; `state` is what they add up to."""

    def __init__(self, journal: Journal, session: str, clock: Clock) -> None:
        self._journal = journal
        self._session = session
        self._clock = clock
        events = journal.events(session)
        self._next_seq = len(events)
        self.state: SessionState = folded(events)

    def append(self, event: Event) -> None:
        """Store `event`; it is safe when this returns.

        Raises:
            NotAllowed: the state does not permit it; nothing is stored.
            JournalError: it could not be stored.
        """
        next_state(self.state.name, event.TAG)
        with stops_deferred():
            self._store(event)

    def _store(self, event: Event) -> None:
        stored = StoredEvent(
            seq=self._next_seq,
            tag=event.TAG,
            utc=self._clock.utc(),
            monotonic_s=self._clock.monotonic_s(),
            payload=event.to_json(),
        )
        self._journal.append(self._session, stored)
        self._next_seq += 1
        self.state.take(stored)


_WHY = "the session was interrupted"


def close_interrupted(log: SessionLog) -> None:
    """Mark the trial that was running, and a device that was armed: nobody can tell whether it is.

    To be called by whoever holds the session.
    """
    abort_trial(log, _WHY)
    if log.state.name in {"armed", "paused"}:
        log.append(DeviceOff(confirmed=False, why=_WHY))


def abort_trial(log: SessionLog, why: str) -> None:
    """Mark the trial that is running, if one is, as aborted."""
    if log.state.trial is not None:
        log.append(TrialAborted(index=log.state.trial, why=why))
