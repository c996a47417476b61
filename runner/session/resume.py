"""Whether a session may go on: the same study, the same kind, not too long ago."""

from collections.abc import Sequence
from datetime import datetime, timedelta

from protocol.errors import BadInput
from protocol.journal.records import PlannedTrial
from protocol.journal.state import SessionState
from protocol.plan.trials import Trial
from protocol.study_file.loading import text_digest
from runner.journal.amendments import accepted_digests
from runner.journal.store import Journal, JournalError, session_name
from runner.journal.verification import chain_is_unbroken
from runner.session.session import Session


def require_resumable(
    journal: Journal, session: Session, before: SessionState | None, now: datetime
) -> None:
    """Refuse a session that cannot begin or go on as it is asked for.

    Args:
        journal: of the study.
        session: as it would run now.
        before: where its events left it, None for a new one.
        now: the date and time.

    Raises:
        BadInput: the message says why, and what can be done.
        JournalError: what there is of the session has been changed.
    """
    name = session_name(session.participant, session.number)
    _require_accepted_study(journal, session)
    if before is None:
        return
    _require_whole(journal, name)
    if before.name in {"completed", "excluded", "withdrawn"}:
        raise BadInput(f"{name} is {before.name}; take another participant or --session")
    assert before.opened is not None, "every other event comes after it"
    if before.opened.kind != session.kind:
        raise BadInput(
            f"{name} began as a {before.opened.kind} session, now it would be a {session.kind} one"
        )
    _require_same_trials(name, session, before.opened.trials)
    _require_fresh(name, session, before.last_event_utc, now)


def _require_whole(journal: Journal, name: str) -> None:
    """What goes on goes on from what really happened."""
    if not chain_is_unbroken(name, journal.chain(name), erased=True):
        raise JournalError(
            f"{name}: its chain of events is broken, so that it cannot go on; see touchbeam "
            "verify, and take another participant or --session"
        )


def _require_accepted_study(journal: Journal, session: Session) -> None:
    """The study file is the one that the study's sessions began with, or an amended one."""
    accepted = accepted_digests(journal)
    if accepted and text_digest(session.study_text) != accepted[-1]:
        raise BadInput(
            "study.toml has changed since the last session; restore it, or accept the change "
            "with touchbeam amend --reason"
        )


def _require_same_trials(name: str, session: Session, opened: Sequence[PlannedTrial]) -> None:
    planned = session.plan.trials
    if [_identity(trial) for trial in planned] != [_identity(trial) for trial in opened]:
        raise BadInput(
            f"{name} has other trials under the amended study; finish it as --session "
            f"{session.number + 1}"
        )


def _identity(trial: Trial | PlannedTrial) -> tuple[object, ...]:
    return trial.index, trial.kind, trial.condition


def _require_fresh(name: str, session: Session, last_event: datetime | None, now: datetime) -> None:
    limit_h = session.study.session.resume_within_h
    if last_event is not None and last_event - now > timedelta(hours=limit_h):
        raise BadInput(
            f"{name} was interrupted at {last_event:%Y-%m-%d %H:%M} UTC, which is yet to come: "
            "set this machine's clock"
        )
    if last_event is not None and now - last_event > timedelta(hours=limit_h):
        hours = (now - last_event).total_seconds() / 3600
        raise BadInput(
            f"{name} was interrupted {hours:.0f} h ago and the study resumes within {limit_h:g} h; "
            f"exclude it (touchbeam exclude) and take another participant or --session"
        )
