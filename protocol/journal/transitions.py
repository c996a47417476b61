"""The states of a session and the events that each allows; all other events are refused.

docs/journal.md draws the table.
"""

from protocol.errors import WorkFailed
from protocol.journal import events
from protocol.journal.events import Event

EXCLUDED = ("excluded", "dropped")
"""A session excluded after its completion or before it, which it is again once included."""
UNFINISHED = ("idle", "armed", "paused", "trial", "touching")
_LIVING = (*UNFINISHED, "completed")

_TABLE: dict[tuple[str, type[Event]], str] = {
    ("new", events.SessionOpened): "idle",
    ("new", events.ScoresImported): "completed",
    ("new", events.StudyAmended): "amended",
    ("amended", events.StudyAmended): "amended",
    ("registered", events.StudyAmended): "amended",
    **{(state, events.StudyRegistered): "registered" for state in ("new", "amended", "registered")},
    ("idle", events.SessionResumed): "idle",
    ("idle", events.PracticeRenewed): "idle",
    ("idle", events.DeviceArmed): "armed",
    ("idle", events.SessionCompleted): "completed",
    ("armed", events.WatchdogTested): "armed",
    ("armed", events.RigDescribed): "armed",
    ("armed", events.ResonanceMeasured): "armed",
    ("armed", events.BeamMounted): "armed",
    ("armed", events.TrialStarted): "trial",
    ("armed", events.QuestionAnswered): "armed",
    ("armed", events.Paused): "paused",
    ("paused", events.Unpaused): "armed",
    ("armed", events.DeviceOff): "idle",
    ("paused", events.DeviceOff): "idle",
    ("trial", events.BeamMounted): "trial",
    ("trial", events.TouchStarted): "touching",
    ("touching", events.TouchRecorded): "touching",
    ("touching", events.TouchEnded): "trial",
    ("trial", events.Answered): "armed",
    ("trial", events.TrialAborted): "armed",
    ("touching", events.TrialAborted): "armed",
    ("trial", events.TrialDeferred): "armed",
    ("armed", events.PracticeRenewed): "armed",
    ("idle", events.TrialExcluded): "idle",
    ("completed", events.TrialExcluded): "completed",
    ("idle", events.TrialIncluded): "idle",
    ("completed", events.TrialIncluded): "completed",
    ("idle", events.SessionExcluded): "dropped",
    ("completed", events.SessionExcluded): "excluded",
    ("dropped", events.SessionIncluded): "idle",
    ("excluded", events.SessionIncluded): "completed",
    **{(state, events.NoteTaken): state for state in _LIVING},
    **{(state, events.Withdrawn): "withdrawn" for state in (*_LIVING, *EXCLUDED)},
}
TRANSITIONS: dict[tuple[str, str], str] = {
    (state, event.TAG): after for (state, event), after in _TABLE.items()
}
"""(state, event) → state. `armed`: the device may be driven. `idle`: it is off and not armed."""


def in_words(state: str, *, running: bool) -> str:
    """Return a session's state as people call it: all unfinished ones are one.

    >>> in_words("touching", running=False), in_words("completed", running=False)
    ('interrupted', 'completed')
    """
    if state in UNFINISHED:
        return "running" if running else "interrupted"
    return EXCLUDED[0] if state in EXCLUDED else state


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
