"""Everything a session deals with while it runs, in one place."""

from dataclasses import dataclass, field

from runner.ports import Clock, Device, Operator, Participant
from runner.session import Session
from runner.session_log import SessionLog


@dataclass(kw_only=True)
class Room:
    """Who and what is in the room.

    `opened_now` tells a new session from one that is taken up again; `resonance_hz` is known once
    it was measured. `beam_in_doubt` says that the operator was asked for a beam and did not
    confirm it.
    """

    session: Session
    device: Device
    participant: Participant
    operator: Operator
    clock: Clock
    log: SessionLog
    opened_now: bool
    resonance_hz: float = field(default=0.0, init=False)
    pause_wanted: bool = field(default=False, init=False)
    beam_in_doubt: bool = field(default=False, init=False)
