"""A virtual participant who answers at the participant's window, by pressing its keys."""

from dataclasses import dataclass, field
from typing import Protocol

from protocol.errors import WorkFailed
from runner.interfaces import Participant
from runner.screens import Ask, Notice, OwnFinger, Response, Screen

CLOSES_AFTER_S = 2.0
"""How long the last page is read."""


class Keys(Participant, Protocol):
    """A window with a keyboard."""

    def press(self, answer: str, reaction_time_s: float) -> None:
        """Let `answer` be chosen and confirmed once the screen was shown for that long."""
        ...


@dataclass
class VirtualAtWindow:
    """A virtual `person` who touches and answers as ever, but gives each answer in the `window`.

    The window says what was answered and when, as it does for people.
    """

    person: Participant
    window: Keys
    _screen: Screen | None = field(default=None, init=False)
    _meant: Response | None = field(default=None, init=False)

    def show(self, screen: Screen) -> None:
        """Show `screen` to the person in the window; the last one is closed when it is read."""
        self._screen, self._meant = screen, None
        self.window.show(screen)
        self.person.show(screen)
        if isinstance(screen, Notice) and screen.is_last:
            self.window.press("ready", CLOSES_AFTER_S)

    def progress(self, number: int, total: int) -> None:
        """Tell both which trial comes next."""
        self.window.progress(number, total)
        self.person.progress(number, total)

    def saved(self) -> None:
        """Let the window say that the answer is saved."""
        self.window.saved()

    def felt(self, finger: OwnFinger) -> None:
        """Let the window show the finger."""
        self.window.felt(finger)

    def poll(self) -> Response | None:
        """Return the answer that the window took, None before it did.

        Raises:
            WorkFailed: it is another answer than the person gave, or the window failed.
            VirtualParticipantLeft: the person has dropped out.
        """
        if meant := self.person.poll():
            self._meant = meant
            self.window.press(meant.answer, meant.reaction_time_s)
        given = self.window.poll()
        if given is not None and isinstance(self._screen, Ask):
            answer, wanted = self._screen.question.answer, self._meant
            if wanted is None or answer(given.answer) != answer(wanted.answer):
                raise WorkFailed(
                    f"the participant's window took {given.answer!r}, which the virtual "
                    "participant did not answer; leave its keys alone"
                )
        return given
