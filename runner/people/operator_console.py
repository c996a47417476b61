"""The operator's console: session progress, messages and one-key orders.

At a terminal a display draws it anew several times a second; elsewhere it is lines of text.
"""

import re
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

from protocol.journal import events
from protocol.journal.events import StoredEvent
from protocol.study.study_question import answer_text
from runner.screens import (
    Correction,
    Note,
    OperatorView,
    Order,
    PlanUnit,
    Wanted,
    WindowState,
    said_of,
)

_CTRL_E = "\x05"
KEYS: dict[str, Order] = {
    "p": "pause",
    "s": "stop",
    "r": "repeat",
    "e": "emergency stop",
    " ": "emergency stop",
    _CTRL_E: "emergency stop",
}
EXPLAINED = (
    ("p", "pause", "pause before the next trial, or continue after a pause"),
    ("r", "repeat trial", "break the running trial off and repeat it"),
    ("n", "note", "note for the journal, to be finished with Enter"),
    ("c", "correct", "correct an answer of the desk: `NAME ANSWER`, later `... because REASON`"),
    ("s", "stop", "stop the session; the same command resumes it later"),
    ("a", "answer call", "confirm that you have noticed the participant's call"),
    ("?", "help", "show or hide this help (also h)"),
)
"""Each key with its short and its long explanation."""
ORDERS = {"e", "help", *(key for key, _, _ in EXPLAINED)}
"""What an operator may type in lines."""
EMERGENCY = "EMERGENCY STOP: output off at once"
STOP_KEYS = "EMERGENCY STOP: e, space, Ctrl-E"
IN_WINDOW = "EMERGENCY STOP: Ctrl-E alone; KEYS GO TO THE PARTICIPANT'S WINDOW"
TYPES = "EMERGENCY STOP: Ctrl-E alone while the participant types an answer"
"""Instead of all stop keys, where a letter is none."""
NO_ORDER = "no order: the participant types an answer; Ctrl-E is the emergency stop, Ctrl-C stops"
TYPING = ("Enter finish", "Ctrl-C stop", "Ctrl-E EMERGENCY STOP")
_WORDS = {"pause": "p", "stop": "s", "repeat": "r", "note": "n", "help": "?", "h": "?"}

OPERATOR_MARK = ":"
"""First character of an operator's line at a terminal shared with the participant."""

_ENTER, _BACKSPACE, _ESCAPE = "\r\n", "\x7f\b", "\x1b"
_FUNCTION_KEY = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|O.)")
"""What an arrow or a function key sends: several characters, none of which was typed."""
Wish = Literal["help", "answer call", "unknown key", "letter of an answer"]
_TYPED = {"n": "Note", "c": "Name, answer [because reason]"}
"""Keys that begin a line, and what is then typed."""
_WISHES: dict[str, Wish] = {"?": "help", "h": "help", "a": "answer call"}


def _key_of(line: str) -> str | None:
    """Return the key that a whole line stands for, None if it is not an order.

    Any word that begins with `e`, and a line of spaces, is an emergency stop: stopping by mistake
    is safe, missing a stop is not.
    """
    word = line.strip().lower()
    if _CTRL_E in line or word.startswith("e") or (line.strip(_ENTER) and not word):
        return _CTRL_E
    key = _WORDS.get(word, word)
    return key if key in KEYS or key in _WISHES or key in _TYPED else None


class OperatorKeys:
    """Turns typed characters into orders and answers.

    While an answer is expected, or after `n`, characters form a line; otherwise each key is an
    order, and Enter confirms if a confirmation is expected. An emergency stop is always one key
    away: Ctrl-E, or a space at the beginning of a line. While the `participant_types`, it is
    Ctrl-E alone, and no other key is an order: the answer may be typed here by mistake.
    """

    participant_types = False

    def __init__(self) -> None:
        self._orders: deque[Wanted] = deque()
        self._wishes: deque[Wish] = deque()
        self._answers: deque[str] = deque()
        self._line = ""
        self._noting = ""
        self._asked = False
        self._confirming = self._any_line = False

    @property
    def line(self) -> str | None:
        """The line typed so far, None while keys are orders."""
        return self._line if self._noting or self._asked else None

    @property
    def typing(self) -> str:
        """What the line is, if it answers no question."""
        return _TYPED.get(self._noting, "Note")

    def expect_answer(self) -> None:
        self._asked = True
        # What was typed before the question cannot answer it.
        self._answers.clear()

    def expect_confirmation(self, *, any_line: bool = False) -> None:
        """Treat Enter as an answer, or with `any_line` any line that is not an order."""
        self._confirming, self._any_line = True, any_line
        self._answers.clear()

    def expect_nothing(self) -> None:
        """Drop the expected answer and what has been typed of it; a note in progress stays."""
        if not self._noting:
            self._line = ""
        self._asked = self._confirming = False
        self._answers.clear()

    def feed(self, characters: str) -> None:
        if self._confirming and not self._noting:
            characters = self._confirm(characters)
        # The letters in such a sequence would be taken for orders.
        characters, function_keys = _FUNCTION_KEY.subn("", characters)
        self._wishes.extend(["unknown key"] * function_keys)
        for character in characters:
            # A space at the beginning of a line is an emergency stop, as it is outside of lines.
            stops = character == " " and self.line == "" and not self.participant_types
            if character == _CTRL_E or stops:
                self._orders.append("emergency stop")
            elif self.participant_types and self.line is None:
                self._wishes.append("letter of an answer")
            elif self.line is not None:
                self._collect(character)
            else:
                # Caps Lock must not disable a stop.
                self._press(character.lower())

    def _press(self, key: str) -> None:
        if key in _TYPED:
            self._noting = key
        elif key in KEYS:
            self._orders.append(KEYS[key])
        elif key not in _ENTER:
            self._wishes.append(_WISHES.get(key, "unknown key"))

    def _confirm(self, characters: str) -> str:
        """Find the confirmation in `characters`; return the keys that are orders.

        A whole line counts as one: if it is an order it confirms nothing; otherwise an empty line
        confirms, or with `any_line` every line.
        """
        line = characters.strip(_ENTER)
        # No Enter ends them, so that these are keys.
        if line == characters:
            return characters
        if (key := _key_of(line)) is not None:
            return key
        if not line or self._any_line:
            self._answers.append("")
            self._confirming = False
        return ""

    def feed_order(self, line: str) -> bool:
        """Carry out a line as an order, such as `e`, or `n` and a note; return whether it is one.

        It never answers a question. The line is complete, so that its first words decide what it
        means: a space is an emergency stop only in a line of nothing but spaces.
        """
        order = line.strip()
        # Before `_key_of`: the key `n` would wait for a text that this complete line already has.
        if order[:1] in {"n", "N"}:
            self._note(order[4:] if order[:4].lower() == "note" else order[1:])
        elif (key := _key_of(line)) not in {None, "c"}:
            self._press(key)
        elif (correction := re.fullmatch(r"(?:c|answer)\b(.*)", order, re.IGNORECASE)) is not None:
            self._correct(correction[1])
        else:
            return False
        return True

    def order(self) -> Wanted | None:
        """Return the next order; an emergency stop comes first and cancels all others."""
        # What was typed before or after it does not matter any more, and must not start anything.
        if "emergency stop" in self._orders:
            self._orders.clear()
            return "emergency stop"
        return self._orders.popleft() if self._orders else None

    def wish(self) -> Wish | None:
        """Return the next key that concerns the console alone, None if there is none."""
        return self._wishes.popleft() if self._wishes else None

    def answer(self) -> str | None:
        return self._answers.popleft() if self._answers else None

    def _collect(self, character: str) -> None:
        if character in _BACKSPACE:
            self._line = self._line[:-1]
        elif character == _ESCAPE:
            self._noting, self._line = "", ""
        elif character not in _ENTER:
            # A control character would go into the journal unseen.
            self._line += character if character.isprintable() else ""
        elif self._noting:
            finish = self._note if self._noting == "n" else self._correct
            self._noting = ""
            finish(self._take_line())
        else:
            self._answers.append(self._take_line())
            self._asked = False

    def _note(self, text: str) -> None:
        if text := text.strip():
            self._orders.append(Note(text=text))

    def _correct(self, line: str) -> None:
        told, _, note = line.partition(" because ")
        name, _, answer = told.strip().partition(" ")
        if name:
            self._orders.append(Correction(name=name, answer=answer.strip(), note=note.strip()))

    def _take_line(self) -> str:
        text, self._line = self._line.strip(), ""
        return text


def recalled(chain: Iterable[StoredEvent]) -> list[tuple[str, str]]:
    """Return what the log said of the events of a session, with the times of day."""
    told = ((event, _said_of(event.record)) for event in chain if not event.erased)
    return [(f"{event.utc.astimezone():%H:%M:%S}", text) for event, text in told if text]


def _said_of(event: events.Event) -> str:
    match event:
        case events.NoteTaken(text=text):
            said = f"noted: {text}"
        case events.RigDescribed(answers=answers):
            said = f"noted: {', '.join(f'{name} {it}' for name, it in answers.items() if it)}"
        case events.QuestionAnswered(when="desk", name=name, answer=answer, note=note):
            said = f"noted: {name} {answer_text(answer)}" + (f" ({note})" if note else "")
        case events.TouchEnded(judged=judged) if judged.missed:
            missed = " and ".join(judged.missed)
            said = f"warning: the touch did not follow the instruction: {missed}"
        case events.TrialAborted(why=why) | events.DeviceOff(why=why):
            said = f"{event.TAG.replace('-', ' ')}: {why}"
        case events.Paused() | events.SessionResumed():
            said = event.TAG.replace("-", " ")
        case _:
            said = ""
    return said


Picture = Callable[[int, int], list[str]]
"""Draws what stands on the screen instead of bars, plan and log.

Returns as many lines as its second argument says, none wider than the first.
"""
DRY_RUN = "DRY RUN: a rehearsal, no participant's data"


@dataclass(kw_only=True)
class Told:
    """What the operator has been told and has not answered.

    `messages` are all so far, each with the time of day, the first `recalled` of them from before
    an interruption. `calls` counts the participant's calls since the last answer to one. `page` is
    what the participant sees since `page_s` on the display's clock; `types` says that an answer to
    it is typed. `window` is the state of the participant's window, None without one.
    """

    question: str = ""
    messages: tuple[tuple[str, str], ...] = ()
    calls: int = 0
    pausing: bool = False
    help: bool = False
    recalled: int = 0
    page: str = ""
    page_s: float = 0.0
    types: bool = False
    window: WindowState | None = None


@dataclass(kw_only=True)
class Frame(Told):
    """What the operator is shown, apart from what the device says at the moment.

    `typed` is the line typed so far, None while keys are orders.
    """

    view: OperatorView
    typed: str | None = None
    typing: str = "Note"


class Display(Protocol):
    """The operator's display. No method blocks."""

    def show(self, frame: Frame) -> None:
        """Show `frame` until the next one."""


@dataclass
class PlainDisplay:
    """Plain lines, for a log or a pipe.

    If it is `shared` with the participant, they do not tell what the device does in a trial.
    """

    say: Callable[[str], None]
    shared: bool = False
    _last: tuple[str, str] = field(default=("", ""), init=False)
    _said: int = field(default=0, init=False)
    _helped: bool = field(default=False, init=False)

    def show(self, frame: Frame) -> None:
        view = frame.view
        if self.shared:  # no label or figure of the drive may stand before the participant's eyes
            numbered = enumerate(view.plan, start=1)
            plan = tuple(replace(line, label=f"trial {number}") for number, line in numbered)
            view = replace(view, plan=plan, blind=True, track=None)
        if view.kind == "rehearsal" and not any(self._last):
            self.say(DRY_RUN)
        line = f"{view.place}; {view.progress()}; output {view.output()}"
        line += f"; {view.track}" * bool(view.track)
        # Frames come often, and a log needs only what has changed.
        for text, before in zip((line, frame.question), self._last, strict=True):
            if text and text != before:
                self.say(text)
        self._last = (line, frame.question)
        for _, message in frame.messages[max(self._said, frame.recalled) :]:
            self.say(message)
        self._said = len(frame.messages)
        if frame.help != self._helped:
            self._helped = frame.help
            for text in line_help(view.unit):
                self.say(text)


def line_help(unit: PlanUnit = "trial") -> list[str]:
    keys = [(key, said_of(unit, long)) for key, _, long in EXPLAINED if key != "?"]
    return [
        "For the operator: a line that begins with a colon is an order.",
        *(f"  :{key}  {long}" for key, long in keys),
        "  :help  these lines",
        f"  :e  {EMERGENCY} (also Ctrl-C)",
    ]


@dataclass
class OperatorConsole:
    """An operator at a console.

    `typed` returns the characters typed since its last call; its argument is True while a question
    is open. `forget` discards what was typed before a question, which cannot answer it. If input is
    `piped` from a file or a program, any line confirms a beam. If `alone`, there is no operator,
    and every question gets an empty answer at once. `swap` mounts a simulated beam.
    """

    typed: Callable[[bool], str]
    display: Display
    swap: Callable[[str], None] = lambda _: None
    forget: Callable[[], None] = lambda: None
    piped: bool = False
    alone: bool = False
    time_of_day: Callable[[], str] = lambda: time.strftime("%H:%M:%S")
    _keys: OperatorKeys = field(default_factory=OperatorKeys, init=False)
    _view: OperatorView | None = field(default=None, init=False)
    _told: Told = field(default_factory=Told, init=False)

    def ask(self, text: str) -> None:
        self._ask(text, self._keys.expect_answer)

    def _ask(self, text: str, expect: Callable[[], None]) -> None:
        self._listen()  # take in earlier input now, so that it cannot answer the question
        self.forget()
        self._told.question = text
        expect()
        if self.alone:
            self._keys.feed("\n")
        self._redraw()

    def withdraw_question(self) -> None:
        self._told.question = ""
        self._keys.expect_nothing()
        self._redraw()

    def answered(self) -> str | None:
        self._listen()
        answer = self._keys.answer()
        if answer is not None:
            self._told.question = ""
            self._redraw()
        return answer

    def mount(self, beam: str) -> None:
        # A simulated beam is changed before anybody is asked, because nobody's hands do it.
        self.swap(beam)
        self.confirm(f"The output is off. Mount the beam '{beam}', then press Enter.")

    def confirm(self, text: str) -> None:
        self._ask(text, lambda: self._keys.expect_confirmation(any_line=self.piped))

    def page(self, name: str, *, typed: bool = False) -> None:
        self._told.page, self._told.page_s = name, time.monotonic()
        self._told.types = self._keys.participant_types = typed
        self._redraw()

    def window(self, state: WindowState) -> None:
        self._told.window = state
        self.notify(str(state))

    def recall(self, messages: Sequence[tuple[str, str]]) -> None:
        self._told.messages = (*messages, *self._told.messages)
        self._told.recalled += len(messages)

    def order(self) -> Wanted | None:
        self._listen()
        return self._keys.order()

    def show(self, view: OperatorView) -> None:
        self._view = view
        # Kept in the log, because the next view comes soon and has no warning.
        if view.warning:
            self.notify(f"warning: {view.warning}")
        else:
            self._redraw()

    def pausing(self, wanted: bool) -> None:
        self._told.pausing = wanted
        unit = self._view.unit if self._view else "trial"
        coming = f"pausing before the next {unit}"
        self.notify(coming if wanted else "no pause: the session goes on")

    def participant_called(self) -> None:
        """Show that the participant calls, until the operator answers the call."""
        self._told.calls += 1
        self.notify("the participant is calling you (Escape)")

    def notify(self, text: str) -> None:
        self._told.messages += ((self.time_of_day(), text),)
        self._redraw()

    def _listen(self) -> None:
        characters = self.typed(bool(self._told.question))
        # Whole lines come from a shared terminal or a pipe, single keys from one of its own.
        if characters.startswith(OPERATOR_MARK) and characters.endswith("\n"):
            if not self._keys.feed_order(characters.removeprefix(OPERATOR_MARK)):
                self.notify(f"{characters.strip()!r} is not an order; :help lists the orders")
        elif characters:
            self._keys.feed(characters)
            self._redraw()
        while (wish := self._keys.wish()) is not None:
            self._grant(wish)

    def _grant(self, wish: Wish) -> None:
        match wish:
            case "help":
                self._told.help = not self._told.help
                self._redraw()
            case "answer call":
                calls, self._told.calls = self._told.calls, 0
                self.notify("you answered the participant's call" if calls else "nobody is calling")
            case "unknown key":
                self.notify("that key does nothing here; ? shows the keys")
            case "letter of an answer":
                # Once, because an answer has many letters.
                if not self._told.messages or self._told.messages[-1][1] != NO_ORDER:
                    self.notify(NO_ORDER)

    def _redraw(self) -> None:
        # Before the first view there is nothing to show.
        if self._view is not None:
            line, typing = self._keys.line, self._keys.typing
            # A copy: the display's thread draws it while more is told.
            frame = Frame(view=self._view, typed=line, typing=typing, **vars(self._told))
            self.display.show(frame)
