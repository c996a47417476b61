"""Checks before a session starts or resumes: same study, same kind, intact chain, not too old."""

from collections.abc import Sequence
from datetime import datetime, timedelta

from protocol.errors import BadInput
from protocol.journal.records import PlannedTrial
from protocol.journal.state import SessionState
from protocol.study_file.loading import text_digest
from runner.journal.amendments import accepted_digests
from runner.journal.names import chain_name, session_name
from runner.journal.store import Journal, JournalError
from runner.journal.verification import chain_is_unbroken
from runner.session.session import Session


def require_resumable(
    journal: Journal, session: Session, before: SessionState | None, now: datetime
) -> None:
    """Refuse a session that cannot start or resume as requested.

    Args:
        journal: the study's journal.
        session: the session as it would run now.
        before: the state recorded so far, None for a new session.
        now: the current date and time, UTC.

    Raises:
        BadInput: the session cannot run; the message gives the reason and the remedy.
        JournalError: the recorded events of the session have been changed.
    """
    name = session_name(session.participant, session.number)
    rehearsal = session.kind == "rehearsal"
    chain = chain_name(journal, session.participant, session.number, rehearsal=rehearsal)
    _require_accepted_study(journal, session)
    if before is None:
        return
    if not chain_is_unbroken(chain, journal.chain(chain), erased=True):
        raise JournalError(
            f"{name}: cannot resume, because its chain of events is broken; run touchbeam verify, "
            "and choose another participant or --session"
        )
    if before.is_excluded or before.name in {"completed", "withdrawn"}:
        raise BadInput(f"{name} is already {before.shown_name}; {_instead(session)}")
    assert before.opened is not None, "session-opened is the first event of every session"
    _require_same_trials(name, session, before.opened.trials)
    _require_fresh(name, session, before.last_event_utc, now)


def _instead(session: Session) -> str:
    """Return what to do if the session is over."""
    if session.slides:
        return f"--session {session.number + 1} draws the block anew"
    if session.kind == "rehearsal":
        return (
            "rehearse as another participant; a rehearsal does not use up the session of "
            f"{session.participant}"
        )
    return "choose another participant or --session"


def _require_accepted_study(journal: Journal, session: Session) -> None:
    """Require the study file of the earlier sessions, or its latest amendment."""
    accepted = accepted_digests(journal)
    if accepted and text_digest(session.study_text) != accepted[-1]:
        raise BadInput(
            "study.toml has changed since the last session; restore it, its pictures and language "
            "files, or accept the change with touchbeam amend --reason TEXT"
        )


def _require_same_trials(name: str, session: Session, opened: Sequence[PlannedTrial]) -> None:
    planned, before = (
        [(trial.index, trial.kind, trial.condition) for trial in trials]
        for trials in (session.plan.trials, opened)
    )
    if planned != before:
        changed = "amended" if session.registration is None else "registered or amended"
        raise BadInput(
            f"{name} has different trials in the {changed} study; finish it as --session "
            f"{session.number + 1}"
        )


def _require_fresh(name: str, session: Session, last_event: datetime | None, now: datetime) -> None:
    if last_event is None:
        return
    limit_h = session.study.session.resume_within_h
    if last_event - now > timedelta(hours=limit_h):
        raise BadInput(
            f"{name} was interrupted at {last_event:%Y-%m-%d %H:%M} UTC, which lies in the future; "
            "check this computer's clock"
        )
    if now - last_event > timedelta(hours=limit_h):
        other = "" if session.slides else "participant or "
        hours = (now - last_event).total_seconds() / 3600
        raise BadInput(
            f"{name} was interrupted {hours:.0f} h ago and must be resumed within {limit_h:g} h; "
            f"exclude it (touchbeam exclude) and choose another {other}--session"
        )
