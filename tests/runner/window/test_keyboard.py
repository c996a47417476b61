"""The keyboards of several countries at a real window: digits, held keys, the emergency stop."""

import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.runner.window.desktop import CONSOLE, PARTICIPANT, Desk, desk

pytestmark = pytest.mark.waits

ROOT = Path(__file__).parents[3]
ROW = {str(digit): str(code) for digit, code in zip("1234567890", range(10, 20), strict=True)}
"""The keys above the letters, by their numbers in X."""
KEYPAD = dict(
    zip("7894561230", map(str, (*range(79, 82), *range(83, 86), *range(87, 91))), strict=True)
)
LAST = "Escape"


@dataclass
class Listener:
    """A window, and what has reached it."""

    desk: Desk
    heard: "queue.SimpleQueue[str]"

    def after(self, *keys: str) -> list[str]:
        """Press keys; return what reached the window."""
        self.desk.key(*keys, LAST)
        return self.until("key escape")

    def until(self, last: str) -> list[str]:
        """Return what reached the window before `last`."""
        lines: list[str] = []
        while (line := self.heard.get(timeout=60)) != last:
            lines.append(line)
        return lines


@pytest.fixture(scope="module")
def listener() -> Iterator[Listener]:
    with desk() as table:
        process = subprocess.Popen(
            [sys.executable, "-m", "tests.runner.window.listening"],
            env=table.environment,
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )
        assert process.stdin is not None
        assert process.stdout is not None
        heard: queue.SimpleQueue[str] = queue.SimpleQueue()
        lines = process.stdout

        def read() -> None:
            for line in lines:
                heard.put(line.rstrip("\n"))

        reader = threading.Thread(target=read)
        reader.start()
        try:
            made = Listener(table, heard)
            made.until("open")
            table.focus(PARTICIPANT)
            made.until("state True True")
            yield made
        finally:
            process.stdin.close()
            process.wait(60)
            reader.join()
            lines.close()


def digits(lines: list[str]) -> str:
    return "".join(line.removeprefix("key ") for line in lines if line.startswith("key "))


@pytest.mark.parametrize("layout", ["fr", "de", "us", "cz", "lt"])
@pytest.mark.parametrize("shift", ["", "shift+"])
def test_each_key_of_the_row_types_its_digit(listener: Listener, layout: str, shift: str) -> None:
    listener.desk.layout(layout)
    heard = listener.after(*(f"{shift}{code}" for code in ROW.values()))
    assert digits(heard) == "".join(ROW)


@pytest.mark.parametrize("layout", ["fr", "de", "us"])
@pytest.mark.parametrize("on", [True, False])
def test_the_keypad_types_its_digits_with_and_without_num_lock(
    listener: Listener, layout: str, on: bool
) -> None:
    listener.desk.layout(layout)
    listener.desk.num_lock(on=on)
    heard = listener.after(*KEYPAD.values(), "91")
    assert digits(heard) == "".join(KEYPAD) + "."
    # In a text, too.
    assert "".join(line.removeprefix("text ") for line in heard if "text" in line)[:10] == "".join(
        KEYPAD
    )


def test_letters_and_signs_are_those_of_the_layout(listener: Listener) -> None:
    listener.desk.layout("fr")
    heard = listener.after("10", "11", "15", "24")
    assert [line for line in heard if "text" in line] == ["text &", "text é", "text -", "text a"]
    listener.desk.layout("de")
    assert "text ß" in listener.after("20")
    assert digits(listener.after("61")) == "-"


def test_a_held_key_goes_down_once(listener: Listener) -> None:
    listener.desk.layout("us")
    listener.desk.hold("Return", 1.5)
    heard = listener.after("Return")
    assert [line for line in heard if line == "key enter"] == ["key enter"] * 2
    assert "again enter" in heard[1:-1]


def test_a_key_released_elsewhere_is_not_down_any_more(listener: Listener, tmp_path: Path) -> None:
    listener.desk.layout("us")
    with listener.desk.terminal(["cat"], tmp_path / "printed"):
        listener.desk.focus(PARTICIPANT)
        listener.until("state True True")
        listener.desk.run("xdotool", "keydown", "Return")
        listener.until("key enter")
        listener.desk.focus(CONSOLE)
        listener.desk.run("xdotool", "keyup", "Return")
        listener.desk.focus(PARTICIPANT)
        listener.until("state True True")
        assert "key enter" in listener.after("Return")
        # One that is still down is, though another window saw it go down.
        listener.desk.focus(CONSOLE)
        listener.desk.run("xdotool", "keydown", "Return")
        listener.desk.focus(PARTICIPANT)
        listener.until("again enter")
        listener.desk.run("xdotool", "keyup", "Return")
        heard = listener.after("Return")
        assert heard.count("key enter") == 1


@pytest.mark.parametrize("layout", ["us", "fr", "ru", "us,ru"])
@pytest.mark.parametrize("lock", ["", "Caps_Lock"])
def test_ctrl_e_is_the_emergency_stop_on_every_keyboard(
    listener: Listener, layout: str, lock: str
) -> None:
    listener.desk.layout(layout)
    listener.desk.key(*filter(None, [lock]), "ctrl+26", *filter(None, [lock]))
    assert "key emergency stop" in listener.after()
    heard = listener.after("26", "shift+26", "alt+26", "ctrl+27", "space")
    assert "key emergency stop" not in heard


def test_a_minimised_window_knows_it(listener: Listener) -> None:
    listener.desk.minimise(PARTICIPANT)
    listener.until("state False False")
    listener.desk.focus(PARTICIPANT)
    listener.until("state True True")


def test_only_the_left_button_presses(listener: Listener) -> None:
    place = listener.desk.place(PARTICIPANT)
    for button in (2, 3, 4, 5, 1):
        listener.desk.click(place.x + 100, place.y + 100, button)
    heard = [line for line in listener.after() if line[0].isupper()]
    assert heard == ["Pressed", "Released"]
