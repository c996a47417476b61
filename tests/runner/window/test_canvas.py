"""The window opens, and what it draws stays within its estimated size: what fits by it fits."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from protocol.study.participant_texts import study_wording
from protocol.study_file.loading import parsed_study, template
from runner.window.client import participant_window
from runner.window.messages import Settings
from tests.runner.command_line import TOUCHBEAM

pytestmark = pytest.mark.waits

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("language", "display", "width"),
    [("en", "small_display", 800), ("zh", "large_display", 1920)],
)
def test_no_line_is_wider_on_the_screen_than_estimated(
    language: str, display: str, width: int, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    environment = {"DISPLAY": request.getfixturevalue(display), "HOME": str(tmp_path)}
    drawn = subprocess.run(
        [sys.executable, "-m", "tests.runner.window.drawn", language, str(tmp_path)],
        env={**os.environ, **environment},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(drawn.stdout.splitlines()[-1])
    assert found["screens"] > 15
    assert found["too_wide"] == []
    assert found["needless"] == [], "the window opens sooner without it"
    assert (tmp_path / f"score-chosen-{language}-{width}.png").stat().st_size < 50_000


def test_the_users_own_settings_of_psychopy_do_not_matter(
    small_display: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Nothing can be read from it or written there, as where another user made it.
    (tmp_path / ".psychopy3").write_text("[general]", encoding="utf-8")
    monkeypatch.setenv("DISPLAY", small_display)
    monkeypatch.setenv("HOME", str(tmp_path))
    settings = Settings(wording=study_wording(parsed_study(template("paper")), "en"))
    with participant_window([TOUCHBEAM, "participant-window"], settings) as participant:
        assert participant.is_there()
