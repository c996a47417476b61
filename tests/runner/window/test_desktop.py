"""The desk of other tests is one: windows get and lose the keyboard, keys type what layouts say."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.runner.window.desktop import BESIDE, CONSOLE, desk

pytestmark = pytest.mark.waits

SCREENS = """
import pyglet
for screen in pyglet.canvas.get_display().get_screens():
    print(screen.x, screen.y, screen.width, screen.height)
"""


def test_the_window_library_sees_each_monitor() -> None:
    with desk(*BESIDE) as table:
        printed = subprocess.run(
            [sys.executable, "-c", SCREENS],
            env=table.environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
    assert printed.split("\n")[:2] == ["0 0 1280 1024", "1280 0 1024 768"]


def test_a_terminal_has_the_keyboard_until_it_is_minimised(tmp_path: Path) -> None:
    with desk() as table, table.terminal(["cat"], tmp_path / "printed") as terminal:
        table.focus(CONSOLE)
        for layout, typed in (("fr", "&-"), ("de", "16"), ("us", "16")):
            table.layout(layout)
            table.key("10", "15", "Return")
            terminal.watch(typed)
        table.minimise(CONSOLE)
        assert table.focused() != CONSOLE
        table.focus(CONSOLE)
        table.key("ctrl+d")
        assert terminal.end() == 0
