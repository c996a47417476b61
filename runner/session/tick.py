"""Waiting, with the device kept alive, the operator heard and the participant served meanwhile."""

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
    """The operator ended the session; it can be resumed."""


class RepeatTrial(Exception):
    """The operator wants the trial that is running again."""


def obey(context: SessionContext) -> None:
    """Do what the operator has ordered, if anything.

    Raises:
        StoppedByOperator: the session is to end here; after an emergency stop the output is off.
        RepeatTrial: the trial is to be done again.
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
            context.operator.tell("no trial is running that could be repeated")
        case "pause":
            context.pause_wanted = not context.pause_wanted
            context.operator.tell(
                "a pause comes before the next trial" if context.pause_wanted else "no pause"
            )
        case Note(text=text):
            context.log.append(NoteTaken(text=text))


TICK_S = 0.05

_Thing = TypeVar("_Thing")


def awaited(context: SessionContext, poll: Callable[[], _Thing | None]) -> _Thing:
    """Return what `poll` gives as soon as it gives something."""
    while (thing := poll()) is None:
        tick(context, TICK_S)
    return thing


def response(context: SessionContext) -> Response:
    """Return the participant's answer to what was last shown."""
    return awaited(context, context.participant.poll)


def operator_answer(context: SessionContext) -> str:
    """Return what the operator answers; the participant is looked after meanwhile.

    A question that is left without an answer is taken back: nothing may be done about it any more.
    """

    def poll() -> str | None:
        context.participant.poll()
        return context.operator.answered()

    try:
        return awaited(context, poll)
    except BaseException:
        context.operator.unask()
        raise


def wait(
    context: SessionContext,
    seconds: float,
    meanwhile: Callable[[], None] = lambda: None,
    every_s: float = TICK_S,
) -> None:
    """Let `seconds` pass; the participant goes on touching, `meanwhile` is called `every_s`."""
    end_s = context.clock.monotonic_s() + seconds
    while (left_s := end_s - context.clock.monotonic_s()) > 1e-9:
        context.participant.poll()
        meanwhile()
        tick(context, min(every_s, left_s))
    context.participant.poll()


def tick(context: SessionContext, seconds: float) -> None:
    """Let one tick pass.

    Raises:
        DeviceError: the device failed meanwhile.
        StoppedByOperator, RepeatTrial: the operator ordered so.
        Stopped: a signal did.
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
    """Show the operator where the session stands, and what `device` read back, if it is on."""
    state, session = context.log.state, context.session
    left = [entry for entry in session.plan.trials if entry.index not in state.answered]
    running = [entry for entry in left if entry.index == state.trial]
    coming = [entry for entry in left if entry.index != state.trial]
    context.operator.see(
        OperatorView(
            session=f"{session.participant}/{session.number}",
            kind=session.kind,
            state=state.name,
            trial=_named(running),
            next_trial=_named(coming),
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
    """Keep the pause before `trial`: the study's own, a break, and the operator's."""
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


def _named(trials: list[Trial]) -> str:
    """What the operator calls the first of `trials`."""
    return (trials[0].condition or trials[0].kind) if trials else "-"
