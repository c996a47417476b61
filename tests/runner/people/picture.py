"""Saves a picture of the operator's screen: `python -m tests.runner.people.picture FILE.svg`."""

import io
import re
import sys
from pathlib import Path

from rich.console import Console

from device.drivers.driver import Reading
from runner.people.operator_console import Frame
from runner.people.operator_screen import Instant, screen_lines
from runner.screens import Aim
from tests.runner.views import view

TITLE = "The operator's console during a touch"
AIM = Aim(
    voltage_v=200,
    frequency_hz=24_068,
    path_m=(0.010, 0.081),
    force_n=0.5,
    force_range_n=(0.25, 0.75),
)
READING = Reading(
    at_s=99.9,
    output=True,
    amplitude_v=134.0,
    frequency_hz=24_068.0,
    monitor_v=134.0,
    force_n=0.48,
    position_m=0.041,
    finger_s=99.9,
)
LOG = (
    ("14:02:30", "warning: testing the watchdog: hands off the surface"),
    ("14:02:31", "warning: measuring the resonance: hands off the surface"),
    ("14:02:37", "noted: skin dry"),
)


def picture() -> str:
    """Return the screen as SVG, with the reader's own font."""
    moment = Instant(
        reading=READING, now_s=100.0, said_s=99.0, elapsed_s=52, clock="14:03:22", until="14:05"
    )
    console = Console(record=True, width=100, file=io.StringIO(), force_terminal=True)
    for line in screen_lines(Frame(view=view(aim=AIM), messages=LOG), moment, 100, 24):
        console.print(line)
    drawn = console.export_svg(title=TITLE, unique_id="console")
    own_font = re.sub(r"@font-face \{.*?\}\s*", "", drawn, flags=re.DOTALL)
    return own_font.replace("<svg ", f'<svg role="img" aria-label="{TITLE}" ', 1)


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(picture(), encoding="utf-8")
