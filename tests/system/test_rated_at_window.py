"""What was felt is rated at the real window, by mouse and keys, on scales of any range."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from protocol.study_file.loading import template, template_pictures
from runner.window.question_pages import SCALE_BOX
from tests.runner.window.person import Controls, Person
from tests.runner.window.sessions import Seat

pytestmark = pytest.mark.waits

_LENGTH = 660.0
"""Of the line of a scale, in units of the canvas."""
_KEYS = {"-": "minus"}


@dataclass
class Rater(Person):
    """Rates on a scale from `low` to `high`."""

    low: int = 0
    high: int = 10

    def _score(self, score: int) -> None:
        self.scored.append(score)
        if self.control == "mouse":
            middle = (self.low + self.high) / 2
            self.click((score - middle) * _LENGTH / (self.high - self.low), SCALE_BOX.y + 12)
        else:
            self.key(*(_KEYS.get(sign, sign) for sign in str(score)))


def plate(low: int, high: int) -> str:
    """The template's study on another scale: five short touches, and one at 0 V."""
    text = template("plate")
    head, _, rest = text.partition("[[group]]")
    changes = {
        r"(?s).*(?=\[rating\])": "",
        r"minimum = 1": f"minimum = {low}",
        r"maximum = 7": f"maximum = {high}",
        r"at = 1,": f"at = {low},",
        r"at = 7,": f"at = {high},",
    }
    for pattern, new in changes.items():
        rest, count = re.subn(pattern, new, rest, count=1)
        assert count, pattern
    head = head.replace("repeats = 4", "repeats = 1").replace("trials = 2", "trials = 1")
    head = head.replace("sliding_speed_m_s = 0.04", "sliding_speed_m_s = 0.3\nlead_in_s = 0.3")
    head = head.replace("[rig]", "[timing]\nreadable_s = 0.3\n\n[rig]\nramp_v_per_s = 2000", 1)
    return head + rest


@pytest.mark.parametrize(
    ("low", "high", "scores", "control"),
    [
        (1, 7, (2, 7, 1, 4, 3, 6), "mouse"),
        (-3, 3, (-3, 0, 2, -1, 1, 3), "keyboard"),
        (0, 100, (7, 100, 42, 0, 50, 99), "mouse"),
    ],
)
def test_each_score_of_a_scale_can_be_given(
    small_display: str,
    tmp_path: Path,
    low: int,
    high: int,
    scores: tuple[int, ...],
    control: Controls,
) -> None:
    seat = Seat(tmp_path / "study", small_display, study=plate(low, high))
    for name, picture in template_pictures("plate").items():
        (seat.folder / name).write_bytes(picture)
    rater = Rater(small_display, control, scores=[*scores], low=low, high=high)
    with seat.start("--seed", "1") as session:
        assert session.attend(rater) == 0, session.complaint
    answers: list[Any] = [each for each in seat.payloads("answered") if each["condition"]]
    assert [each["score"] for each in answers] == [*scores]
    assert {each["kind"] for each in answers} == {"trial", "catch"}
    assert {each["change"] for each in answers} == {None}
    by = "pointer" if control == "mouse" else "key"
    for each in answers:
        assert len(each["traces"]) == len(each["reaction_time_s"]) == 1
        assert {change["by"] for change in each["traces"][0]["changes"]} == {by}
    assert "three" not in rater.seen
