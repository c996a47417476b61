"""The operator of a session: at a terminal, at the end of a pipe, or absent."""

import io
import sys

import pytest

from runner.launch.participants import keys_and_display, operator_at_terminal
from runner.people.operator_console import PlainDisplay


@pytest.mark.parametrize("closed", ["stdin", "stdout"])
def test_a_closed_stream_is_not_a_terminal(closed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, closed, None)
    with keys_and_display(lambda _: None, (lambda: None, lambda: None)) as (keys, display):
        assert keys(False) == ""
        assert isinstance(display, PlainDisplay)


@pytest.mark.parametrize("at_terminal", [True, False])
def test_typed_input_is_not_piped_even_if_the_output_is(
    at_terminal: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in `touchbeam run … | tee log`."""

    class Typing(io.StringIO):
        def isatty(self) -> bool:
            return at_terminal

    monkeypatch.setattr(sys, "stdin", Typing("\n"))
    with operator_at_terminal(
        lambda _: None, (lambda: None, lambda: None), lambda _: None
    ) as operator:
        assert operator.piped is not at_terminal


def test_orders_in_lines_are_explained_in_the_unit_of_the_plan(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    said: list[str] = []
    with operator_at_terminal(
        said.append, (lambda: None, lambda: None), lambda _: None, unit="pass"
    ):
        assert "  :r  break the running pass off and repeat it" in said
        assert "trial" not in "\n".join(said)
