"""Responses from presses and keys: a choice, which may change, then a confirmation.

At first nothing is chosen. A choice becomes an answer only when it is confirmed, which is possible
only once the page has been readable for long enough.
"""

from dataclasses import dataclass, field, replace
from typing import Any

from runner.screens import Ask, Screen
from runner.window.elements import Dragged, Input, Key, Pressed, Released, Typed
from runner.window.pages import target_at, targets
from runner.window.question_pages import Choice, by_key, by_press, nearest, score_at

EARLY_S = 0.15
"""Shorter than any reaction time: an earlier press was meant for the previous screen."""


@dataclass
class PendingResponse:
    """The response to one screen; times are seconds since the screen was first shown."""

    screen: Screen
    readable_s: float = 0.0
    start: float = 0.5
    """Where the first arrow marks a visual analogue scale, as a share of its length."""
    choice: Choice = field(default_factory=Choice, init=False)
    answer: str | None = field(default=None, init=False)
    confirmed_s: float = field(default=0.0, init=False)
    changes: list[dict[str, Any]] = field(default_factory=list, init=False)
    path: list[dict[str, Any]] = field(default_factory=list, init=False)
    early: int = field(default=0, init=False)
    _held: bool = field(default=False, init=False)
    _began: set[Input] = field(default_factory=set, init=False)
    """What began on this page, so that a key that is held may go on with it."""

    def take(self, given: Input, t_s: float) -> None:
        # A confirmed answer is on its way to the journal and cannot change any more.
        if self.answer is not None or not self._is_meant(given):
            return
        if t_s < EARLY_S:
            self.early += isinstance(given, Pressed | Key)
            return
        self._began.add(given)
        match given:
            case Key(name="enter"):
                self._confirm(t_s)
            case Key() | Typed() if isinstance(self.screen, Ask):
                now = by_key(self.screen.question, self.choice, given, self.start)
                self._choose(now, "key", t_s)
            case Pressed(x=x, y=y):
                self._pressed(x, y, t_s)
            # Only a drag that began on the scale moves its mark.
            case Dragged(x=x) if self._held:
                self._mark(x, t_s)
            case Released():
                self._held = False

    def _is_meant(self, given: Input) -> bool:
        """Return whether an input is meant for this page: not what a held key repeats from another.

        A held Enter confirms nothing, so that each decision has a press of its own.
        """
        if not isinstance(given, Key | Typed) or not given.repeated:
            return True
        first = replace(given, repeated=False)
        return first in self._began and first != Key(name="enter")

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
        """Take the choice as the answer, `ready` where a button says so, unless it is early."""
        # Counted and not dropped, so that the data show who was impatient.
        if t_s < self.earliest_s:
            self.early += 1
            return
        has_button = any(target.name == "ready" for target in targets(self.screen))
        answer = "ready" if has_button and not isinstance(self.screen, Ask) else self.choice.chosen
        if isinstance(self.screen, Ask) and not self.screen.question.required:
            answer = answer or ""
        if answer is not None:
            self.answer, self.confirmed_s = answer, t_s

    def _pressed(self, x: float, y: float, t_s: float) -> None:
        target = target_at(self.screen, x, y)
        if target is None:
            return
        if target.role == "button":
            self._confirm(t_s)
        elif target.role == "scale":
            self._held = True
            self._mark(x, t_s)
        elif target.role == "answer" and isinstance(self.screen, Ask):
            now = by_press(self.screen.question, self.choice, target.name)
            self._choose(now, "pointer", t_s)

    def _mark(self, x: float, t_s: float) -> None:
        """Move the mark to the place nearest to a press on the scale."""
        assert isinstance(self.screen, Ask)
        place = score_at(x, self.screen.question)
        # Not rounded: the path shows hesitation between two places of the scale.
        self.path.append({"t_s": round(t_s, 4), "at": round(place, 2), "by": "pointer"})
        now = Choice(chosen=str(nearest(x, self.screen.question)))
        self._choose(now, "pointer", t_s)

    def _choose(self, choice: Choice, by: str, t_s: float) -> None:
        before, chosen, self.choice = self.choice.chosen, choice.chosen, choice
        if chosen == before:
            return
        self.changes.append({"t_s": round(t_s, 4), "value": chosen, "by": by})
        assert isinstance(self.screen, Ask)
        if by == "key" and self.screen.question.form == "scale":
            at = None if chosen is None else self.screen.question.answer(chosen)
            self.path.append({"t_s": round(t_s, 4), "at": at, "by": "key"})
