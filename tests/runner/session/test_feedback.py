"""Feedback on the own force and movement, in the trials for which the study has it."""

from pathlib import Path

import pytest

from protocol.study_file.loading import template
from runner.journal.opening import open_journal
from runner.screens import LeadIn, Pacing
from runner.session.loop import run
from tests.runner.fakes import FakeDevice, FakeParticipant, context

PRACTISED = 2
"""Practice trials of the study `extended`."""


def felt(folder: Path, feedback: str) -> FakeParticipant:
    participant = FakeParticipant()
    text = template("extended") + f'\n[as_instructed]\nfeedback = "{feedback}"\n'
    with open_journal(folder / "study.db") as journal:
        run(context(journal, FakeDevice(), participant, text))
    return participant


def test_nobody_sees_the_own_finger_unless_the_study_says_so(tmp_path: Path) -> None:
    assert felt(tmp_path, "never").fingers == []


@pytest.mark.parametrize("feedback", ["practice", "always"])
def test_the_own_finger_is_seen_during_touches(tmp_path: Path, feedback: str) -> None:
    participant = felt(tmp_path, feedback)
    touches = [screen for screen in participant.shown if isinstance(screen, Pacing)]
    seen = {id(screen) for screen, _ in participant.fingers if isinstance(screen, Pacing)}
    assert all(isinstance(screen, LeadIn | Pacing) for screen, _ in participant.fingers)
    if feedback == "always":
        assert seen == set(map(id, touches))
    else:
        assert 0 < len(seen) < len(touches)
        last = max(place for place, screen in enumerate(touches) if id(screen) in seen)
        assert len(seen) >= PRACTISED
        assert last < len(touches) / 2, "feedback ends with practice"
    assert {finger.within for _, finger in participant.fingers} == {0.5}
    forces = {round(finger.force, 3) for _, finger in participant.fingers}
    assert forces <= {1.0, round(0.5 / 0.75, 3)}, "relative to the instructed force"
