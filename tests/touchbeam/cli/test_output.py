"""Progress bars and tables: a progress bar appears only on a real terminal."""

import sys
import warnings

import numpy as np
import pytest

from analysis.statistics.intervals import mean_interval
from touchbeam.cli import output
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


@pytest.mark.parametrize("width", [80, 120])
def test_sentences_get_the_width_that_short_words_leave(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], width: int
) -> None:
    monkeypatch.setattr(output, "at_terminal", lambda _: True)
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.delenv("FORCE_COLOR")
    monkeypatch.setenv("TERM", "xterm")
    sentence = "a-name-of-thirty-letters-at-most: " + 20 * "a sentence of words, "
    header = ["claim", "law-free", "printed", "consistent", "coulomb"]
    rows = [[sentence, "", "holds", "not testable", "partly"], ["short", "fails", "", "", ""]]
    print_table("Claims", [header, *rows, ["2 claims", "1", "1", "1", "1"]], of_sentences=True)
    lines = capsys.readouterr().out.splitlines()
    assert max(len(line) for line in lines) <= width
    first = next(number for number, line in enumerate(lines) if "a-name-of" in line)
    assert "a-name-of-thirty-letters-at-most:" in lines[first]
    assert lines[first].split()[-3:] == ["holds", "not", "partly"]
    assert lines[first + 1].split()[-1] == "testable"
    words = lines[next(n for n, line in enumerate(lines) if "short" in line) - 1]
    assert not words.strip()  # a line between the claims
    widest = max(len(line.split("   ")[0]) for line in lines[first + 2 : -4])
    assert widest > width - 42


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
