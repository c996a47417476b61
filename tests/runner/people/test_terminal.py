"""Single key presses from a terminal, also after a shell has changed its settings."""

import os
import pty
import sys
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest

from runner.people.terminal import TerminalGone, legible, terminal_keys


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The other end of a terminal that is this process's standard input, in the foreground."""
    keyboard, terminal = pty.openpty()
    with os.fdopen(terminal, "rb+", buffering=0) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())
        yield keyboard
    os.close(keyboard)


def switch_to_lines(terminal: int) -> None:
    """Change the settings as a shell does while a program is stopped."""
    settings = termios.tcgetattr(terminal)
    settings[3] |= termios.ICANON | termios.ECHO
    termios.tcsetattr(terminal, termios.TCSANOW, settings)


def test_a_key_arrives_without_enter(keyboard: int) -> None:
    with terminal_keys() as typed:
        assert typed(False) == ""
        os.write(keyboard, b" ")
        assert typed(False) == " "


def test_a_key_arrives_without_enter_after_the_program_was_stopped(keyboard: int) -> None:
    with terminal_keys() as typed:
        switch_to_lines(sys.stdin.fileno())
        assert typed(False) == ""
        os.write(keyboard, b" ")
        assert typed(False) == " "


def test_in_the_background_the_terminal_is_left_alone(
    keyboard: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No key reaches the program there, and the shell has changed the settings for itself."""
    with terminal_keys() as typed:
        monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp() + 1)
        switch_to_lines(sys.stdin.fileno())
        shells = termios.tcgetattr(sys.stdin.fileno())
        with pytest.raises(TerminalGone, match="the program is in the background, where no key"):
            typed(False)
    assert termios.tcgetattr(sys.stdin.fileno()) == shells
    with pytest.raises(TerminalGone, match="in the background"), terminal_keys():
        pass


def test_a_terminal_that_was_closed_is_said_to_be_gone() -> None:
    keyboard, terminal = pty.openpty()
    with os.fdopen(terminal, "rb+", buffering=0) as stdin, pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", stdin)
        with terminal_keys() as typed:
            os.close(keyboard)
            with pytest.raises(TerminalGone, match="terminal is gone: it was closed"):
                typed(False)


def test_the_settings_of_the_terminal_are_restored(keyboard: int) -> None:
    before = termios.tcgetattr(sys.stdin.fileno())
    with terminal_keys():
        assert termios.tcgetattr(sys.stdin.fileno()) != before
    assert termios.tcgetattr(sys.stdin.fileno()) == before


def test_a_terminal_that_was_read_before_can_still_be_read(tmp_path: Path) -> None:
    (tmp_path / "typed").write_bytes(b"old\n\xff\n")
    with (tmp_path / "typed").open(encoding="utf-8") as typed:
        legible(typed)
        assert typed.readline() == "old\n"
        legible(typed)  # as a session does after the operator told the group
        assert typed.readline() == "\ufffd\n"
