"""The choice of the participant's screen: asked for once, and kept for this computer."""

import json
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from protocol.errors import BadInput
from runner.displays.screen_list import ScreenPlace, listed_screens, numbered_screens
from runner.people.terminal import at_terminal
from runner.study.files import state_folder

Say = Callable[[str], None]
"""Prints a line."""


def participants_screen(
    touchbeam: Sequence[str], wanted: int | None, say: Say, *, windowed: bool = False
) -> int:
    """Return the number of the participant's screen.

    Args:
        touchbeam: touchbeam's own command.
        wanted: the number that the operator gave, if any.
        say: prints a line for the operator.
        windowed: whether the window leaves a part of the screen free.

    Raises:
        BadInput: there are several screens, and nobody can be asked which it is.
    """
    if wanted is not None:
        return wanted
    there = listed_screens(touchbeam)
    if len(there) == 1 and not windowed:
        say(f"This computer has one screen ({there[0]}): the participant's window will cover it.")
    if len(there) < 2:
        return 0  # the window says what is wrong with a display that has none
    screen = _kept(there)
    if screen is None:
        with numbered_screens(touchbeam):
            screen = _asked(there, say)
        _keep(screen, say)
    say(f"The participant's screen is {screen}; --screen N chooses another one.")
    return screen.number


def _asked(there: Sequence[ScreenPlace], say: Say) -> ScreenPlace:
    """Ask the operator, who sees each screen's number on it."""
    choices = ", ".join(map(str, there))
    if not at_terminal(sys.stdin, sys.stdout):
        raise BadInput(
            f"this computer has several screens ({choices}); choose the participant's with "
            "--screen N"
        )
    say(f"Each screen shows its number ({choices}).")
    while True:
        say("Type the number of the participant's screen, then press Enter.")
        typed = sys.stdin.readline()
        if not typed:
            raise BadInput("the participant's screen must be chosen; use --screen N")
        for screen in there:
            if typed.strip() == str(screen.number):
                return screen


def choice_file() -> Path:
    """Return where the choice is kept."""
    return state_folder() / "participant-screen.json"


def _kept(there: Sequence[ScreenPlace]) -> ScreenPlace | None:
    """Return the screen that was chosen on this computer, if it is still there."""
    with suppress(OSError, ValueError, TypeError):
        kept = ScreenPlace(**json.loads(choice_file().read_text(encoding="utf-8")))
        return next((screen for screen in there if screen.is_same(kept)), None)
    return None


def _keep(screen: ScreenPlace, say: Say) -> None:
    try:
        choice_file().parent.mkdir(parents=True, exist_ok=True)
        choice_file().write_text(json.dumps(asdict(screen)) + "\n", encoding="utf-8")
    except OSError as error:
        say(f"warning: the choice cannot be kept ({error.strerror})")
