"""Responses from presses and keys: a choice, which may change, then a confirmation.

At first nothing is chosen. A choice becomes an answer only when it is confirmed, which is possible
only once the page has been readable for long enough.
"""

from dataclasses import dataclass, field
from typing import Any

from protocol.study.questions import ANSWERS
from protocol.study.rating import Rating
from runner.screens import AskChange, AskScore, Screen
from runner.window.elements import Dragged, Input, Key, Pressed, Released
from runner.window.pages import target_at, targets
from runner.window.rating_scale import score_at

EARLY_S = 0.15
"""Shorter than any reaction time: an earlier press was meant for the previous screen."""

_STEPS = {"left": -1, "right": 1, "down": -1, "up": 1}


@dataclass
class PendingResponse:
    """The response to one screen; times are seconds since the screen was first shown."""

    screen: Screen
    readable_s: float = 0.0
    chosen: str | None = field(default=None, init=False)
    answer: str | None = field(default=None, init=False)
    confirmed_s: float = field(default=0.0, init=False)
    changes: list[dict[str, Any]] = field(default_factory=list, init=False)
    path: list[dict[str, Any]] = field(default_factory=list, init=False)
    early: int = field(default=0, init=False)
    _held: bool = field(default=False, init=False)
    _typed: str = field(default="", init=False)

    def take(self, given: Input, t_s: float) -> None:
        """Apply `given`: change the choice or confirm it."""
        if self.answer is not None:
            return
        if t_s < EARLY_S:
            self.early += isinstance(given, Pressed | Key)
            return
        match given:
            case Key(name="enter"):
                self._confirm(t_s)
            case Key(name=name):
                self._typed_key(name, t_s)
            case Pressed(x=x, y=y):
                self._pressed(x, y, t_s)
            case Dragged(x=x) if self._held:
                self._mark(x, t_s)
            case Released():
                self._held = False

    @property
    def earliest_s(self) -> float:
        """When the page has been readable for long enough and a break, if it is one, is over."""
        return max(self.readable_s, getattr(self.screen, "after_s", 0.0))

    @property
    def reaction_time_s(self) -> float:
        """The time of the mark that was confirmed; of the confirmation where there is no mark."""
        return float(self.changes[-1]["t_s"]) if self.changes else round(self.confirmed_s, 4)

    def trace(self) -> dict[str, Any]:
        """Return the history of the choice: its start, every change, and the marker's path."""
        return {
            "start": self.changes[0] if self.changes else None,
            "changes": self.changes,
            "path": self.path,
            "confirmed_s": round(self.confirmed_s, 4),
            "early_presses": self.early,
        }

    def _confirm(self, t_s: float) -> None:
        """Take the choice, or `ready` where a button says so, as the answer, unless it is early."""
        if t_s < self.earliest_s:
            self.early += 1
            return
        has_button = any(target.name == "ready" for target in targets(self.screen))
        answer = "ready" if has_button else self.chosen
        if answer is not None:
            self.answer, self.confirmed_s = answer, t_s

    def _pressed(self, x: float, y: float, t_s: float) -> None:
        name = target_at(self.screen, x, y)
        if name in {"ready", "confirm"}:
            self._confirm(t_s)
        elif name == "scale":
            self._held = True
            self._mark(x, t_s)
        elif name not in {None, "call"}:
            self._choose(name, "pointer", t_s)

    def _mark(self, x: float, t_s: float) -> None:
        """Move the marker to the score nearest to a press on the scale."""
        assert isinstance(self.screen, AskScore)
        place = score_at(x, self.screen.rating)
        self.path.append({"t_s": round(t_s, 4), "at": round(place, 2), "by": "pointer"})
        self._choose(str(round(place)), "pointer", t_s)

    def _typed_key(self, name: str, t_s: float) -> None:
        if name == "backspace":
            self._typed = self._typed[:-1]
            self._choose(self._typed_value(), "key", t_s)
        elif isinstance(self.screen, AskChange):
            self._choose(self._answer_by_key(name, ANSWERS[self.screen.question]), "key", t_s)
        elif isinstance(self.screen, AskScore):
            self._choose(self._score_by_key(name, self.screen.rating), "key", t_s)

    def _typed_value(self) -> str | None:
        """Return the score that is typed, None while it is not on the scale."""
        if not (self._typed and isinstance(self.screen, AskScore)):
            return None
        score = int(self._typed)
        return str(score) if score >= self.screen.rating.minimum else None

    def _answer_by_key(self, name: str, answers: tuple[str, ...]) -> str | None:
        if name.isdigit():
            number = int(name)
            return answers[number - 1] if 1 <= number <= len(answers) else self.chosen
        step = -_STEPS[name] if name in {"up", "down"} else _STEPS.get(name, 0)
        return _stepped(self.chosen, step, answers)

    def _score_by_key(self, name: str, rating: Rating) -> str | None:
        if name.isdigit():
            possible = (text for text in (self._typed + name, name) if int(text) <= rating.maximum)
            self._typed = next(possible, "")
            return self._typed_value() if self._typed else self.chosen
        self._typed = ""
        scores = tuple(str(score) for score in range(rating.minimum, rating.maximum + 1))
        return _stepped(self.chosen, _STEPS.get(name, 0), scores)

    def _choose(self, value: str | None, by: str, t_s: float) -> None:
        if by == "pointer":
            self._typed = ""
        if value == self.chosen:
            return
        self.chosen = value
        self.changes.append({"t_s": round(t_s, 4), "value": value, "by": by})
        if by == "key" and isinstance(self.screen, AskScore):
            at = None if value is None else int(value)
            self.path.append({"t_s": round(t_s, 4), "at": at, "by": "key"})


def _stepped(chosen: str | None, step: int, values: tuple[str, ...]) -> str | None:
    """Return the value next to `chosen`; without a choice, the end at which an arrow starts."""
    if step == 0:
        return chosen
    if chosen is None:
        return values[0] if step > 0 else values[-1]
    return values[min(max(values.index(chosen) + step, 0), len(values) - 1)]
