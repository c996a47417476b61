"""A session: every trial that is not answered yet, and the device off on every way out."""

from collections.abc import Callable

from device.errors import OutputUnknown
from protocol.errors import BadInput
from protocol.plan.trials import Trial
from runner.journal.session_log import close_abandoned, leave_trial
from runner.screens import Notice
from runner.session.session import Room
from runner.session.setup import prepare
from runner.session.tick import RepeatTrial, pause_if_wanted, show_where_we_are
from runner.session.trial import answers, touch
from runner.signals import interruptible, uninterrupted

_OFF = "output off, read back"
_GOES_ON = "run it again to go on"


def run(room: Room) -> None:
    """Take the session from where its log says it is to its end.

    Raises:
        DeviceError: the device cannot be trusted; the session can be resumed.
        OutputUnknown: the output could not be read back as off.
        StoppedByOperator: likewise resumable.
    """
    _resume(room)
    _to_the_end(_trials, room)
    room.participant.show(Notice(text="thanks"))
    show_where_we_are(room)


def _trials(room: Room) -> None:
    prepare(room)
    while (trial := _next_trial(room)) is not None:
        pause_if_wanted(room, trial)
        _try(room, trial)


def _next_trial(room: Room) -> Trial | None:
    answered = room.log.state.answered
    return next((trial for trial in room.session.plan.trials if trial.index not in answered), None)


def _try(room: Room, trial: Trial) -> None:
    """Carry out one trial; if the operator wants it again, it stays to be answered."""
    room.log.append("trial-started", index=trial.index, kind=trial.kind)
    show_where_we_are(room)
    try:
        done = [touch(room, number, to_make) for number, to_make in enumerate(trial.touches)]
        room.log.append("answered", **answers(room, trial), judged=done)
    except RepeatTrial:
        room.device.off()
        leave_trial(room.log, "repeated at the operator's wish")


def _resume(room: Room) -> None:
    """Take the session up again where its last process left it, unless it was opened just now."""
    log = room.log
    if room.opened_now:
        return
    close_abandoned(log)
    log.append("session-resumed", **room.session.resumption())
    _renew_practice(room)


def _renew_practice(room: Room) -> None:
    if room.session.study.session.practise_again != "on resume":
        return
    practice = {trial.index for trial in room.session.plan.trials if trial.kind == "practice"}
    if again := sorted(practice & room.log.state.answered):
        room.log.append("practice-renewed", indices=again)


def _to_the_end(part: Callable[[Room], None], room: Room) -> None:
    """Whatever happens in `part`: the output goes off first, then the journal says so.

    A signal that comes after the last answer is heeded when the session is complete.
    """
    with uninterrupted():
        try:
            with interruptible():
                part(room)
        except BaseException as error:
            _turn_off(room, str(error) or type(error).__name__)
            error.add_note(_OFF)
            if not isinstance(error, BadInput):  # which would end it again
                error.add_note(_GOES_ON)
            raise
        _turn_off(room, "end of session")
        room.log.append("session-completed")


def _turn_off(room: Room, why: str) -> None:
    """Turn the output off and write it down; nothing is told before an output that is unknown."""
    unknown = None
    try:
        room.device.off()
    except OutputUnknown as error:
        unknown = error
    try:
        leave_trial(room.log, why)
        if room.log.state.name in {"armed", "paused"}:
            room.log.append("device-off", confirmed=unknown is None, why=why)
        if unknown is not None:
            show_where_we_are(room, unknown=True)
    except Exception as error:
        if unknown is not None:
            raise unknown from error
        error.add_note(_OFF)
        error.add_note(_GOES_ON)
        raise
    if unknown is not None:
        raise unknown
