"""A session of a track at a real window: touches, questions and answers as people give them."""

import re
from pathlib import Path

import pytest

from tests.protocol.studies import TRACKS
from tests.runner.window.person import Person
from tests.runner.window.sessions import Seat

pytestmark = pytest.mark.waits

QUICK = re.sub(
    r"catch = 2\neasy = 1\n|stop = .*\n", "", TRACKS.partition('[[track]]\nname = "felt"')[0]
).replace("trials = 9", "trials = 4")
QUICK = QUICK.replace("hold_s = 1.0", "hold_s = 0.25\nlead_in_s = 0.3").replace(
    "[session]", "[timing]\nreadable_s = 0.3\n\n[rig]\nwatchdog_s = 5\n\n[session]"
)
CHOICES = [0, 1, 1, 0]
NAMES = ("first", "second")


class Ambidextrous(Person):
    """Somebody who takes the mouse and the keyboard in turn."""

    def act(self) -> None:
        self.control = "mouse" if len(self.given) % 2 else "keyboard"
        super().act()


def test_the_answers_at_the_window_choose_the_levels(small_display: str, tmp_path: Path) -> None:
    seat = Seat(tmp_path / "study", small_display, QUICK)
    person = Ambidextrous(small_display, "keyboard", CHOICES)
    with seat.start() as session:
        assert session.attend(person) == 0, session.complaint
    answers = seat.payloads("answered")
    assert [each["change"] for each in answers] == [NAMES[it] for it in CHOICES]
    assert person.given == CHOICES
    level = 10  # one step harder after a right answer, two easier after a wrong one
    for each in answers:
        assert each["track"]["level"] == level
        right = NAMES[each["track"]["interval"] - 1]
        assert each["track"]["correct"] == (each["change"] == right)
        level = min(level + (-1 if each["track"]["correct"] else 2), 10)
    by = [{change["by"] for change in each["traces"][0]["changes"]} for each in answers]
    assert by == [{"key"}, {"pointer"}] * 2
    driven = [each["commanded"]["voltage_v"] for each in seat.payloads("touch-started")]
    assert [sorted(driven[at : at + 2]) for at in (0, 2, 4, 6)] == [
        [0.0, each["track"]["value"]] for each in answers
    ]
    assert seat.events()[-1].tag == "session-completed"
