"""The operator's console: where the session stands, what the device does, and one-key orders.

On a terminal it redraws itself; elsewhere it prints a line whenever something changes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

from runner.people.operator_keys import HELP, HELP_LINES, HELP_TYPING, OPERATOR_MARK, OperatorKeys
from runner.screens import Note, OperatorView, Order


class Display(Protocol):
    """Where the operator looks."""

    def show(self, view: OperatorView, question: str, typed: str | None) -> None:
        """Show the session, what is asked of the operator, and what was typed so far."""
        ...


@dataclass
class PlainDisplay:
    """Plain lines, for a log or a pipe."""

    say: Callable[[str], None]
    _last: tuple[str, ...] = field(default=("", "", ""), init=False)

    def show(self, view: OperatorView, question: str, typed: str | None) -> None:
        """Print what has changed; what is being typed stands there already."""
        del typed
        where = f"{view.session} {view.state} {view.trial}".rstrip(" -")
        line = f"{where}; {view.progress()}; output {view.output()}"
        now = (line, view.warning and f"warning: {view.warning}", question)
        for text, before in zip(now, self._last, strict=True):
            if text and text != before:
                self.say(text)
        self._last = now


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
        """Draw the panel anew."""
        from rich.panel import Panel

        self._live.update(
            Panel("\n".join(panel_lines(view, question, typed)), title="touchbeam"), refresh=True
        )


def panel_lines(view: OperatorView, question: str, typed: str | None) -> list[str]:
    """Return what stands in the panel, what matters most first: a low terminal cuts the rest."""
    from rich.markup import escape

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
        f"{view.session}  {view.kind}  [bold]{view.state}[/]",
        view.progress(),
        f"trial: {escape(view.trial)}   next: {escape(view.next_trial)}",
        f"last answer: {escape(view.last_answer) or '-'}   watchdog {view.watchdog_s:g} s",
    ]


@dataclass
class OperatorConsole:
    """An operator at a console.

    `typed` returns the characters typed since its last call; it is told whether something was
    asked. `forget` drops what was typed before a question and can be no answer to it. `swap` mounts
    a simulated beam. Where lines come from a file or a program (`piped`), any of them confirms a
    beam. Where nobody is there (`alone`), what is asked is answered with nothing.
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
        """Ask the operator; a session without one goes on at once."""
        self._ask(text, self._keys.expect_answer)

    def _ask(self, text: str, expect: Callable[[], None]) -> None:
        self._listen()  # what was typed before the question is no answer to it
        self.forget()
        self._question = text
        expect()
        if self.alone:
            self._keys.feed("\n")
        self._redraw()

    def unask(self) -> None:
        """Take back what was asked: the session has gone elsewhere, or has ended."""
        self._question = ""
        self._keys.expect_nothing()
        self._redraw()

    def answered(self) -> str | None:
        """Return the answer once Enter was pressed."""
        self._listen()
        answer = self._keys.answer()
        if answer is not None:
            self._question = ""
            self._redraw()
        return answer

    def mount(self, beam: str) -> None:
        """Ask for a beam; the output is off."""
        self.swap(beam)
        text = f"The output is off. Mount the beam '{beam}', then press Enter."
        self._ask(text, lambda: self._keys.expect_confirmation(any_line=self.piped))

    def order(self) -> Order | Note | None:
        """Return the next order."""
        self._listen()
        return self._keys.order()

    def see(self, view: OperatorView) -> None:
        """Show `view`."""
        self._view = view
        self._redraw()

    def called(self) -> None:
        """Show that the participant calls, until there is something else to warn of."""
        self.tell("the participant calls you (Escape)")

    def tell(self, text: str) -> None:
        """Show `text` until there is something else to warn of."""
        if self._view is not None:
            self._view = replace(self._view, warning=text)
            self._redraw()

    def _listen(self) -> None:
        characters = self.typed(bool(self._question))
        if characters.startswith(OPERATOR_MARK) and characters.endswith("\n"):
            if not self._keys.feed_order(characters.removeprefix(OPERATOR_MARK)):
                self.tell(f"{characters.strip()!r} is no order; {HELP_LINES}")
        elif characters:
            self._keys.feed(characters)
            self._redraw()

    def _redraw(self) -> None:
        if self._view is not None:
            self.display.show(self._view, self._question, self._keys.line)
