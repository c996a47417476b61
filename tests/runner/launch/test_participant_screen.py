"""The participant's screen: asked for where there are several, and kept for this computer."""

import io
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from protocol.errors import BadInput
from runner.launch import participants
from runner.launch.participants import choice_file, participants_screen
from runner.people import terminal
from runner.screen_list import ScreenPlace

LEFT = ScreenPlace(number=0, x=0, y=0, width=1280, height=720, name="eDP-1")
RIGHT = ScreenPlace(number=1, x=1280, y=0, width=1920, height=1080, name="HDMI-1")

Choose = Callable[..., tuple[int, list[str]]]


@pytest.fixture
def choose(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Choose:
    """Return a function that chooses among screens; `typed` is typed at a terminal, if given."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))

    def chosen(
        *there: ScreenPlace,
        typed: str | None = None,
        wanted: int | None = None,
        windowed: bool = False,
    ) -> tuple[int, list[str]]:
        said: list[str] = []
        monkeypatch.setattr(participants, "listed_screens", lambda _: there)
        monkeypatch.setattr(participants, "numbered_screens", lambda _: nullcontext())
        for module in (participants, terminal):
            monkeypatch.setattr(module, "at_terminal", lambda *_: typed is not None)
        monkeypatch.setattr("sys.stdin", io.StringIO(typed or ""))
        screen = participants_screen(["touchbeam"], wanted, said.append, windowed=windowed)
        return screen, said

    return chosen


def test_nothing_is_asked_where_there_is_one_screen_and_the_operator_is_told(
    choose: Choose,
) -> None:
    assert choose(LEFT) == (
        0,
        [
            "This computer has one screen (0: 1280x720 at 0,0 (eDP-1)): the participant's window "
            "will cover it."
        ],
    )
    assert not choice_file().exists()


def test_a_small_window_does_not_cover_the_only_screen(choose: Choose) -> None:
    assert choose(LEFT, windowed=True) == (0, [])


def test_a_choice_is_kept_and_found_again_by_its_connector(choose: Choose) -> None:
    number, said = choose(LEFT, RIGHT, typed="7\n\n1\n")
    assert number == 1
    assert len([line for line in said if line.startswith("Type the number")]) == 3
    moved = replace(RIGHT, number=0, x=0), replace(LEFT, number=1, x=1920)
    assert choose(*moved) == (
        0,
        [
            "The participant's screen is 0: 1920x1080 at 0,0 (HDMI-1); --screen N chooses another "
            "one."
        ],
    )


def test_another_screen_is_asked_for_again(choose: Choose) -> None:
    choose(LEFT, RIGHT, typed="1\n")
    assert choose(LEFT, replace(RIGHT, name="DP-3"), typed="0\n")[0] == 0


def test_a_damaged_file_is_as_good_as_none(choose: Choose) -> None:
    choose(LEFT, RIGHT, typed="1\n")
    choice_file().write_text('{"number": 1}', encoding="utf-8")
    assert choose(LEFT, RIGHT, typed="0\n")[0] == 0


def test_without_a_terminal_the_number_must_be_given(choose: Choose) -> None:
    with pytest.raises(BadInput, match=r"several screens \(0: .*, 1: .*\); choose .* --screen N$"):
        choose(LEFT, RIGHT)
    with pytest.raises(BadInput, match="must be chosen; use --screen N"):
        choose(LEFT, RIGHT, typed="")


def test_the_operators_number_comes_first(choose: Choose) -> None:
    choose(LEFT, RIGHT, typed="1\n")
    assert choose(LEFT, RIGHT, wanted=0) == (0, [])
