"""The states of a session and the events that each one allows. Whatever is not here is refused."""

TRANSITIONS: dict[tuple[str, str], str] = {
    ("new", "session-opened"): "idle",
    ("new", "scores-imported"): "completed",
    ("idle", "session-resumed"): "idle",
    ("idle", "device-armed"): "armed",
    ("idle", "session-interrupted"): "idle",
    ("idle", "session-completed"): "completed",
    ("armed", "resonance-measured"): "armed",
    ("armed", "beam-mounted"): "armed",
    ("armed", "trial-started"): "trial",
    ("armed", "device-off"): "idle",
    ("trial", "beam-mounted"): "trial",
    ("trial", "touch-started"): "touching",
    ("touching", "touch-ended"): "trial",
    ("trial", "answered"): "armed",
    ("trial", "trial-aborted"): "armed",
    ("touching", "trial-aborted"): "armed",
}
"""(state, event) → state. `armed`: the device may be driven. `idle`: it is off."""


class NotAllowed(Exception):
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
