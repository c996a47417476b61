"""A screen while it is shown: its inputs, frame times and record."""

from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median
from typing import Any

from protocol.study.participant_texts import Wording
from protocol.study.study_question import SCORE
from runner.screens import Ask, Instruction, LeadIn, Notice, OwnFinger, Screen
from runner.window.elements import Input, Key, Page, Pressed
from runner.window.pages import page, target_at, targets
from runner.window.questions.page_layout import Button, PageState
from runner.window.questions.rating_scale import look
from runner.window.response import PendingResponse

LATE = 1.5
"""A frame counts as dropped if its interval exceeds this many refresh intervals."""


@dataclass
class FrameTimes:
    """Times of the frames of one screen, seconds on the session's monotonic clock."""

    interval_s: float
    shown_s: list[float] = field(default_factory=list, init=False)

    def add(self, t_s: float) -> None:
        """Add a frame."""
        self.shown_s.append(t_s)

    def record(self) -> dict[str, Any]:
        """Return the intervals' statistics in milliseconds and each dropped frame, for the journal.

        A dropped frame is given as its time since the first frame, s, and its interval, ms.
        """
        intervals = [later - earlier for earlier, later in pairwise(self.shown_s)]
        dropped = [
            [round(end - self.shown_s[0], 4), round(interval * 1000, 2)]
            for end, interval in zip(self.shown_s[1:], intervals, strict=True)
            if interval > LATE * self.interval_s
        ]
        return {"frames": len(self.shown_s), "dropped": dropped, **_statistics(intervals)}


def _statistics(intervals: list[float]) -> dict[str, float]:
    if not intervals:
        return {}
    ordered = sorted(intervals)
    p99 = ordered[min(int(0.99 * len(ordered)), len(ordered) - 1)]
    milliseconds = {"median_ms": median(ordered), "p99_ms": p99, "max_ms": ordered[-1]}
    return {name: round(value * 1000, 2) for name, value in milliseconds.items()}


@dataclass
class ShownScreen:
    """The `number`-th screen of the session; times are seconds on the monotonic clock."""

    number: int
    screen: Screen
    interval_s: float
    readable_s: float = 0.0
    progress: tuple[int, int] | None = None
    start: float = 0.5
    saved: bool = field(default=False, init=False)
    finger: OwnFinger | None = field(default=None, init=False)
    pending: PendingResponse = field(init=False)
    frames: FrameTimes = field(init=False)
    called_s: list[float] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        self.pending = PendingResponse(self.screen, self.readable_s, self.start)
        self.frames = FrameTimes(self.interval_s)

    def take(self, given: Input, t_s: float) -> None:
        """Apply an input; ignore it before the first frame, when the screen is not yet visible."""
        if not self.frames.shown_s:
            return
        since_s = t_s - self.frames.shown_s[0]
        at = target_at(self.screen, given.x, given.y) if isinstance(given, Pressed) else None
        may_call = any(target.role == "call" for target in targets(self.screen))
        if (at is not None and at.role == "call") or (may_call and given == Key(name="escape")):
            self.called_s.append(round(since_s, 4))
        else:
            self.pending.take(given, since_s)

    def page(self, t_s: float, wording: Wording) -> Page:
        """Return the page at `t_s`."""
        passed_s = t_s - self.frames.shown_s[0] if self.frames.shown_s else 0.0
        button: Button = "early" if passed_s < self.pending.earliest_s else "live"
        if self.pending.answer is not None:
            button = "saved" if self.saved else "pressed"
        view = PageState(
            chosen=self.pending.chosen,
            typed=self.pending.typed,
            button=button,
            passed_s=passed_s,
            operator_called=bool(self.called_s),
            progress=self.progress,
            finger=self.finger,
        )
        return page(self.screen, view, wording)

    def record(self) -> dict[str, Any]:
        """Return the screen's name, the time when it was first shown, and its frames."""
        return {
            "screen": _name(self.screen),
            "shown_s": self.frames.shown_s[0] if self.frames.shown_s else None,
            "operator_called_s": self.called_s,
            **self.frames.record(),
        }

    def answer(
        self, past: list[dict[str, Any]], display: dict[str, Any], wording: Wording
    ) -> dict[str, Any]:
        """Return the message with the answer and its trace.

        Args:
            past: records of the screens shown since the last answer.
            display: properties of the display, for the journal.
            wording: language of the scale's labels.
        """
        screens = [*past, self.record()]
        trace = {**self.pending.trace(), "screens": screens, "display": display}
        if isinstance(self.screen, Ask) and self.screen.question.kind in {"scale", "analogue"}:
            trace["scale"] = _scale_look(self.screen, display, wording)
        return {
            "answer": self.pending.answer,
            "of": self.number,
            "reaction_time_s": self.pending.reaction_time_s,
            "trace": trace,
        }


def _name(screen: Screen) -> str:
    match screen:
        case Notice(text=text) | Instruction(text=text):
            return text
        case Ask(question=question):
            return SCORE if question.name == SCORE else f"question.{question.name}"
        case LeadIn():
            return "lead-in"
    return type(screen).__name__.lower()


def _scale_look(screen: Ask, display: dict[str, Any], wording: Wording) -> dict[str, object]:
    seen = look(screen.question, screen.bands, wording, display["px_per_unit"])
    mm_per_px = display["mm_per_px"]
    length_px = seen["length_px"]
    assert isinstance(length_px, float)
    return {**seen, "length_mm": None if mm_per_px is None else round(length_px * mm_per_px, 1)}
