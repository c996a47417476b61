"""What a process that had no time to say so has left behind, written down by the next one."""

from runner.session_log import SessionLog

_WHY = "the session was interrupted"


def close_abandoned(log: SessionLog) -> None:
    """Mark the trial that was running, and a device that was armed: nobody can tell whether it is.

    To be called by whoever holds the session.
    """
    leave_trial(log, _WHY)
    if log.state.name in {"armed", "paused"}:
        log.append("device-off", confirmed=False, why=_WHY)


def leave_trial(log: SessionLog, why: str) -> None:
    """Mark the trial that is running, if one is, as aborted."""
    if log.state.trial is not None:
        log.append("trial-aborted", index=log.state.trial, why=why)
