"""What the operator's keys mean: one key each, and lines for answers and notes. Does no I/O."""

from collections import deque

from runner.screens import Note, Order

KEYS: dict[str, Order] = {
    "p": "pause",
    "s": "stop",
    "r": "repeat",
    "e": "emergency stop",
    " ": "emergency stop",
}
HELP = "p pause/go on   r repeat trial   n note   s stop   space or Ctrl-E EMERGENCY STOP"
HELP_TYPING = "Enter when it is typed   Ctrl-C stop   Ctrl-E EMERGENCY STOP"
HELP_LINES = ":p pause or go on, :r repeat the trial, :n note, :s stop, :e EMERGENCY STOP"
_WORDS = {"pause": "p", "stop": "s", "repeat": "r", "note": "n"}

OPERATOR_MARK = ":"
"""A line typed at the participant's terminal that begins with it is the operator's."""

_ENTER = "\r\n"
_BACKSPACE = "\x7f\b"
_ESCAPE = "\x1b"
_CTRL_E = "\x05"


def _key_of(line: str) -> str | None:
    """The key that a whole line means; in doubt, an emergency stop is one."""
    word = line.strip().lower()
    if _CTRL_E in line or word.startswith("e") or (line.strip(_ENTER) and not word):
        return _CTRL_E
    key = _WORDS.get(word, word)
    return key if key in KEYS or key == "n" else None


class OperatorKeys:
    """Characters in, orders and answers out.

    A line is collected while an answer is expected or after `n`; otherwise each key is an order,
    and Enter confirms where that is expected. An emergency stop is always one key away: Ctrl-E, or
    a space where nothing has been typed yet.
    """

    def __init__(self) -> None:
        self._orders: deque[Order | Note] = deque()
        self._answers: deque[str] = deque()
        self._line = ""
        self._noting = False
        self._asked = False
        self._confirming = self._any_line = False

    @property
    def line(self) -> str | None:
        """What has been typed of a line so far, None while keys are orders."""
        return self._line if self._noting or self._asked else None

    def expect_answer(self) -> None:
        """Take the next line as an answer."""
        self._asked = True
        self._answers.clear()

    def expect_confirmation(self, *, any_line: bool = False) -> None:
        """Take Enter as an answer, or any line that is no order; other keys stay what they are."""
        self._confirming, self._any_line = True, any_line
        self._answers.clear()

    def expect_nothing(self) -> None:
        """Forget what was asked, and what was typed of an answer."""
        if not self._noting:
            self._line = ""
        self._asked = self._confirming = False
        self._answers.clear()

    def feed(self, characters: str) -> None:
        """Take what was typed."""
        if self._confirming and not self._noting:
            characters = self._confirm(characters)
        for character in characters:
            # No line begins with a space: there it is the emergency stop that it is elsewhere.
            if character == _CTRL_E or (character == " " and self.line == ""):
                self._orders.append("emergency stop")
            elif self.line is not None:
                self._collect(character)
            elif character == "n":
                self._noting = True
            elif character in KEYS:
                self._orders.append(KEYS[character])

    def _confirm(self, characters: str) -> str:
        """Look for the confirmation in what was typed; return the keys that are orders.

        A whole line is looked at as a line: one that is an order is that order and confirms
        nothing, and but for `any_line` only an empty one confirms.
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
        """Take a typed line that is an order, whatever was asked: `e`, or `n` and a note.

        The line is over when it comes: what stands in it is told apart without a second key, and
        only an empty line with a space in it means what the space alone means. Returns whether it
        is an order.
        """
        order = line.strip()
        if order[:1] in {"n", "N"}:
            self._note(order[4:] if order[:4].lower() == "note" else order[1:])
        elif (key := _key_of(line)) is not None:
            self._orders.append("emergency stop" if key == _CTRL_E else KEYS[key])
        else:
            return False
        return True

    def order(self) -> Order | Note | None:
        """Return the oldest order that was not returned yet; an emergency stop comes first."""
        if "emergency stop" in self._orders:
            self._orders.clear()
            return "emergency stop"
        return self._orders.popleft() if self._orders else None

    def answer(self) -> str | None:
        """Return the answer, None while there is none."""
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
            self._note(self._finished())
        else:
            self._answers.append(self._finished())
            self._asked = False

    def _note(self, text: str) -> None:
        if text := text.strip():
            self._orders.append(Note(text=text))

    def _finished(self) -> str:
        text, self._line = self._line.strip(), ""
        return text
