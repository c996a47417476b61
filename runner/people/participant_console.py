"""A participant at a terminal, who reads texts and types lines; the operator shares it."""

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TextIO

from protocol.errors import BadInput, WorkFailed
from protocol.study.participant_texts import Wording, band_names, filled, label_text, question_text
from protocol.study.study_question import BETWEEN, StudyQuestion
from runner import screens
from runner.people.operator_console import OPERATOR_MARK, ORDERS
from runner.people.terminal import at_terminal, legible, require_foreground

# A source that never ends, such as a device, must not fill the memory.
MOST_LINES = 1000


class ParticipantGone(WorkFailed):
    """The participant's input has ended."""


def require_typist(source: TextIO | None) -> TextIO:
    """Return the standard input `source`; raises `BadInput` if it is closed."""
    if source is None:
        raise BadInput("standard input must be open, got a closed one; use a terminal or a pipe")
    return source


class TypedLines:
    """Lines from a terminal, read by a thread so that the session never blocks on input.

    At most `MOST_LINES` are read ahead. A pipe then waits; at a terminal further lines are
    dropped, so that an operator's order behind them still arrives.
    """

    def __init__(self, source: TextIO | None) -> None:
        source = require_typist(source)
        legible(source)
        self._source = source
        self.at_terminal = at_terminal(source)
        self._lines: queue.Queue[str | None] = queue.Queue(MOST_LINES)
        self._orders: queue.Queue[str] = queue.Queue(MOST_LINES)
        self._ended = False
        # A daemon: a blocking read cannot be interrupted, and the process must be able to exit.
        threading.Thread(target=self._read, name="typed lines", daemon=True).start()

    def take(self) -> str | None:
        """Return the next line, None before it; raises `ParticipantGone` once the input ended."""
        self._require_terminal()
        try:
            line = self._lines.get_nowait() if not self._ended else None
        except queue.Empty:
            return None
        if line is None:
            self._ended = True
            raise ParticipantGone("the input ended before the session was complete")
        return line.rstrip("\r\n")

    def forget(self) -> None:
        """Discard lines typed before they were asked for; keep those from a file or pipe."""
        while self.at_terminal and not (self._ended or self._lines.empty()):
            self._ended = self._lines.get_nowait() is None

    def operator_typed(self, asked: bool) -> str:
        """Return the operator's next line: one with `OPERATOR_MARK`, or any line if `asked`."""
        self._require_terminal()
        if not self._orders.empty():
            return self._orders.get_nowait()
        line = self.take() if asked else None
        return "" if line is None else f"{line}\n"

    def _require_terminal(self) -> None:
        if self.at_terminal:
            require_foreground(self._source)

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):  # a closed terminal ends the input
            for line in self._source:
                # A queue of its own: an emergency stop does not wait behind unread lines.
                if line.startswith(OPERATOR_MARK):
                    self._orders.put(line.rstrip("\r\n") + "\n")
                elif not (self.at_terminal and self._lines.full()):
                    self._lines.put(line)
        self._lines.put(None)


@dataclass
class ConsoleParticipant(screens.Participant):
    """Prints texts, takes typed answers, and asks again after an invalid one."""

    typed: TypedLines
    say: Callable[[str], None]
    wording: Wording
    monotonic_s: Callable[[], float] = time.monotonic
    _screen: screens.Screen | None = field(default=None, init=False)
    _shown_s: float = field(default=0.0, init=False)

    @property
    def _texts(self) -> Mapping[str, str]:
        return self.wording.texts

    def show(self, screen: screens.Screen) -> None:
        self._screen = screen
        # An answer cannot have been meant for a question that was not there yet.
        self.typed.forget()
        for line in "\n".join(self._lines_of(screen)).split("\n"):
            self.say(line)
        # After printing, because people can only read what has been printed.
        self._shown_s = self.monotonic_s()

    def progress(self, number: int, total: int) -> None:
        self.say(filled(self._texts["progress"], number=number, total=total))

    def poll(self) -> screens.Response | None:
        if self._screen is None or isinstance(
            self._screen, screens.Notice | screens.LeadIn | screens.Pacing
        ):
            return None
        after_s = getattr(self._screen, "after_s", 0.0)
        # The line is not taken, so that it counts once the break is over.
        if after_s and self.monotonic_s() < self._shown_s + after_s:
            return None
        line = self.typed.take()
        answer = None if line is None else self._parse(line.strip())
        if answer is None:
            return None
        self._screen = None
        return screens.Response(answer=answer, reaction_time_s=self.monotonic_s() - self._shown_s)

    def _lines_of(self, screen: screens.Screen) -> list[str]:
        match screen:
            case screens.Notice(text=text):
                return [self._texts[text]]
            case screens.Welcome():
                return [self._texts["welcome"], self._texts["ready"]]
            case screens.Instruction(text=text, picture=picture, touch=touch):
                number = touch.interval if touch else 0
                before = [self._texts[f"interval.{number}"]] if number else []
                beside = [] if picture is None else [f"[{picture}]"]
                said = touch.surface.text(text, self._texts) if touch else self._texts[text]
                return [*before, said, *beside, self._texts["ready"]]
            case screens.LeadIn(several=several, seconds=seconds, surface=surface):
                text = surface.text("touch.soon.full" if several else "touch.soon", self._texts)
                return [f"{text} ({seconds:.2g} s)"]
            case screens.Pacing(duration_s=duration_s):
                return [f"{self._texts['touch.now']} ({duration_s:.2g} s)"]
            case screens.Ask(question=question, bands=bands):
                scale = ["   ".join(band_names(bands, self.wording))] if bands else []
                skip = [] if question.required else [f"  {self._texts['button.skip']}"]
                shown = [*self._choices(question), *scale, *skip]
                return [question_text(question, self.wording), *shown]

    def _parse(self, line: str) -> str | None:
        """Return the answer in `line`, None if it is invalid."""
        if not isinstance(self._screen, screens.Ask):
            return "ready"
        question = self._screen.question
        words = line.replace(",", " ").split() if question.kind == "several" else [line]
        values = (self._value(question, word) for word in words)
        answer = BETWEEN.join(values) if question.values else line
        try:
            value = question.answer(answer)
        except ValueError:
            for text in (f"{line!r}: {self._texts['console.again']}", *self._possible(question)):
                self.say(text)
            # An operator who forgot the colon would think that the stop was on its way.
            if (order := line.lower()) in ORDERS:
                self.say(f"(For the operator: an order begins with a colon, such as :{order})")
            return None
        return "" if value is None else answer if question.values else str(value)

    def _possible(self, question: StudyQuestion) -> list[str]:
        """Return the possible answers: the first two of a scale, which show its step, and the last.

        Of a number its limits, of a text its shortest and greatest length.
        """
        match question.form:
            case "scale":
                first = [str(question.place(at)) for at in range(min(question.places, 2))]
                return [f"  {', '.join(first)} … {question.place(question.places)}"]
            case "typed" if question.is_number:
                form = f".{question.decimals}f" if question.decimals else ".15g"
                ends = (question.minimum, question.maximum)
                low, high = ("" if end is None else format(end, form) for end in ends)
                return [f"  {low} … {high} {question.unit or ''}".rstrip()]
            case "typed":
                return [f"  … (1–{question.longest})"]
            case "labels":
                return self._choices(question)

    def _value(self, question: StudyQuestion, word: str) -> str:
        for number, label in enumerate(question.labels, start=1):
            # Unambiguous, because `check` refuses values and texts that are numbers.
            words = {str(number), str(label.value), label_text(label, self.wording).strip()}
            if word.casefold() in {each.casefold() for each in words}:
                return str(label.value)
        return word

    def _choices(self, question: StudyQuestion) -> list[str]:
        names = [label_text(label, self.wording) for label in question.labels]
        if question.values:
            return [f"  {number}  {name}" for number, name in enumerate(names, start=1)]
        if question.unit:
            return [f"  … {question.unit}"]
        places = (label.at for label in question.labels)
        shown = [f"{at:.15g} {name}" for at, name in zip(places, names, strict=True)]
        return ["   ".join(shown)] if shown else []
