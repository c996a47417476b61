"""The participant behind the window, as the session sees them: show and poll, never wait."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from protocol.errors import WorkFailed
from runner.screens import Response, Screen
from runner.window.wire import show_message

SILENT_S = 2.0
"""A window that draws says so five times a second; after this long it is stuck."""

_COUNTED_S = 0.25
"""The most that counts as silence between two polls: a pause of the session is not the window's."""

GO_ON = "run the same command to go on, with --ratings console if need be"


class WindowGone(WorkFailed):
    """The participant's window does not work any more; the session can be resumed."""


class Peer(Protocol):
    """The window's process."""

    def send(self, message: Mapping[str, Any]) -> None:
        """Say something; raises `WindowGone` if nobody listens."""
        ...

    def received(self) -> list[Mapping[str, Any]]:
        """Return what it said since the last call; raises `WindowGone` once it has ended."""
        ...


@dataclass
class WindowParticipant:
    """Sends screens to the window and gives back what was answered there."""

    peer: Peer
    monotonic_s: Callable[[], float]
    call_operator: Callable[[], None] = lambda: None
    shown_s: float | None = field(default=None, init=False)
    _number: int = field(default=0, init=False)
    _answer: Response | None = field(default=None, init=False)
    _silent_s: float = field(default=0.0, init=False)
    _polled_s: float | None = field(default=None, init=False)

    def show(self, screen: Screen) -> None:
        """Send `screen`."""
        self._number += 1
        self._answer = self.shown_s = None
        self.peer.send(show_message(self._number, screen))

    def poll(self) -> Response | None:
        """Return the answer to the last screen.

        Raises:
            WindowGone: the window was closed, has ended, or has been silent for too long.
        """
        messages = self.peer.received()
        for message in messages:
            self._take(message)
        self._watch(heard=bool(messages))
        answer, self._answer = self._answer, None
        return answer

    def _take(self, message: Mapping[str, Any]) -> None:
        if "closed" in message:
            raise WindowGone(f"the participant's window was closed; {GO_ON}")
        if "broken" in message:
            raise WindowGone(f"the participant's window cannot draw ({message['broken']}); {GO_ON}")
        if "operator" in message:
            self.call_operator()
        elif message.get("shown") == self._number:
            self.shown_s = message["at_s"]
        elif message.get("of") == self._number:
            self._answer = Response(
                answer=message["answer"],
                reaction_time_s=message["reaction_time_s"],
                trace=message["trace"],
            )

    def _watch(self, *, heard: bool) -> None:
        now_s = self.monotonic_s()
        passed_s = 0.0 if self._polled_s is None else now_s - self._polled_s
        self._polled_s = now_s
        self._silent_s = 0.0 if heard else self._silent_s + min(passed_s, _COUNTED_S)
        if self._silent_s > SILENT_S:
            raise WindowGone(
                f"the participant's window is stuck (silent for {SILENT_S:g} s); {GO_ON}"
            )
