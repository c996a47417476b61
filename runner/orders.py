"""What the operator may order while a session runs, and what follows from it."""

from dataclasses import dataclass
from typing import Literal

from protocol.errors import WorkFailed
from runner.room import Room

Order = Literal["pause", "stop", "repeat", "emergency stop"]


@dataclass(frozen=True, kw_only=True)
class Note:
    """Something the operator wants written down."""

    text: str


class StoppedByOperator(WorkFailed):
    """The operator ended the session; it can be resumed."""


class RepeatTrial(Exception):
    """The operator wants the trial that is running again."""


def obey(room: Room) -> None:
    """Do what the operator has ordered, if anything.

    Raises:
        StoppedByOperator: the session is to end here; after an emergency stop the output is off.
        RepeatTrial: the trial is to be done again.
    """
    match room.operator.order():
        case "emergency stop":
            room.device.emergency_stop()
            raise StoppedByOperator("emergency stop")
        case "stop":
            raise StoppedByOperator("stopped by the operator")
        case "repeat" if room.log.state.trial is not None:
            raise RepeatTrial
        case "repeat":
            room.operator.tell("no trial is running that could be repeated")
        case "pause":
            room.pause_wanted = not room.pause_wanted
            room.operator.tell(
                "a pause comes before the next trial" if room.pause_wanted else "no pause"
            )
        case Note(text=text):
            room.log.append("note", text=text)
