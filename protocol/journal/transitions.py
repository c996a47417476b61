"""The states of a session and the events that each one allows. Whatever is not here is refused.

docs/journal.md draws the table.
"""

from protocol.errors import WorkFailed

_LIVING = ("idle", "armed", "paused", "trial", "touching", "completed")

TRANSITIONS: dict[tuple[str, str], str] = {
    ("new", "session-opened"): "idle",
    ("new", "scores-imported"): "completed",
    ("new", "study-amended"): "amended",
    ("amended", "study-amended"): "amended",
    ("idle", "session-resumed"): "idle",
    ("idle", "practice-renewed"): "idle",
    ("idle", "device-armed"): "armed",
    ("idle", "session-completed"): "completed",
    ("armed", "rig-described"): "armed",
    ("armed", "resonance-measured"): "armed",
    ("armed", "beam-mounted"): "armed",
    ("armed", "trial-started"): "trial",
    ("armed", "paused"): "paused",
    ("paused", "unpaused"): "armed",
    ("armed", "device-off"): "idle",
    ("paused", "device-off"): "idle",
    ("trial", "beam-mounted"): "trial",
    ("trial", "touch-started"): "touching",
    ("touching", "touch-ended"): "trial",
    ("trial", "answered"): "armed",
    ("trial", "trial-aborted"): "armed",
    ("touching", "trial-aborted"): "armed",
    ("idle", "trial-excluded"): "idle",
    ("completed", "trial-excluded"): "completed",
    ("idle", "session-excluded"): "excluded",
    ("completed", "session-excluded"): "excluded",
    **{(state, "note"): state for state in _LIVING},
    **{(state, "withdrawn"): "withdrawn" for state in (*_LIVING, "excluded")},
}
"""(state, event) → state. `armed`: the device may be driven. `idle`: it is off and not armed."""


class NotAllowed(WorkFailed):
    """An event that the session's state does not permit."""


def next_state(state: str, tag: str) -> str:
    """Return the state after the event `tag`.

    Raises:
        NotAllowed: the table has no such transition; nothing changes.
    """
    try:
        return TRANSITIONS[state, tag]
    except KeyError:
        raise NotAllowed(f"a session that is {state} does not allow the event {tag!r}") from None
