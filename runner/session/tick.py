"""The tick: waiting while the watchdog is fed and the operator and participant are served."""

from collections.abc import Callable
from typing import TypeVar

from protocol.errors import WorkFailed
from protocol.journal.events import NoteTaken, Paused, Unpaused
from protocol.journal.records import ReadBack
from protocol.plan.trials import Trial, trial_s
from runner.screens import Instruction, Note, Notice, OperatorView, Response
from runner.session.session import SessionContext
from runner.signals import raise_if_stopped


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


TICK_S = 0.05

_Thing = TypeVar("_Thing")


def wait_for(context: SessionContext, poll: Callable[[], _Thing | None]) -> _Thing:
    """Tick until `poll` returns something other than None, and return it."""
    while (thing := poll()) is None:
        tick(context, TICK_S)
    return thing


def response(context: SessionContext) -> Response:
    """Return the participant's answer to the current screen."""
    return wait_for(context, context.participant.poll)


def operator_answer(context: SessionContext) -> str:
    """Return the operator's answer, and keep serving the participant until it arrives.

    An unanswered question is withdrawn, because a late answer must have no effect.
    """

    def poll() -> str | None:
        context.participant.poll()
        return context.operator.answered()

    try:
        return wait_for(context, poll)
    except BaseException:
        context.operator.withdraw_question()
        raise


def wait(
    context: SessionContext,
    seconds: float,
    on_tick: Callable[[], None] = lambda: None,
    every_s: float = TICK_S,
) -> None:
    """Wait for `seconds`; serve the participant and call `on_tick` every `every_s`."""
    end_s = context.clock.monotonic_s() + seconds
    while (left_s := end_s - context.clock.monotonic_s()) > 1e-9:  # rounding of summed ticks
        context.participant.poll()
        on_tick()
        tick(context, min(every_s, left_s))
    context.participant.poll()


def tick(context: SessionContext, seconds: float) -> None:
    """Check signals, device and operator once, then sleep for `seconds`.

    Raises:
        DeviceError: the device has failed since the last tick.
        StoppedByOperator, RepeatTrial: the operator ordered it.
        Stopped: a signal arrived.
    """
    raise_if_stopped()
    context.device.beat()
    obey(context)
    context.clock.sleep(seconds)


def update_view(
    context: SessionContext,
    device: ReadBack | None = None,
    warning: str = "",
    *,
    searching: bool = False,
    unknown: bool = False,
) -> None:
    """Show the operator the session's progress and, while the output is on, its read-back."""
    state, session = context.log.state, context.session
    left = [entry for entry in session.plan.trials if entry.index not in state.answered]
    running = [entry for entry in left if entry.index == state.trial]
    coming = [entry for entry in left if entry.index != state.trial]
    context.operator.show(
        OperatorView(
            session=f"{session.participant}/{session.number}",
            kind=session.kind,
            state=state.name,
            trial=_label(running),
            next_trial=_label(coming),
            done=len(state.answered),
            total=len(session.plan.trials),
            left_s=sum(trial_s(session.study, entry) for entry in left),
            device=device,
            searching=searching,
            watchdog_s=session.study.rig.watchdog_s,
            last_answer=state.last_answer,
            warning=warning,
            unknown=unknown,
        )
    )


def pause_if_wanted(context: SessionContext, trial: Trial) -> None:
    """Wait before `trial`: the inter-trial interval, a planned break, the operator's pause."""
    wait(context, context.session.study.timing.inter_trial_s)
    if trial.break_s > 0:
        context.participant.show(Notice(text="break"))
        wait(context, trial.break_s)
        context.participant.show(Instruction(text="break"))
        response(context)
    if context.pause_wanted:
        _pause(context)


def _pause(context: SessionContext) -> None:
    context.log.append(Paused())
    context.participant.show(Notice(text="pause"))
    update_view(context)
    while context.pause_wanted:
        context.participant.poll()
        tick(context, TICK_S)
    context.log.append(Unpaused())


def _label(trials: list[Trial]) -> str:
    """Return the operator's label for the first of `trials`."""
    return (trials[0].condition or trials[0].kind) if trials else "-"
