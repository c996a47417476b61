"""What the operator is asked to confirm, because it is more often a slip than meant."""

import re
from collections.abc import Callable

from protocol.errors import BadInput
from runner.journal.names import is_rehearsal, parsed_name
from runner.journal.store import Journal

Confirm = Callable[[str, str], None]
"""Asks whether a fact is meant; raises `BadInput`, with the option to give, if it is not."""


def refused(fact: str, option: str) -> None:
    """Refuse what nobody can confirm."""
    raise BadInput(f"{fact}; {option}")


def nearly_the_same(journal: Journal, participant: str, *, rehearsal: bool) -> str | None:
    """Return who else has a pseudonym that differs only in capitals, zeros or separators.

    Sessions are compared with sessions, rehearsals with rehearsals. None if there is nobody, or if
    the study knows `participant` already.
    """
    alike = [
        other
        for chain in journal.sessions()
        if _essence(other := parsed_name(chain).participant) == _essence(participant)
        and is_rehearsal(journal, chain) == rehearsal
    ]
    return None if participant in alike else next(iter(alike), None)


def _essence(pseudonym: str) -> str:
    """Return what remains of a pseudonym without what people mistype.

    >>> _essence("P08"), _essence("p-8"), _essence("P80")
    ('p8', 'p8', 'p80')
    """
    return re.sub("(?<![0-9])0+(?=[0-9])", "", re.sub("[_-]", "", pseudonym.casefold()))
