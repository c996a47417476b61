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
            context.operator.notify("emergency stop: off was sent")
            raise StoppedByOperator("emergency stop")
        case "stop":
            context.operator.notify("stopping; the output goes off")
            raise StoppedByOperator("stopped by the operator")
        case "repeat":
            _repeat(context)
        case "pause":
            context.pause_wanted = not context.pause_wanted
            context.operator.pausing(context.pause_wanted)
        case Note(text=text):
            context.log.append(NoteTaken(text=text))
            context.operator.notify(f"noted: {text}")


def _repeat(context: SessionContext) -> None:
    """Repeat the running trial, unless it has just begun to be repeated."""
    state, unit = context.log.state, context.session.unit
    if state.trial is None:
        context.operator.notify(f"there is no running {unit} to repeat")
    elif state.touch is None and state.aborted[-1:] == [state.trial]:
        context.operator.notify(f"this {unit} is being repeated already")
    else:
        context.operator.notify(f"the {unit} is broken off and will be repeated")
        raise RepeatTrial
