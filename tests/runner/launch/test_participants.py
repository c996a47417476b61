"""Who operates a session: at a terminal, by a pipe, or nobody."""

import io
import sys

import pytest

from runner.launch.participants import keys_and_display, operator_at_terminal
from runner.people.operator_console import PlainDisplay


@pytest.mark.parametrize("closed", ["stdin", "stdout"])
def test_nobody_is_at_a_terminal_that_is_closed(
    closed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, closed, None)
    with keys_and_display(lambda _: None) as (keys, display):
        assert keys(False) == ""
        assert isinstance(display, PlainDisplay)


@pytest.mark.parametrize("somebody_types", [True, False])
def test_who_types_is_no_pipe_though_the_output_is_one(
    somebody_types: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in `touchbeam run … | tee log`."""

    class Typing(io.StringIO):
        def isatty(self) -> bool:
            return somebody_types

    monkeypatch.setattr(sys, "stdin", Typing("\n"))
    with operator_at_terminal(lambda _: None, lambda _: None) as operator:
        assert operator.piped is not somebody_types
