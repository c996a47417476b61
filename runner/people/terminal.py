"""Text that is safe on a terminal, single key presses from one, and detection of terminals."""

import io
import os
import queue
import re
import select
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO, TypeVar

from protocol.errors import WorkFailed

_T = TypeVar("_T")
_OBEYED = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)
_OBEYED_IN_JSON = re.compile(f"(?!\n){_OBEYED.pattern}")


class TerminalGone(WorkFailed):
    """The operator's terminal takes and gives nothing any more."""

    def __init__(self, why: str = "it was closed, or its connection broke") -> None:
        super().__init__(f"the operator's terminal is gone: {why}")


def require_foreground(terminal: TextIO) -> None:
    """Raise `TerminalGone` if another program, such as the shell, has the keys of `terminal`."""
    with suppress(OSError, AttributeError):  # no shell shares it; on Windows none does
        if os.tcgetpgrp(terminal.fileno()) != os.getpgrp():
            raise TerminalGone(
                "the program is in the background, where no key reaches it; run it in the "
                "foreground"
            )


def visible(text: str) -> str:
    r"""Return the line `text` with escapes for the characters that a terminal would obey.

    These are control characters, line separators, those that turn the direction of writing, and
    halves of surrogate pairs. Whatever comes from a file, a journal or a device can hold them.

    >>> visible("触觉 \x1b[2J \u202e")
    '触觉 \\x1b[2J \\u202e'
    """
    # Without the quotes of a Python string.
    return _OBEYED.sub(lambda match: ascii(match[0])[1:-1], text)


def visible_json(text: str) -> str:
    r"""Return the same JSON document with escapes for the characters that a terminal would obey.

    Such characters occur only in its strings, except for the line feeds between its lines.

    >>> visible_json('["\x9b"]')
    '["\\u009b"]'
    """
    return _OBEYED_IN_JSON.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


@contextmanager
def said_in_background(say: Callable[[str], None]) -> Iterator[Callable[[str], None]]:
    """Yield a `say` that never blocks: a thread prints the lines, all of them before this ends.

    A pipe that is full, or a terminal that takes nothing, must not keep a session from stopping.
    The function raises what printing an earlier line raised.
    """
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    failed: list[Exception] = []

    def print_lines() -> None:
        while (line := lines.get()) is not None:
            try:
                say(line)
            # Raised at the session's next line: a thread's own exception would reach nobody.
            except Exception as error:
                failed.append(error)
                return

    def say_later(line: str) -> None:
        if failed:
            raise failed[0]
        lines.put(line)

    thread = threading.Thread(target=print_lines, name="lines", daemon=True)
    thread.start()
    try:
        yield say_later
    finally:
        lines.put(None)
        thread.join()


@contextmanager
def terminal_keys() -> Iterator[Callable[[bool], str]]:
    """Yield a function that returns the characters typed since the last call, without waiting.

    It raises `TerminalGone` once there is no terminal any more, or another program has it. The
    terminal does not echo in the body; its settings are restored afterwards.
    """
    try:
        import termios
    # Windows has no termios.
    except ImportError:
        yield lambda _: _windows_keys()
        return
    require_foreground(sys.stdin)  # the settings of another program are not changed
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    _take_keys(terminal)

    def typed(_: bool) -> str:
        require_foreground(sys.stdin)  # a session that no key can stop must not go on
        try:
            return _typed(terminal)
        except (OSError, termios.error) as error:
            raise TerminalGone from error

    try:
        yield typed
    finally:
        with suppress(termios.error, TerminalGone):
            require_foreground(sys.stdin)  # else the shell has restored them
            # Not TCSADRAIN, which waits for a terminal that takes no output.
            termios.tcsetattr(terminal, termios.TCSANOW, before)


def _take_keys(terminal: int) -> None:
    """Have each key delivered at once; Ctrl-S is one like the others and stops no output."""
    import termios
    import tty

    tty.setcbreak(terminal)
    settings = termios.tcgetattr(terminal)
    # Input modes. A display stopped by Ctrl-S would look as if nothing happened.
    settings[0] &= ~termios.IXON
    termios.tcsetattr(terminal, termios.TCSANOW, settings)


def _typed(terminal: int) -> str:
    import termios

    # Shells switch back to whole lines when they continue a program that was stopped.
    if termios.tcgetattr(terminal)[3] & termios.ICANON:
        _take_keys(terminal)
    ready, _, _ = select.select([terminal], [], [], 0)
    # A lone byte that is no UTF-8, from a broken connection for example, must not end a session.
    return os.read(terminal, 1024).decode("utf-8", "replace") if ready else ""


def _windows_keys() -> str:
    """Return the characters typed at a console of Windows; none elsewhere."""
    typed = ""
    try:
        import msvcrt
    except ImportError:
        return typed
    while msvcrt.kbhit():  # type: ignore[attr-defined,unused-ignore]
        typed += msvcrt.getwch()  # type: ignore[attr-defined,unused-ignore]
    return typed


def legible(source: TextIO) -> None:
    """Let bytes that are no text stand for unknown letters; nothing where a line was read before.

    They must not end what reads, and after the first line a stream can no longer be told.
    """
    if isinstance(source, io.TextIOWrapper):
        with suppress(io.UnsupportedOperation):
            source.reconfigure(errors="replace")


def typed_answer(say: Callable[[str], None], text: str, read: Callable[[str], _T | None]) -> _T:
    """Return what `read` makes of a line at the terminal; where it makes None of it, ask again.

    Raises `EOFError` where nobody can type.
    """
    while at_terminal(sys.stdin, sys.stdout):
        legible(sys.stdin)
        say(text)
        if not (typed := sys.stdin.readline()):
            break
        if (found := read(typed.strip())) is not None:
            return found
    raise EOFError(text)


def at_terminal(*streams: TextIO | None) -> bool:
    """Return whether all of `streams` are terminals.

    rich's own check does not serve: it takes FORCE_COLOR for a terminal.
    """
    return all(stream is not None and stream.isatty() for stream in streams)
