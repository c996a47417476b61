"""Drawn text stays within its estimated size, so a text that fits by estimate fits the screen."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

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
