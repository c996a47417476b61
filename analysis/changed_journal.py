"""What a reader of results is told where the journal's chain of hashes is broken."""

from collections.abc import Sequence


def changed_journal(sessions: Sequence[str]) -> str:
    """Return what the results of a journal may be where the chains of `sessions` are broken."""
    return (
        "The journal was changed by other means than touchbeam, so that these may not be the "
        f"answers that were given. The chain of hashes is broken in {', '.join(sessions)}; "
        "touchbeam verify tells more."
    )
