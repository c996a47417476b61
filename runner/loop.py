"""A session: every trial that is not answered yet, and the device off on every way out."""

from collections.abc import Iterator
from contextlib import contextmanager

from device.errors import OutputUnknown
from protocol.plan import Trial
from runner.asking import answers
from runner.ports import Clock, Device, Operator, Participant
from runner.screens import Notice
from runner.session import Session
from runner.session_log import SessionLog
from runner.touching import Touching


def run(
    session: Session,
    device: Device,
    participant: Participant,
    operator: Operator,
    clock: Clock,
    log: SessionLog,
) -> None:
    """Take `session` from where its log says it is to its end.

    Raises:
        DeviceError: the device cannot be trusted; the session can be resumed.
        OutputUnknown: the output could not be read back as off.
    """
    _open(session, log)
    with _device_off_afterwards(device, log):
        touching = Touching(session, device, participant, operator, clock, log)
        touching.prepare()
        participant.show(Notice(text="welcome"))
        for trial in _remaining(session, log):
            log.append("trial-started", index=trial.index, kind=trial.kind)
            for number, touch in enumerate(trial.touches):
                touching.touch(number, touch)
            log.append("answered", **answers(session, trial, device, participant, clock))
    log.append("session-completed")
    participant.show(Notice(text="thanks"))


def _remaining(session: Session, log: SessionLog) -> list[Trial]:
    return [trial for trial in session.plan.trials if trial.index not in log.state.answered]


def _open(session: Session, log: SessionLog) -> None:
    """Open the session, or take it up again where its last process left it."""
    if log.state.name == "new":
        log.append("session-opened", **session.opening())
        return
    _leave_trial(log, "the session was interrupted")
    if log.state.name == "armed":
        log.append("device-off", confirmed=False, why="the session was interrupted")
    log.append("session-resumed")


@contextmanager
def _device_off_afterwards(device: Device, log: SessionLog) -> Iterator[None]:
    """Whatever happens inside: the output goes off first, then the journal says so."""
    why = "end of session"
    try:
        yield
    except BaseException as error:
        why = str(error) or type(error).__name__
        raise
    finally:
        _turn_off(device, log, why)


def _turn_off(device: Device, log: SessionLog, why: str) -> None:
    unknown = None
    try:
        device.off()
    except OutputUnknown as error:
        unknown = error
    _leave_trial(log, why)
    if log.state.name == "armed":
        log.append("device-off", confirmed=unknown is None, why=why)
    if unknown is not None:
        raise unknown


def _leave_trial(log: SessionLog, why: str) -> None:
    if log.state.trial is not None:
        log.append("trial-aborted", index=log.state.trial, why=why)
