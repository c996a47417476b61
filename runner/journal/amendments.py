"""Later decisions: exclusions, an amended study, withdrawals. Each one is appended as an event.

To exclude from a session or withdraw it, the caller must hold the session's lock, so that no
process is running it.
"""

from protocol.errors import BadInput
from protocol.journal.events import (
    Event,
    SessionExcluded,
    SessionOpened,
    StudyAmended,
    TrialExcluded,
    Withdrawn,
)
from protocol.journal.transitions import NotAllowed
from protocol.study_file.loading import text_digest
from runner.clock import Clock
from runner.journal.session_log import SessionLog, close_interrupted
from runner.journal.store import Journal
from runner.journal.verification import STUDY_CHAIN


def accepted_digests(journal: Journal) -> list[str]:
    """Return the digests of the study files accepted so far, the current one last."""
    events = journal.events_of(SessionOpened, StudyAmended)
    records = [event.record for event in events if not event.erased]
    return [
        record.study_sha256
        for record in records
        if isinstance(record, SessionOpened | StudyAmended) and record.study_sha256 is not None
    ]


def exclude_trial(journal: Journal, clock: Clock, session: str, index: int, reason: str) -> None:
    """Exclude a trial from the analysis.

    Raises:
        BadInput: there is no such session or trial, or it is already excluded.
    """
    log = _log(journal, clock, session)
    planned = log.state.planned
    if index not in planned:
        raise BadInput(f"{session} has no trial {index}; it has {_span(planned)}")
    if index in log.state.excluded:
        why = log.state.excluded[index]
        raise BadInput(f"trial {index} of {session} is already excluded: {why}")
    close_interrupted(log)
    _append(log, session, TrialExcluded(index=index, reason=reason))


def exclude_session(journal: Journal, clock: Clock, session: str, reason: str) -> None:
    """Exclude a session from the analysis; an unfinished one frees its slot.

    Raises:
        BadInput: there is no such session, or it is already excluded or withdrawn.
    """
    log = _log(journal, clock, session)
    close_interrupted(log)
    _append(log, session, SessionExcluded(reason=reason))


def amend(journal: Journal, clock: Clock, study_text: str, reason: str) -> None:
    """Accept a study file that has changed since the last session.

    Raises:
        BadInput: the study file has not changed.
    """
    digest = text_digest(study_text)
    accepted = accepted_digests(journal)
    if accepted and digest == accepted[-1]:
        raise BadInput("study.toml has not changed since it was accepted; nothing to amend")
    log = SessionLog(journal, STUDY_CHAIN, clock)
    log.append(StudyAmended(study_sha256=digest, reason=reason))


def withdraw(journal: Journal, clock: Clock, participant: str) -> list[str]:
    """Erase the data of `participant` in all sessions; return the names of the sessions.

    The events remain without their payloads, and their chains still verify.

    Raises:
        BadInput: `participant` has no session.
    """
    sessions = sessions_of(journal, participant)
    if not sessions:
        raise BadInput(f"{participant or 'a participant without a name'} has no sessions here")
    with journal.alone():
        for session in sessions:
            log = SessionLog(journal, session, clock)
            if log.state.name != "withdrawn":
                log.append(Withdrawn())
        journal.erase_payloads(sessions)
    journal.forget_erased()
    return sessions


def sessions_of(journal: Journal, participant: str) -> list[str]:
    """Return the names of the sessions of `participant`, without the study's own chain."""
    names = [name for name in journal.sessions() if name != STUDY_CHAIN]
    return [name for name in names if name.rpartition("/")[0] == participant]


def _log(journal: Journal, clock: Clock, session: str) -> SessionLog:
    if session not in journal.sessions():
        known = ", ".join(journal.sessions()) or "none"
        raise BadInput(f"there is no session {session} here; known: {known}")
    return SessionLog(journal, session, clock)


def _append(log: SessionLog, session: str, exclusion: Event) -> None:
    try:
        log.append(exclusion)
    except NotAllowed:
        raise BadInput(f"{session} is {log.state.name}; it cannot be excluded now") from None


def _span(indices: set[int]) -> str:
    return f"trials {min(indices)} to {max(indices)}" if indices else "no trials"
