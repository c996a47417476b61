"""The screens of a computer: listed by place and connector, and numbered on a real display."""

import os
import time
from dataclasses import replace

import pytest
from PIL import ImageGrab

from runner.screen_list import ScreenPlace, connectors, listed_screens, numbered_screens
from tests.runner.command_line import TOUCHBEAM
from tests.runner.window.person import virtual_display

pytestmark = pytest.mark.waits

LEFT = ScreenPlace(number=0, x=0, y=0, width=1280, height=720, name="eDP-1")
XRANDR = """Monitors: 2
 0: +*eDP-1 1280/309x720/174+0+0  eDP-1
 1: +HDMI-A-0 1920/531x1080/299+1280+0  HDMI-A-0
"""


def test_connectors_are_found_by_their_place() -> None:
    assert connectors(XRANDR) == {
        (0, 0, 1280, 720): "eDP-1",
        (1280, 0, 1920, 1080): "HDMI-A-0",
    }
    assert connectors("Can't open display") == {}


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (replace(LEFT, number=1, x=1920), True),
        (replace(LEFT, name="HDMI-1"), False),
        (replace(LEFT, number=1, name=None), True),
        (replace(LEFT, name=None, width=1920), False),
    ],
)
def test_a_screen_is_known_by_its_connector_else_by_place_and_size(
    other: ScreenPlace, same: bool
) -> None:
    assert LEFT.is_same(other) is same
    assert other.is_same(LEFT) is same


def test_the_screens_of_a_real_display_are_listed_and_numbered(
    small_display: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with virtual_display(800, 600, second=(1024, 768)) as display:
        monkeypatch.setenv("DISPLAY", display)
        there = listed_screens([TOUCHBEAM])
        assert [(screen.number, screen.width, screen.height) for screen in there] == [
            (0, 800, 600),
            (1, 1024, 768),
        ]
        with numbered_screens([TOUCHBEAM]):
            until_s = time.monotonic() + 20
            while not _bright(display) and time.monotonic() < until_s:
                time.sleep(0.1)
            assert _bright(display)


def _bright(display: str) -> bool:
    """Whether there is anything white on a display that was black."""
    picture = ImageGrab.grab(xdisplay=display).convert("L")
    return picture.getextrema()[1] == 255


def test_a_display_that_does_not_answer_has_no_screens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(os.environ, "DISPLAY", ":941")
    assert listed_screens([TOUCHBEAM]) == ()
