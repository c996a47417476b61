"""Later decisions: exclusions, an amended study, withdrawals. Each one is appended as an event.

To exclude from a session or withdraw it, the caller must hold the session's lock, so that no
process is running it.
"""

from collections.abc import Iterable

from protocol.errors import BadInput
from protocol.journal import events
from protocol.journal.state import NotAllowed, in_words
from protocol.study_file.loading import scale_ends, text_digest
from runner.clock import Clock
from runner.journal.names import REHEARSAL, STUDY_CHAIN, chains_of, is_rehearsal
from runner.journal.store import Journal, SessionLog, close_interrupted, state_of
from runner.journal.verification import in_force


def is_locked(journal: Journal) -> bool:
    """Return whether a changed study file must be accepted: not before the first session.

    Rehearsals lock nothing, and a registration does.
    """
    # By the chains, because an erased session had accepted its file, too.
    return bool(journal.events_of(events.StudyRegistered)) or any(
        chain != STUDY_CHAIN and not is_rehearsal(journal, chain) for chain in journal.sessions()
    )


def accepted_digests(journal: Journal) -> list[str]:
    """Return the digests of the study files accepted so far, the current one last."""
    if not is_locked(journal):  # what earlier versions had amended between rehearsals is no lock
        return []
    held = journal.records_of(events.SessionOpened, events.StudyAmended, events.StudyRegistered)
    digests = (
        getattr(record, "study_sha256", None)
        for _, record in held
        if getattr(record, "kind", None) != REHEARSAL
    )
    return [digest for digest in digests if digest is not None]


def changed_since_rehearsal(journal: Journal, study_text: str) -> bool:
    """Return whether the rehearsal that was begun last was of another study file."""
    rehearsed = [
        record.study_sha256
        for _, record in journal.records_of(events.SessionOpened)
        if record.kind == REHEARSAL and record.participant not in events.NOBODY
    ]
    return bool(rehearsed) and rehearsed[-1] not in {None, text_digest(study_text)}


def exclude(
    journal: Journal, clock: Clock, session: str, reason: str, trial: int | None = None
) -> None:
    """Exclude a session, which frees the slot of an unfinished one, or one of its trials.

    Raise `BadInput` if there is none, or if it is excluded or withdrawn already.
    """
    log = _log(journal, clock, session)
    left_out, excluded = log.state.not_needed, log.state.excluded
    planned = log.state.planned | left_out
    if trial is not None and trial not in planned:
        span = f"trials {min(planned)} to {max(planned)}" if planned else "no trials"
        raise BadInput(f"{session} has no trial {trial}; it has {span}")
    if trial in left_out:
        raise BadInput(
            f"trial {trial} of {session} was not made, because its track had ended; there is "
            "nothing to exclude"
        )
    if trial in excluded:
        raise BadInput(f"trial {trial} of {session} is already excluded: {excluded[trial]}")
    close_interrupted(log)
    if trial is None:
        _append(log, session, events.SessionExcluded(reason=reason))
    else:
        _append(log, session, events.TrialExcluded(index=trial, reason=reason))


def include(
    journal: Journal, clock: Clock, session: str, reason: str, trial: int | None = None
) -> None:
    """Take back the exclusion of a session or one of its trials, or raise `BadInput`."""
    log = _log(journal, clock, session)
    excluded = log.state.excluded
    trials = ", ".join(map(str, excluded))
    if trial is None:
        if not log.state.is_excluded:
            hint = f"; its excluded trials are {trials}: name one with --trial" if trials else ""
            raise BadInput(f"{session} is {_state(log)}, not excluded{hint}")
        _append(log, session, events.SessionIncluded(reason=reason))
    elif trial not in excluded:
        raise BadInput(
            f"trial {trial} of {session} is not excluded; excluded trials: {trials or 'none'}"
        )
    else:
        _append(log, session, events.TrialIncluded(index=trial, reason=reason))


def amend(
    journal: Journal, clock: Clock, study_text: str, reason: str
) -> events.StudyRegistered | None:
    """Accept a changed study file, or raise `BadInput`; return the registration that it breaks.

    Another scale is refused once people gave scores: no report can hold scores of both.
    """
    digest = text_digest(study_text)
    accepted = accepted_digests(journal)
    if accepted and digest == accepted[-1]:
        raise BadInput("study.toml has not changed since it was accepted; nothing to amend")
    _require_same_scale(journal, study_text)
    broken = in_force(journal)
    log = SessionLog(journal, STUDY_CHAIN, clock)
    breaks = None if broken is None else broken.registration
    log.append(events.StudyAmended(study_sha256=digest, reason=reason, breaks=breaks))
    return broken


def _require_same_scale(journal: Journal, study_text: str) -> None:
    """Refuse another scale than that of the sessions of people, unless they are excluded."""
    scale = scale_ends(study_text)
    for chain in journal.sessions():
        if chain == STUDY_CHAIN or is_rehearsal(journal, chain):
            continue
        stored = journal.events(chain)
        if stored[0].erased or state_of(chain, stored).is_excluded:
            continue
        opened = stored[0].record
        if not isinstance(opened, events.SessionOpened) or opened.participant in events.NOBODY:
            continue
        if opened.study_text is None:
            continue
        given = scale_ends(opened.study_text)
        if scale is not None and given not in {None, scale}:
            raise BadInput(
                "study.toml: scores are from {} to {}, but those of {} were given from {} to {}; "
                "restore [rating], make another study (touchbeam new), or exclude that session "
                "first".format(*scale, chain, *given)
            )


def withdraw(
    journal: Journal, clock: Clock, participant: str, *, rehearsal: bool = False
) -> list[str]:
    """Erase the data of `participant`, whose chains still verify; return the sessions' names."""
    sessions = sessions_of(journal, participant, rehearsal=rehearsal)
    # All sessions or none: an error must not leave a participant half withdrawn.
    with journal.alone():
        for session in sessions:
            log = SessionLog(journal, session, clock)
            # An erasure that did not reach the disk can be repeated without a second event.
            if log.state.name != "withdrawn":
                log.append(events.Withdrawn())
        journal.erase_payloads(sessions)
    # After the commit, because SQLite vacuums only outside a transaction.
    journal.forget_erased()
    return sessions


def unerased(journal: Journal, sessions: Iterable[str]) -> dict[str, str]:
    """Return which of `sessions` still hold data, and how much, in words."""
    amounts = {}
    for session in sessions:
        stored = journal.events(session)
        if all(event.erased for event in stored):
            continue
        done, planned = len((state := state_of(session, stored)).answered), len(state.planned)
        amounts[session] = f"{done} of {planned} trials answered" if planned else "imported scores"
    return amounts


def sessions_of(journal: Journal, participant: str, *, rehearsal: bool) -> list[str]:
    """Return a participant's sessions, or rehearsals if there are none or they are asked for.

    Raise `BadInput` if there is nothing of that name.
    """
    if participant in events.NOBODY:
        what = "the sliding experiment" if participant == events.SLIDE else "a script"
        raise BadInput(
            f"{what} has no participant who could withdraw; take it out of the analysis with "
            "touchbeam exclude"
        )
    sessions = [] if rehearsal else chains_of(journal, participant, rehearsal=False)
    sessions = sessions or chains_of(journal, participant, rehearsal=True)
    if not sessions:
        what = "rehearsals" if rehearsal else "sessions"
        raise BadInput(f"{participant or 'a participant without a name'} has no {what} here")
    return sessions


def _log(journal: Journal, clock: Clock, session: str) -> SessionLog:
    if session not in journal.sessions():
        known = ", ".join(it for it in journal.sessions() if it != STUDY_CHAIN) or "none"
        raise BadInput(f"there is no session {session} here; known: {known}")
    return SessionLog(journal, session, clock)


def _append(log: SessionLog, session: str, decision: events.Event) -> None:
    try:
        log.append(decision)
    except NotAllowed:
        what = decision.TAG.rpartition("-")[2]
        raise BadInput(f"{session} is {_state(log)}; it cannot be {what} now") from None


def _state(log: SessionLog) -> str:
    return in_words(log.state.name, running=False)  # a running one was refused before
