"""The operator's orders: stop, repeat, pause, note."""

from protocol.errors import WorkFailed
from protocol.journal.events import NoteTaken
from runner.screens import Note
from runner.session.session import SessionContext


class StoppedByOperator(WorkFailed):
    """The operator stopped the session; it can be resumed."""


class RepeatTrial(Exception):
    """The operator asked to repeat the running trial."""


def obey(context: SessionContext) -> None:
    """Carry out the operator's next order, if there is one.

    Raises:
        StoppedByOperator: the operator stopped the session; an emergency stop has already sent
            the command that turns the output off.
        RepeatTrial: the operator asked to repeat the running trial.
    """
    match context.operator.order():
        case "emergency stop":
            context.device.emergency_stop()
            raise StoppedByOperator("emergency stop")
        case "stop":
            raise StoppedByOperator("stopped by the operator")
        case "repeat" if context.log.state.trial is not None:
            raise RepeatTrial
        case "repeat":
            context.operator.notify("there is no running trial to repeat")
        case "pause":
            context.pause_wanted = not context.pause_wanted
            context.operator.notify(
                "pausing before the next trial" if context.pause_wanted else "pause cancelled"
            )
        case Note(text=text):
            context.log.append(NoteTaken(text=text))
