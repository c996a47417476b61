"""A session: every trial that is not answered yet, and the device off on every way out."""

from collections.abc import Callable

from device.errors import OutputUnknown
from protocol.errors import BadInput
from protocol.journal.events import (
    DeviceOff,
    PracticeRenewed,
    SessionCompleted,
    TrialStarted,
)
from protocol.plan.trials import Trial
from runner.journal.session_log import abort_trial, close_interrupted
from runner.screens import Notice
from runner.session.session import SessionContext
from runner.session.setup import prepare
from runner.session.tick import RepeatTrial, pause_if_wanted, update_view
from runner.session.trial import ask, touch
from runner.signals import stops_allowed, stops_deferred

_OFF = "output off, read back"
_GOES_ON = "run it again to go on"


def run(context: SessionContext) -> None:
    """Take the session from where its log says it is to its end.

    Raises:
        DeviceError: the device cannot be trusted; the session can be resumed.
        OutputUnknown: the output could not be read back as off.
        StoppedByOperator: likewise resumable.
    """
    _resume(context)
    to_the_end(_trials, context)
    context.participant.show(Notice(text="thanks"))
    update_view(context)


def _trials(context: SessionContext) -> None:
    prepare(context)
    while (trial := _next_trial(context)) is not None:
        pause_if_wanted(context, trial)
        _try(context, trial)


def _next_trial(context: SessionContext) -> Trial | None:
    answered = context.log.state.answered
    return next(
        (trial for trial in context.session.plan.trials if trial.index not in answered), None
    )


def _try(context: SessionContext, trial: Trial) -> None:
    """Carry out one trial; if the operator wants it again, it stays to be answered."""
    context.log.append(TrialStarted(index=trial.index, kind=trial.kind))
    update_view(context)
    try:
        done = [touch(context, number, to_make) for number, to_make in enumerate(trial.touches)]
        context.log.append(ask(context, trial, done))
    except RepeatTrial:
        context.device.off()
        abort_trial(context.log, "repeated at the operator's wish")


def _resume(context: SessionContext) -> None:
    """Take the session up again where its last process left it, unless it was opened just now."""
    log = context.log
    if context.opened_now:
        return
    close_interrupted(log)
    log.append(context.session.resumption())
    _renew_practice(context)


def _renew_practice(context: SessionContext) -> None:
    if context.session.study.session.practise_again != "on resume":
        return
    practice = {trial.index for trial in context.session.plan.trials if trial.kind == "practice"}
    if again := sorted(practice & context.log.state.answered):
        context.log.append(PracticeRenewed(indices=tuple(again)))


def to_the_end(part: Callable[[SessionContext], None], context: SessionContext) -> None:
    """Carry out `part`; whatever happens in it, the output goes off, then the journal says so.

    A signal that comes after the last answer is heeded when the session is complete.
    """
    with stops_deferred():
        try:
            with stops_allowed():
                part(context)
        except BaseException as error:
            _turn_off(context, str(error) or type(error).__name__)
            error.add_note(_OFF)
            if not isinstance(error, BadInput):  # which would end it again
                error.add_note(_GOES_ON)
            raise
        _turn_off(context, "end of session")
        context.log.append(SessionCompleted())


def _turn_off(context: SessionContext, why: str) -> None:
    """Turn the output off and write it down; nothing is told before an output that is unknown."""
    unknown = None
    try:
        context.device.off()
    except OutputUnknown as error:
        unknown = error
    try:
        abort_trial(context.log, why)
        if context.log.state.name in {"armed", "paused"}:
            context.log.append(DeviceOff(confirmed=unknown is None, why=why))
        if unknown is not None:
            update_view(context, unknown=True)
    except Exception as error:
        if unknown is not None:
            raise unknown from error
        error.add_note(_OFF)
        error.add_note(_GOES_ON)
        raise
    if unknown is not None:
        raise unknown
