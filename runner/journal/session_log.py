"""The log of one session: checks each event against the state, stores it, updates the state."""

from protocol.journal.events import DeviceOff, Event, StoredEvent, TrialAborted
from protocol.journal.state import SessionState, next_state
from runner.clock import Clock
from runner.journal.store import Journal, state_of
from runner.signals import stops_deferred


class SessionLog:
    """Appends a session's events; `state` is the state that results from them."""

    def __init__(self, journal: Journal, session: str, clock: Clock) -> None:
        self.journal = journal
        self._session = session
        self._clock = clock
        # Nothing else is kept beside the events: what a resumed session knows follows from them.
        events = journal.events(session)
        self._next_seq = len(events)
        self.state: SessionState = state_of(session, events)

    def append(self, event: Event) -> None:
        """Store `event`, on the disk when this returns; raises `NotAllowed` if it may not come."""
        # Checked before it is stored, because an event can never be taken back.
        next_state(self.state.name, event.TAG)
        with stops_deferred():  # a signal between storing and counting would repeat the number
            self._store(event)

    def _store(self, event: Event) -> None:
        stored = StoredEvent(
            seq=self._next_seq,
            tag=event.TAG,
            utc=self._clock.utc(),
            monotonic_s=self._clock.monotonic_s(),
            payload=event.to_json(),
        )
        # Stored first: if this fails, the state is still that of the journal.
        self.journal.append(self._session, stored)
        self._next_seq += 1
        self.state.take(stored)


_WHY = "the session was interrupted"


def close_interrupted(log: SessionLog) -> None:
    """Record the interrupted trial as aborted and the device as unknown, under a session's lock."""
    # The trial first, because `device-off` is permitted only where no trial is running.
    abort_trial(log, _WHY)
    if log.state.name in {"armed", "paused", "driving"}:
        # Not confirmed: the process that could have read it back is gone.
        log.append(DeviceOff(confirmed=False, why=_WHY))


def abort_trial(log: SessionLog, why: str) -> None:
    """Record the running trial, if there is one, as aborted."""
    if log.state.trial is not None:
        log.append(TrialAborted(index=log.state.trial, why=why))
