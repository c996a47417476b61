"""The conditions of a published table: those that the friction model knows, and the others."""

from collections.abc import Sequence

from device.conditions import CONDITIONS

_KNOWN = {name.casefold(): name for name in CONDITIONS}


def condition_name(text: str) -> str:
    """Return the model's name of a condition for one that differs from it in case only.

    >>> condition_name("Frequency"), condition_name("Colour")
    ('frequency', 'Colour')
    """
    return _KNOWN.get(text.casefold(), text)


def unpredicted_note(conditions: Sequence[str]) -> str | None:
    """Return in one line which conditions have no predicted contrast; None if all have one."""
    others = [name for name in conditions if name not in CONDITIONS]
    if not others:
        return None
    return (
        f"No contrast is predicted for {', '.join(others)}: "
        f"the friction model knows {', '.join(CONDITIONS)}."
    )
