"""The registrations in a journal, and the check that its sessions follow from them."""

from datetime import datetime

from protocol.errors import BadInput
from protocol.journal.events import SLIDE, SessionOpened, StudyRegistered, terms_in
from protocol.registration.registration import order_problem, registration_in
from runner.journal.names import STUDY_CHAIN, chains_of, is_rehearsal, parsed_name
from runner.journal.store import Journal

Registrations = list[tuple[datetime, StudyRegistered]]


def registrations(journal: Journal) -> Registrations:
    """Return the registrations of the study, each with its UTC, the one in force last."""
    return journal.records_of(StudyRegistered)


def in_force(journal: Journal) -> StudyRegistered | None:
    """Return the registration that sessions follow now, None if the study is not registered."""
    # The latest one replaces those before it, which the journal keeps.
    return next((record for _, record in reversed(registrations(journal))), None)


def real_sessions(journal: Journal) -> list[str]:
    """Return the sessions that participants had; rehearsals and sliding experiments are none."""
    people = dict.fromkeys(parsed_name(chain).participant for chain in journal.sessions())
    return [
        chain
        for person in people
        if person not in {SLIDE, STUDY_CHAIN}
        for chain in chains_of(journal, person, rehearsal=False)
    ]


def session_problem(journal: Journal, chain: str, known: Registrations) -> str:
    """Return why the session of `chain` does not follow from its registration; '' if it does.

    Its events can be read; `known` are the `registrations` of the journal.
    """
    events = journal.events(chain)
    if chain == STUDY_CHAIN:
        return _registered_problem(known)
    opened = events[0].record if events and not events[0].erased else None
    # Imported scores have no plan, and a withdrawn session tells none.
    if not isinstance(opened, SessionOpened):
        return ""
    before = any(utc <= events[0].utc for utc, _ in known)
    # A session that was opened before the registration cannot follow from it.
    if before and opened.registration is None and not is_rehearsal(journal, chain):
        return "it is not registered, although the study was registered before it"
    held = {None, *(record.registration for _, record in known)}
    for under in terms_in(events):
        # A journal made from exported data has sessions alone.
        if known and under.registration not in held:
            return "its registration is none that the journal holds"
        if problem := order_problem(opened, under):
            return problem
    return ""


def _registered_problem(known: Registrations) -> str:
    for _, record in known:
        try:
            made = registration_in(record.text, "a registration in the journal")
        except BadInput as error:
            return str(error)
        if (made.digest, made.study_sha256) != (record.registration, record.study_sha256):
            return "a registration in the journal does not have its digest"
    return ""
