"""The command that starts this very touchbeam again, for processes of its own."""

import sys
from pathlib import Path


def touchbeam_command() -> tuple[str, ...]:
    """Return the command that starts the touchbeam of this environment."""
    return (str(Path(sys.executable).with_name("touchbeam")),)
