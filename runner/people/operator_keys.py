"""The operator's keys: one per order, and lines for answers and notes. Does no I/O."""

import re
from collections import deque
from typing import Literal

from runner.screens import Note, Order

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
    ("s", "stop", "stop the session; the same command resumes it later"),
    ("a", "answer call", "confirm that you have noticed the participant's call"),
    ("?", "help", "show or hide this help (also h)"),
)
"""Each key with its short and its long explanation."""
ORDERS = {"e", "help", *(key for key, _, _ in EXPLAINED)}
"""What an operator may type in lines."""
EMERGENCY = "EMERGENCY STOP: output off at once"
TYPING = ("Enter finish", "Ctrl-C stop", "Ctrl-E EMERGENCY STOP")
_WORDS = {"pause": "p", "stop": "s", "repeat": "r", "note": "n", "help": "?", "h": "?"}

OPERATOR_MARK = ":"
"""First character of an operator's line at a terminal shared with the participant."""

_ENTER = "\r\n"
_BACKSPACE = "\x7f\b"
_ESCAPE = "\x1b"
_FUNCTION_KEY = re.compile(r"\x1b(?:\[[0-?]*[ -/]*[@-~]|O.)")
"""What an arrow or a function key sends: several characters, none of which was typed."""
Wish = Literal["help", "answer call", "unknown key"]
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
    return key if key in KEYS or key in _WISHES or key == "n" else None


class OperatorKeys:
    """Turns typed characters into orders and answers.

    While an answer is expected, or after `n`, characters form a line; otherwise each key is an
    order, and Enter confirms if a confirmation is expected. An emergency stop is always one key
    away: Ctrl-E, or a space at the beginning of a line.
    """

    def __init__(self) -> None:
        self._orders: deque[Order | Note] = deque()
        self._wishes: deque[Wish] = deque()
        self._answers: deque[str] = deque()
        self._line = ""
        self._noting = False
        self._asked = False
        self._confirming = self._any_line = False

    @property
    def line(self) -> str | None:
        """The line typed so far, None while keys are orders."""
        return self._line if self._noting or self._asked else None

    def expect_answer(self) -> None:
        """Treat the next line as an answer."""
        self._asked = True
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
        """Process typed characters."""
        if self._confirming and not self._noting:
            characters = self._confirm(characters)
        characters, function_keys = _FUNCTION_KEY.subn("", characters)
        self._wishes.extend(["unknown key"] * function_keys)
        for character in characters:
            # A space at the beginning of a line is an emergency stop, as it is outside of lines.
            if character == _CTRL_E or (character == " " and self.line == ""):
                self._orders.append("emergency stop")
            elif self.line is not None:
                self._collect(character)
            else:
                self._press(character.lower())

    def _press(self, key: str) -> None:
        if key == "n":
            self._noting = True
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
        if order[:1] in {"n", "N"}:
            self._note(order[4:] if order[:4].lower() == "note" else order[1:])
        elif (key := _key_of(line)) is not None:
            self._press(key)
        else:
            return False
        return True

    def order(self) -> Order | Note | None:
        """Return the next order; an emergency stop comes first and cancels all others."""
        if "emergency stop" in self._orders:
            self._orders.clear()
            return "emergency stop"
        return self._orders.popleft() if self._orders else None

    def wish(self) -> Wish | None:
        """Return the next key that concerns the console alone, None if there is none."""
        return self._wishes.popleft() if self._wishes else None

    def answer(self) -> str | None:
        """Return the answer, or None before it has been given."""
        return self._answers.popleft() if self._answers else None

    def _collect(self, character: str) -> None:
        if character in _BACKSPACE:
            self._line = self._line[:-1]
        elif character == _ESCAPE and self._noting:
            self._noting, self._line = False, ""
        elif character not in _ENTER:
            self._line += character
        elif self._noting:
            self._noting = False
            self._note(self._take_line())
        else:
            self._answers.append(self._take_line())
            self._asked = False

    def _note(self, text: str) -> None:
        if text := text.strip():
            self._orders.append(Note(text=text))

    def _take_line(self) -> str:
        text, self._line = self._line.strip(), ""
        return text
