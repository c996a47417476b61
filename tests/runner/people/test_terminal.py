"""Single keys from a terminal, also after a shell has taken it back for a while."""

import os
import pty
import sys
import termios
from collections.abc import Iterator

import pytest

from runner.people.terminal import terminal_keys


@pytest.fixture
def keyboard(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """The other end of a terminal that is this process's standard input, in the foreground."""
    keyboard, terminal = pty.openpty()
    with os.fdopen(terminal, "rb+", buffering=0) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())
        yield keyboard
    os.close(keyboard)


def taken_back(terminal: int) -> None:
    """What a shell does with the terminal while a program is stopped."""
    settings = termios.tcgetattr(terminal)
    settings[3] |= termios.ICANON | termios.ECHO
    termios.tcsetattr(terminal, termios.TCSANOW, settings)


def test_a_key_comes_without_enter(keyboard: int) -> None:
    with terminal_keys() as typed:
        assert typed(False) == ""
        os.write(keyboard, b" ")
        assert typed(False) == " "


def test_a_key_comes_without_enter_after_the_program_was_stopped(keyboard: int) -> None:
    with terminal_keys() as typed:
        taken_back(sys.stdin.fileno())
        assert typed(False) == ""
        os.write(keyboard, b" ")
        assert typed(False) == " "


def test_in_the_background_the_terminal_is_left_alone(
    keyboard: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    with terminal_keys() as typed:
        monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp() + 1)
        taken_back(sys.stdin.fileno())
        assert typed(False) == ""
        assert termios.tcgetattr(sys.stdin.fileno())[3] & termios.ICANON


def test_the_terminal_is_as_before_afterwards(keyboard: int) -> None:
    before = termios.tcgetattr(sys.stdin.fileno())
    with terminal_keys():
        assert termios.tcgetattr(sys.stdin.fileno()) != before
    assert termios.tcgetattr(sys.stdin.fileno()) == before
