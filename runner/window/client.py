"""The session's side of the participant's window, which runs in a process of its own."""

import os
import queue
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import IO, Any, Protocol

from protocol.errors import WorkFailed
from runner.screens import Response, Screen
from runner.window.messages import Settings, line_of, message_of, settings_message, show_message

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
    _number: int = field(default=0, init=False)
    _answer: Response | None = field(default=None, init=False)
    _silent_s: float = field(default=0.0, init=False)
    _polled_s: float | None = field(default=None, init=False)

    def show(self, screen: Screen) -> None:
        """Send `screen`."""
        self._number += 1
        self._answer = None
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


OPENS_WITHIN_S = 30.0
LINGERS_S = 20.0
"""How long the last page stays unless the participant closes it."""

_ENDS_WITHIN_S = 3.0
_TICK_S = 0.02


@dataclass
class WindowProcess:
    """The window's process and what it said; a thread reads, so that nobody waits for it."""

    process: "subprocess.Popen[str]"
    complaints: IO[bytes]

    def __post_init__(self) -> None:
        self._said: queue.SimpleQueue[Mapping[str, Any] | None] = queue.SimpleQueue()
        # A daemon: where the process hangs, so does its pipe, and the session must be able to end.
        threading.Thread(target=self._read, name="window", daemon=True).start()

    def send(self, message: Mapping[str, Any]) -> None:
        """Write a line to the process.

        Raises:
            WindowGone: it has ended.
        """
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(line_of(message))
            self.process.stdin.flush()
        except OSError:
            raise self._gone() from None

    def received(self) -> list[Mapping[str, Any]]:
        """Return what it said since the last call.

        Raises:
            WindowGone: it has ended and everything it said has been taken.
        """
        messages: list[Mapping[str, Any]] = []
        while not self._said.empty():
            message = self._said.get()
            if message is not None:
                messages.append(message)
                continue
            self._said.put(None)  # the end stays to be found by the next call
            if messages:
                return messages
            raise self._gone()
        return messages

    def end(self) -> None:
        """Ask the process to end, then make it; a stopped one cannot be asked."""
        assert self.process.stdin is not None
        with suppress(OSError):
            self.process.stdin.close()
        try:
            self.process.wait(_ENDS_WITHIN_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def _read(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as lines:
            for line in lines:
                self._said.put(message_of(line))
        self._said.put(None)

    def _gone(self) -> WindowGone:
        """Say how it ended, with the last thing that its libraries printed."""
        self.complaints.seek(0)
        printed = self.complaints.read().decode(errors="replace").strip().splitlines()
        last = f": {printed[-1].strip()}" if printed else ""
        return WindowGone(f"the participant's window has ended unexpectedly{last}; {GO_ON}")


@contextmanager
def participant_window(
    command: Sequence[str],
    settings: Settings,
    monotonic_s: Callable[[], float] = time.monotonic,
) -> Iterator[WindowParticipant]:
    """Open the window and give its participant; the last page stays until it has been read.

    Args:
        command: what starts the window's process.
        settings: its screen and language.
        monotonic_s: the session's clock, s.

    Raises:
        WorkFailed: there is no display, no such screen, no font, or the window does not open.
    """
    _require_display()
    with tempfile.TemporaryFile() as complaints:
        peer = _started(command, complaints)
        try:
            peer.send(settings_message(settings))
            _await_opening(peer, time.monotonic() + OPENS_WITHIN_S)
            participant = WindowParticipant(peer, monotonic_s)
            yield participant
            _linger(participant, time.monotonic() + LINGERS_S)
        finally:
            peer.end()


def _started(command: Sequence[str], complaints: IO[bytes]) -> WindowProcess:
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=complaints,
        text=True,
        encoding="utf-8",
        env={**os.environ, "PSYCHOPYNOPACKAGES": "1"},  # else psychopy changes PYTHONPATH
        start_new_session=True,  # Ctrl-C is the session's to handle: the device goes off first
    )
    return WindowProcess(process, complaints)


def _require_display() -> None:
    needed = sys.platform.startswith("linux")
    if needed and not os.environ.get("DISPLAY"):
        raise WorkFailed(
            "there is no display for the participant's window (DISPLAY is not set); "
            "use --ratings console"
        )


def _await_opening(peer: WindowProcess, until_s: float) -> None:
    while time.monotonic() < until_s:
        for message in peer.received():
            if "failed" in message:
                why = message["failed"]
                remedy = "" if "--ratings console" in why else "; use --ratings console"
                raise WorkFailed(f"{why}{remedy}")
            if "opened" in message:
                return
        time.sleep(_TICK_S)
    raise WorkFailed(
        f"the participant's window did not open within {OPENS_WITHIN_S:g} s "
        "(a virtual screen needs 24 bits); use --ratings console"
    )


def _linger(participant: WindowParticipant, until_s: float) -> None:
    """The session is over and written down: whatever the window does now changes nothing."""
    with suppress(WindowGone):
        while participant.poll() is None and time.monotonic() < until_s:
            time.sleep(_TICK_S)
