"""The names of a journal's chains: one for each session, each rehearsal, and the study itself.

A participant's session is `P01/1`, the rehearsal of that name `P01/1 (rehearsal)`. In journals of
earlier versions a rehearsal is `P01/1` as well; the session itself then is `P01/1 (participant)`.
"""

import re
from contextlib import suppress
from typing import NamedTuple

from protocol.journal.events import NOBODY, SessionOpened
from runner.journal.store import Journal

STUDY_CHAIN = "@study"
"""The chain of decisions on the study as a whole."""
REHEARSAL = "rehearsal"
_NAME = re.compile(r"(.*)/([0-9]{1,9})(?: \((rehearsal|participant)\))?", re.DOTALL)


class SessionName(NamedTuple):
    """The parts of a chain's name; `kind` is empty if the name does not give it."""

    participant: str
    number: int
    kind: str

    @property
    def plain(self) -> str:
        """The session without its kind, as people call it."""
        return session_name(self.participant, self.number)


def session_name(participant: str, number: int) -> str:
    """Return what people call a session, rehearsed or not."""
    return f"{participant}/{number}"


def parsed_name(chain: str) -> SessionName:
    """Return the parts of the name `chain`; one that touchbeam has not written is a participant.

    >>> parsed_name("P01/2 (rehearsal)")
    SessionName(participant='P01', number=2, kind='rehearsal')
    """
    parts = _NAME.fullmatch(chain)
    if parts is None:
        return SessionName(chain.rpartition("/")[0] or chain, 0, "")
    return SessionName(parts[1], int(parts[2]), parts[3] or "")


def is_rehearsal(journal: Journal, chain: str) -> bool:
    """Return whether `chain` is a rehearsal; one erased in an earlier version does not tell."""
    # Names of this version tell it themselves, even if the payloads are erased.
    if kind := parsed_name(chain).kind:
        return kind == REHEARSAL
    first = next(iter(journal.chain(chain)), None)
    if first is None or first.event.tag != SessionOpened.TAG or first.event.erased:
        return False
    with suppress(KeyError, TypeError, AttributeError):  # an edited journal
        opened = first.event.record
        return isinstance(opened, SessionOpened) and opened.kind == REHEARSAL
    return False


def spoken_name(journal: Journal, chain: str) -> str:
    """Return what people call the session of `chain`; a rehearsal is named as such."""
    named = parsed_name(chain)
    return f"{named.plain} ({REHEARSAL})" if is_rehearsal(journal, chain) else named.plain


def chain_name(journal: Journal, participant: str, number: int, *, rehearsal: bool) -> str:
    """Return the name of a participant's session, or of the rehearsal of that name."""
    plain = session_name(participant, number)
    rehearsed_plain = is_rehearsal(journal, plain)
    if rehearsal:
        return plain if rehearsed_plain else f"{plain} ({REHEARSAL})"
    # Earlier versions gave the rehearsal the plain name, and a chain's hashes contain its name.
    apart = f"{plain} (participant)"
    return apart if rehearsed_plain or apart in journal.sessions() else plain


def existing_chain(journal: Journal, participant: str, number: int, *, rehearsal: bool) -> str:
    """Return the same; without a session, the rehearsal of that name if there is one."""
    chain = chain_name(journal, participant, number, rehearsal=rehearsal)
    rehearsed = chain_name(journal, participant, number, rehearsal=True)
    known = journal.sessions()
    return rehearsed if chain not in known and rehearsed in known else chain


def chains_of(journal: Journal, participant: str, *, rehearsal: bool) -> list[str]:
    """Return the names of the sessions of `participant`, or of the rehearsals of that name."""
    return [
        chain
        for chain in journal.sessions()
        if chain != STUDY_CHAIN
        and parsed_name(chain).participant == participant
        and is_rehearsal(journal, chain) == rehearsal
    ]


def real_sessions(journal: Journal) -> list[str]:
    """Return the sessions that participants had; rehearsals, slides and scripts are none."""
    people = dict.fromkeys(parsed_name(chain).participant for chain in journal.sessions())
    return [
        chain
        for person in people
        if person not in {*NOBODY, STUDY_CHAIN}
        for chain in chains_of(journal, person, rehearsal=False)
    ]
