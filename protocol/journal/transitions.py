"""The states of a session and the events that each allows; all other events are refused.

docs/journal.md draws the table.
"""

from protocol.errors import WorkFailed
from protocol.journal.events import (
    Answered,
    BeamMounted,
    DeviceArmed,
    DeviceOff,
    Event,
    NoteTaken,
    Paused,
    PracticeRenewed,
    ResonanceMeasured,
    RigDescribed,
    ScoresImported,
    SessionCompleted,
    SessionExcluded,
    SessionOpened,
    SessionResumed,
    StudyAmended,
    TouchEnded,
    TouchStarted,
    TrialAborted,
    TrialExcluded,
    TrialStarted,
    Unpaused,
    WatchdogTested,
    Withdrawn,
)

_LIVING = ("idle", "armed", "paused", "trial", "touching", "completed")

_TABLE: dict[tuple[str, type[Event]], str] = {
    ("new", SessionOpened): "idle",
    ("new", ScoresImported): "completed",
    ("new", StudyAmended): "amended",
    ("amended", StudyAmended): "amended",
    ("idle", SessionResumed): "idle",
    ("idle", PracticeRenewed): "idle",
    ("idle", DeviceArmed): "armed",
    ("idle", SessionCompleted): "completed",
    ("armed", WatchdogTested): "armed",
    ("armed", RigDescribed): "armed",
    ("armed", ResonanceMeasured): "armed",
    ("armed", BeamMounted): "armed",
    ("armed", TrialStarted): "trial",
    ("armed", Paused): "paused",
    ("paused", Unpaused): "armed",
    ("armed", DeviceOff): "idle",
    ("paused", DeviceOff): "idle",
    ("trial", BeamMounted): "trial",
    ("trial", TouchStarted): "touching",
    ("touching", TouchEnded): "trial",
    ("trial", Answered): "armed",
    ("trial", TrialAborted): "armed",
    ("touching", TrialAborted): "armed",
    ("idle", TrialExcluded): "idle",
    ("completed", TrialExcluded): "completed",
    ("idle", SessionExcluded): "excluded",
    ("completed", SessionExcluded): "excluded",
    **{(state, NoteTaken): state for state in _LIVING},
    **{(state, Withdrawn): "withdrawn" for state in (*_LIVING, "excluded")},
}
TRANSITIONS: dict[tuple[str, str], str] = {
    (state, event.TAG): after for (state, event), after in _TABLE.items()
}
"""(state, event) → state. `armed`: the device may be driven. `idle`: it is off and not armed."""


class NotAllowed(WorkFailed):
    """An event that the session's state does not allow."""


def next_state(state: str, tag: str) -> str:
    """Return the state after the event `tag`.

    Raises:
        NotAllowed: the table has no such transition.
    """
    try:
        return TRANSITIONS[state, tag]
    except KeyError:
        raise NotAllowed(f"a session that is {state} does not allow the event {tag!r}") from None
