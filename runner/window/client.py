"""The session's side of the participant's window, which runs in a separate process."""

import os
import queue
import signal
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
from runner.screens import Ask, OwnFinger, Response, Screen, WindowState, is_last
from runner.signals import Stopped, is_stopping
from runner.window import messages
from runner.window.elements import Input, Key
from runner.window.question_pages import inputs_for
from runner.window.response import EARLY_S, PendingResponse

SILENT_S = 2.0
"""A window sends `alive` five times a second; after this much silence it counts as stuck."""

_COUNTED_S = 0.25
"""Most silence counted between two polls, so that a slow session is not blamed on the window."""


class WindowGone(WorkFailed):
    """The participant's window has failed, as `how` says of it; the session can be resumed."""

    def __init__(self, how: str) -> None:
        super().__init__(f"the participant's window {how}; --ratings console works without it")


class Peer(Protocol):
    """The window's process."""

    def send(self, message: Mapping[str, Any]) -> None:
        """Send `message`; raises `WindowGone` if the process has ended."""

    def received(self) -> list[Mapping[str, Any]]:
        """Return the messages since the last call; raises `WindowGone` once it has ended."""


@dataclass
class WindowParticipant:
    """Participant in the window, whose buttons work once a page was shown for `readable_s`."""

    peer: Peer
    monotonic_s: Callable[[], float]
    readable_s: float = 0.0
    call_operator: Callable[[], None] = lambda: None
    _number: int = field(default=0, init=False)
    _answer: Response | None = field(default=None, init=False)
    _silent_s: float = field(default=0.0, init=False)
    _polled_s: float | None = field(default=None, init=False)
    _screen: Screen | None = field(default=None, init=False)
    _shown_s: float | None = field(default=None, init=False)
    _due: list[tuple[float, tuple[Input, ...]]] = field(default_factory=list, init=False)
    _state: WindowState | None = field(default=None, init=False)
    _stopped: bool = field(default=False, init=False)
    is_at_end: bool = field(default=False, init=False)

    def show(self, screen: Screen) -> None:
        # A late answer to the page before is not taken for this one's.
        self._number += 1
        self._answer = self._shown_s = None
        self._screen, self._due = screen, []
        self.is_at_end = is_last(screen)
        self.peer.send(messages.show_message(self._number, screen))

    def progress(self, number: int, total: int) -> None:
        self.peer.send({"progress": [number, total]})

    def saved(self) -> None:
        self.peer.send({"saved": self._number})

    def felt(self, finger: OwnFinger) -> None:
        self.peer.send({"finger": vars(finger)})

    def press(self, answer: str, reaction_time_s: float) -> None:
        """Let `answer` be chosen with the window's keys once the screen was shown for that long.

        It is confirmed as soon as the window allows it; nothing is due once another screen follows.
        """
        assert self._screen is not None
        question = self._screen.question if isinstance(self._screen, Ask) else None
        chosen = () if question is None else inputs_for(question, answer)
        # An earlier press would count as meant for the page before.
        chosen_s = max(reaction_time_s, EARLY_S)
        earliest_s = PendingResponse(self._screen, self.readable_s).earliest_s
        self._due = [(chosen_s, chosen), (max(chosen_s, earliest_s), (Key(name="enter"),))]

    def poll(self) -> Response | None:
        """Return the answer, if any; raises `WindowGone` if it is closed, gone or silent."""
        # An answer that came before the window ended still counts.
        if self._answer is None:
            self._listen()
        passed_s = -1.0 if self._shown_s is None else self.monotonic_s() - self._shown_s
        while self._due and self._due[0][0] <= passed_s:
            self.peer.send(messages.press_message(self._due.pop(0)[1]))
        answer, self._answer = self._answer, None
        return answer

    def stops(self) -> bool:
        self._listen()
        return self._stopped

    def window_state(self) -> WindowState | None:
        return self._state

    def _listen(self) -> None:
        """Take what the window sent; raises `WindowGone` if it is closed, gone or silent."""
        received = self.peer.received()
        for message in received:
            self._take(message)
        now_s = self.monotonic_s()
        quiet_s = 0.0 if self._polled_s is None else now_s - self._polled_s
        self._polled_s = now_s
        self._silent_s = 0.0 if received else self._silent_s + min(quiet_s, _COUNTED_S)
        if self._silent_s > SILENT_S:
            raise WindowGone(f"does not respond (silent for {SILENT_S:g} s)")

    def linger(self, longest_s: float) -> None:
        """Wait until the last page is closed, or a signal; return at once on another page."""
        until_s = time.monotonic() + longest_s * self.is_at_end
        # A signal that stopped the session leaves the page; one during the wait ends it.
        before = is_stopping()
        with suppress(WindowGone):  # the session is recorded
            while time.monotonic() < until_s and self.poll() is None:
                if is_stopping() != before:
                    break
                time.sleep(_TICK_S)

    def is_there(self) -> bool:
        with suppress(WindowGone):
            self.poll()
            return True
        return False

    def _take(self, message: Mapping[str, Any]) -> None:
        if how := _how_it_ends(message):
            raise WindowGone(how)
        self._stopped |= "stop" in message
        if "state" in message:
            self._state = WindowState(**message["state"])
        if "operator" in message:
            self.call_operator()
        elif message.get("shown") == self._number:
            self._shown_s = self.monotonic_s()
        elif message.get("of") == self._number:
            given = ("answer", "reaction_time_s", "trace")
            try:
                self._answer = Response(**{name: message[name] for name in given})
            except KeyError as error:
                raise WindowGone(f"sent an answer without {error}") from None


def _how_it_ends(message: Mapping[str, Any]) -> str:
    """Return what the window says of its end; nothing for another message."""
    if "broken" in message:
        return f"cannot draw ({message['broken']})"
    return "was closed" if "closed" in message else str(message.get("unseen", ""))


OPENS_WITHIN_S = 30.0
LINGERS_S = 20.0
"""How long the last page remains unless the participant closes it."""

HURRIES_S = 5.0
"""The same after a signal, such as Ctrl-C: whoever sends it wants the program to end."""

_ENDS_WITHIN_S = 3.0
_DIES_WITHIN_S = 0.2
"""How long a process may take to end once its pipe is closed: the output may be on meanwhile.

A lost display can keep it from ending at all.
"""
_TICK_S = 0.02


@dataclass
class WindowProcess:
    """The window's process; a thread reads its messages, so that the session never blocks."""

    process: "subprocess.Popen[str]"
    complaints: IO[bytes]

    def __post_init__(self) -> None:
        self._messages: queue.SimpleQueue[Mapping[str, Any] | None] = queue.SimpleQueue()
        self._why: str | None = None
        # A daemon thread: if the process hangs, so does its pipe, and the session must still end.
        self._reader = threading.Thread(target=self._read, name="window", daemon=True)
        self._reader.start()

    def send(self, message: Mapping[str, Any]) -> None:
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(messages.line_of(message))
            self.process.stdin.flush()
        # The pipe is closed, because the process is gone; `_gone` finds out why.
        except OSError:
            raise self._gone() from None

    def received(self) -> list[Mapping[str, Any]]:
        messages: list[Mapping[str, Any]] = []
        while not self._messages.empty():
            message = self._messages.get()
            if message is None:
                self._messages.put(None)  # keep the end marker for the next call
                # An answer that came before the end still counts.
                if messages:
                    return messages
                raise self._gone()
            if "garbled" in message:
                raise WindowGone(f"sent an invalid message ({message['garbled'][:120]})")
            messages.append(message)
        return messages

    def end(self) -> None:
        """Ask the process to end, then kill it; a stopped process cannot respond."""
        assert self.process.stdin is not None
        with suppress(WindowGone):
            self.send({"end": True})
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
            try:
                for line in lines:
                    self._messages.put(messages.message_of(line))
            except ValueError as error:  # of the text's encoding too
                self._messages.put({"garbled": str(error)})
        self._messages.put(None)

    def _gone(self) -> WindowGone:
        """Return the error for an ended process; one that does not end by itself is killed."""
        if self._why is None:
            with suppress(subprocess.TimeoutExpired):
                self.process.wait(_DIES_WITHIN_S)
            # Asked before the kill, which would look like the reason.
            self._why = f"ended unexpectedly{self._end()}"
            self.process.kill()
            self._reader.join(_DIES_WITHIN_S)
            # It may have said why just before a message to it failed.
            while not self._messages.empty():
                self._why = _how_it_ends(self._messages.get() or {}) or self._why
            self._messages.put(None)
        return WindowGone(self._why)

    def _end(self) -> str:
        """Return the signal that ended the process, or what its libraries printed last."""
        number = -(self.process.returncode or 0)
        if number > 0:
            why = next((found.name for found in signal.Signals if found == number), str(number))
            return f" (signal {why})"
        self.complaints.seek(0)
        printed = self.complaints.read().decode(errors="replace").strip().splitlines()
        # What Xlib prints before it ends the process.
        if any("X server" in line or "X connection" in line for line in printed):
            return " (its display was lost)"
        return f": {printed[-1].strip()}" if printed else ""


@contextmanager
def participant_window(
    command: Sequence[str], settings: messages.Settings, say: Callable[[str], None] = lambda _: None
) -> Iterator[WindowParticipant]:
    """Run `command`, which opens the window; yield its participant; leave the last page up.

    Raises `WorkFailed` if the display, the screen or a font is missing, or if it does not open.
    """
    # Before anything is started, because the message then names the remedy.
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise WorkFailed(
            "the participant's window needs a display (DISPLAY is not set); use --ratings console"
        )
    # A file and no pipe, because nobody reads it meanwhile and a full pipe would stop the window.
    with tempfile.TemporaryFile() as complaints:
        process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=complaints,
            text=True,
            encoding="utf-8",
            # Without the one PsychoPy changes PYTHONPATH. Without the other git, which it asks for
            # its version, obeys the settings of a study that the environment lies in.
            env={**os.environ, "PSYCHOPYNOPACKAGES": "1", "GIT_DIR": os.devnull},
            # Ctrl-C reaches only the session, which turns the device off first.
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        peer = WindowProcess(process, complaints)
        try:
            peer.send(messages.settings_message(settings))
            _await_opening(peer, time.monotonic() + OPENS_WITHIN_S)
            participant = WindowParticipant(peer, time.monotonic, settings.readable_s)
            try:
                yield participant
            except BaseException as error:
                longest_s = HURRIES_S if isinstance(error, Stopped) else LINGERS_S
                # Said before the wait, because the operator would take it for a hang.
                if participant.is_at_end and participant.is_there():
                    lines = "; ".join([str(error), *getattr(error, "__notes__", ())])
                    say(f"{lines}; the participant's last page stays for up to {longest_s:g} s")
                participant.linger(longest_s)
                raise
            participant.linger(LINGERS_S)
        finally:
            # On every way out: a window without a session would cover the participant's screen.
            peer.end()


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
        "(a virtual screen must be 24 bits deep); use --ratings console"
    )
