"""The journal of one session: every event is checked against the state, stored, then folded."""

from collections.abc import Mapping

from runner.journal import Journal
from runner.ports import Clock
from runner.session_state import Event, SessionState, folded
from runner.stopping import uninterrupted
from runner.transitions import next_state


class SessionLog:
    """Appends a session's events; `state` is what they add up to."""

    def __init__(self, journal: Journal, session: str, clock: Clock) -> None:
        self._journal = journal
        self._session = session
        self._clock = clock
        events = journal.events(session)
        self._next_seq = len(events)
        self.state: SessionState = folded(events)

    def append(self, tag: str, **payload: object) -> None:
        """Store an event; it is safe when this returns.

        Raises:
            NotAllowed: the state does not permit it; nothing is stored.
            JournalError: it could not be stored.
        """
        next_state(self.state.name, tag)
        with uninterrupted():
            self._store(tag, payload)

    def _store(self, tag: str, payload: Mapping[str, object]) -> None:
        event = Event(
            seq=self._next_seq,
            tag=tag,
            utc=self._clock.utc(),
            monotonic_s=self._clock.monotonic_s(),
            payload=payload,
        )
        self._journal.append(self._session, event)
        self._next_seq += 1
        self.state.take(event)
