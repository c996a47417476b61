"""Waiting while the watchdog is fed and the operator and participant are served."""

from collections.abc import Callable
from typing import TypeVar

from protocol.journal.events import Paused, Unpaused
from protocol.plan.trials import Trial
from runner.screens import Instruction, Notice, Response
from runner.session.operator_view import update_view
from runner.session.orders import obey
from runner.session.session import SessionContext
from runner.signals import raise_if_stopped

TICK_S = 0.05
SAVED_S = 0.5
"""How long a page may say that its answer is saved before the pause after it begins."""

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


def pause_if_wanted(context: SessionContext, trial: Trial) -> None:
    """Wait before `trial`: the inter-trial interval, a planned break, the operator's pause."""
    pause_s = context.session.study.timing.inter_trial_s
    wait(context, min(SAVED_S, pause_s))
    context.participant.show(Notice(text="wait.touch"))
    wait(context, max(pause_s - SAVED_S, 0.0))
    if trial.break_s > 0:
        _take_break(context, trial.break_s)
    if context.pause_wanted:
        _pause(context)


def _take_break(context: SessionContext, least_s: float) -> None:
    """Wait until the break is over and the participant wants to go on."""
    over_s = context.clock.monotonic_s() + least_s
    context.participant.show(Instruction(text="break", after_s=least_s))
    answer = None
    while answer is None or context.clock.monotonic_s() < over_s:
        answer = answer or context.participant.poll()
        tick(context, TICK_S)


def _pause(context: SessionContext) -> None:
    context.log.append(Paused())
    context.participant.show(Notice(text="pause"))
    update_view(context)
    while context.pause_wanted:
        context.participant.poll()
        tick(context, TICK_S)
    context.log.append(Unpaused())
