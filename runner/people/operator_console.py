"""The operator's console: session progress, device output and one-key orders.

On a terminal it redraws a panel; elsewhere it prints a line whenever something changes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

from runner.people.operator_keys import HELP, HELP_LINES, HELP_TYPING, OPERATOR_MARK, OperatorKeys
from runner.people.terminal import visible
from runner.screens import Note, OperatorView, Order


class Display(Protocol):
    """The operator's display."""

    def show(self, view: OperatorView, question: str, typed: str | None) -> None:
        """Show the session, the question to the operator, and the line typed so far."""
        ...


@dataclass
class PlainDisplay:
    """Plain lines, for a log or a pipe."""

    say: Callable[[str], None]
    _last: tuple[str, ...] = field(default=("", "", ""), init=False)

    def show(self, view: OperatorView, question: str, typed: str | None) -> None:
        """Print what has changed."""
        del typed  # the terminal has echoed it
        place = f"{view.session} {view.state} {view.trial}".rstrip(" -")
        line = f"{place}; {view.progress()}; output {view.output()}"
        current = (line, view.warning and f"warning: {view.warning}", question)
        for text, before in zip(current, self._last, strict=True):
            if text and text != before:
                self.say(text)
        self._last = current


class LiveDisplay:
    """A panel that stays in place."""

    def __init__(self) -> None:
        from rich.live import Live

        self._live = Live(auto_refresh=False, transient=False)

    def __enter__(self) -> "LiveDisplay":
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, view: OperatorView, question: str, typed: str | None) -> None:
        """Redraw the panel."""
        from rich.panel import Panel

        text = "\n".join(panel_lines(view, question, typed))
        self._live.update(Panel(text, title="touchbeam"), refresh=True)


def panel_lines(view: OperatorView, question: str, typed: str | None) -> list[str]:
    """Return the lines of the panel, most important first: a low terminal cuts off the last."""
    from rich import markup

    def escape(text: str) -> str:
        return markup.escape(visible(text))

    colour = "green" if view.output() == "off" else "red"
    lines = [f"output: [bold {colour}]{view.output()}[/]"]
    if question:
        lines.append(f"[bold]{escape(question)}[/] {escape(typed or '')}")
    elif typed is not None:
        lines.append(f"note: {escape(typed)}")
    if view.warning:
        lines.append(f"[yellow]warning: {escape(view.warning)}[/]")
    return [
        *lines,
        f"[dim]{HELP if typed is None else HELP_TYPING}[/]",
        f"{escape(view.session)}  {view.kind}  [bold]{view.state}[/]",
        view.progress(),
        f"trial: {escape(view.trial)}   next: {escape(view.next_trial)}",
        f"last answer: {escape(view.last_answer) or '-'}   watchdog {view.watchdog_s:g} s",
    ]


@dataclass
class OperatorConsole:
    """An operator at a console.

    Args:
        typed: returns the characters typed since its last call; its argument is True while a
            question is open.
        display: shows the session and the open question.
        swap: mounts a simulated beam.
        forget: discards input typed before a question, which cannot answer it.
        piped: input comes from a file or a program; any line confirms a beam.
        alone: there is no operator; every question gets an empty answer at once.
    """

    typed: Callable[[bool], str]
    display: Display
    swap: Callable[[str], None] = lambda _: None
    forget: Callable[[], None] = lambda: None
    piped: bool = False
    alone: bool = False
    _keys: OperatorKeys = field(default_factory=OperatorKeys, init=False)
    _view: OperatorView | None = field(default=None, init=False)
    _question: str = field(default="", init=False)

    def ask(self, text: str) -> None:
        """Ask the operator; without an operator the answer is empty and immediate."""
        self._ask(text, self._keys.expect_answer)

    def _ask(self, text: str, expect: Callable[[], None]) -> None:
        self._listen()  # take in earlier input now, so that it cannot answer the question
        self.forget()
        self._question = text
        expect()
        if self.alone:
            self._keys.feed("\n")
        self._redraw()

    def withdraw_question(self) -> None:
        """Withdraw the open question: the session has moved on or has ended."""
        self._question = ""
        self._keys.expect_nothing()
        self._redraw()

    def answered(self) -> str | None:
        """Return the answer once Enter has been pressed, None before."""
        self._listen()
        answer = self._keys.answer()
        if answer is not None:
            self._question = ""
            self._redraw()
        return answer

    def mount(self, beam: str) -> None:
        """Ask the operator to mount `beam`; the output must be off."""
        self.swap(beam)
        self.confirm(f"The output is off. Mount the beam '{beam}', then press Enter.")

    def confirm(self, text: str) -> None:
        """Ask the operator to do what `text` says and to press Enter."""
        self._ask(text, lambda: self._keys.expect_confirmation(any_line=self.piped))

    def order(self) -> Order | Note | None:
        """Return the next order, or None."""
        self._listen()
        return self._keys.order()

    def show(self, view: OperatorView) -> None:
        """Show `view`."""
        self._view = view
        self._redraw()

    def participant_called(self) -> None:
        """Show until the next view that the participant calls the operator."""
        self.notify("the participant is calling you (Escape)")

    def notify(self, text: str) -> None:
        """Show `text` as a warning until the next view."""
        if self._view is not None:
            self._view = replace(self._view, warning=text)
            self._redraw()

    def _listen(self) -> None:
        characters = self.typed(bool(self._question))
        if characters.startswith(OPERATOR_MARK) and characters.endswith("\n"):
            if not self._keys.feed_order(characters.removeprefix(OPERATOR_MARK)):
                self.notify(f"{characters.strip()!r} is not an order; use {HELP_LINES}")
        elif characters:
            self._keys.feed(characters)
            self._redraw()

    def _redraw(self) -> None:
        if self._view is not None:
            self.display.show(self._view, self._question, self._keys.line)
