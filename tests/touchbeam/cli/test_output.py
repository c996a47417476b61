"""Progress bars and tables: a progress bar appears only on a real terminal."""

import sys
import warnings

import numpy as np
import pytest

from analysis.statistics.intervals import mean_interval
from touchbeam.cli.output import print_table, progress, warnings_in_lines


@pytest.fixture(autouse=True, params=["xterm-256color", "dumb"])
def colours_wanted(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Set FORCE_COLOR, as some CI systems do although they have no terminal."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setenv("TERM", request.param)


def test_there_is_no_progress_bar_without_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    with progress("participants", 2) as step:
        step()
        step()
    assert capsys.readouterr() == ("", "")


def test_a_pipe_gets_every_row_whole(capsys: pytest.CaptureFixture[str]) -> None:
    header = ["participant", *(f"condition {number}" for number in range(9))]
    print_table("Table 4", [header, ["P01", *"123456789"], ["mean", *"123456789"]])
    lines = capsys.readouterr().out.splitlines()
    assert any(all(name in line for name in header) for line in lines)


def test_a_closed_output_gets_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    for stream in ("stdout", "stderr"):
        monkeypatch.setattr(sys, stream, None)
    print_table("Table 4", [["participant"], ["P01"], ["mean"]])
    with progress("participants", 1) as step:
        step()


def test_a_warning_is_one_line_without_its_source(capsys: pytest.CaptureFixture[str]) -> None:
    with warnings_in_lines():
        warnings.simplefilter("always")
        warnings.warn("odd\x1b[2J", stacklevel=1)
    assert capsys.readouterr().err == "touchbeam: warning: odd\\x1b[2J\n"


def test_a_warning_of_numpy_says_which_results_it_concerns(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with np.errstate(over="warn", invalid="ignore"), warnings_in_lines():
        warnings.simplefilter("always")
        mean_interval(np.array([1e308, 1e308, 0.0]))
    (said, *_) = capsys.readouterr().err.splitlines()
    assert said.startswith("touchbeam: warning: overflow encountered in ")
    assert "in analysis.statistics.intervals, line" in said
    assert "may be wrong or missing: 95% intervals of effect sizes" in said
