"""The window's process: receives screens from the session, draws frames, returns answers.

The screen paces the frames if flips wait for its refresh, otherwise a clock does. This process does
not access the device, so no frame waits for the device's link.
"""

import os
import queue
import random
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf
from statistics import median
from typing import Any, Protocol, TextIO

from protocol.errors import WorkFailed
from protocol.study.participant_texts import Wording
from protocol.study.study_question import SCORE
from runner.screens import Ask, Instruction, LeadIn, Notice, OwnFinger, Screen, is_last
from runner.window.elements import STOP, Element, Input, Key, Page, Pressed
from runner.window.messages import Settings, inputs_of, line_of, message_of, screen_of, settings_of
from runner.window.pages import page, states, target_at, targets
from runner.window.question_pages import Button, PageState, look
from runner.window.response import PendingResponse

LATE = 1.5
"""A frame counts as dropped if its interval exceeds this many refresh intervals."""


def frame_record(shown_s: Sequence[float], interval_s: float) -> dict[str, Any]:
    """Return statistics of the intervals between frames, ms, and each dropped frame.

    A dropped frame is given as its time since the first frame, s, and its interval, ms.
    """
    intervals = [later - earlier for earlier, later in pairwise(shown_s)]
    dropped = [
        [round(end - shown_s[0], 4), round(interval * 1000, 2)]
        for end, interval in zip(shown_s[1:], intervals, strict=True)
        if interval > LATE * interval_s
    ]
    frames = {"frames": len(shown_s), "dropped": dropped}
    if not intervals:
        return frames
    ordered = sorted(intervals)
    p99 = ordered[min(int(0.99 * len(ordered)), len(ordered) - 1)]
    times = {"median_ms": median(ordered), "p99_ms": p99, "max_ms": ordered[-1]}
    return {**frames, **{name: round(1000 * time, 2) for name, time in times.items()}}


@dataclass
class ShownScreen:
    """The `number`-th screen of the session; times are seconds on the monotonic clock."""

    number: int
    pending: PendingResponse
    interval_s: float
    """Between refreshes of the screen."""
    progress: tuple[int, int] | None = None
    shown_s: list[float] = field(default_factory=list, init=False)
    """Times of its frames."""
    saved: bool = field(default=False, init=False)
    finger: OwnFinger | None = field(default=None, init=False)
    called_s: list[float] = field(default_factory=list, init=False)

    @property
    def screen(self) -> Screen:
        return self.pending.screen

    def take(self, given: Input, t_s: float) -> None:
        """Apply an input; ignore it before the first frame, when the screen is not yet visible."""
        if not self.shown_s:
            return
        since_s = t_s - self.shown_s[0]
        at = target_at(self.screen, given.x, given.y) if isinstance(given, Pressed) else None
        # The last page has no operator to call.
        may_call = any(target.role == "call" for target in targets(self.screen))
        if (at is not None and at.role == "call") or (may_call and given == Key(name="escape")):
            self.called_s.append(round(since_s, 4))
        else:
            self.pending.take(given, since_s)

    def page(self, t_s: float, wording: Wording) -> Page:
        passed_s = t_s - self.shown_s[0] if self.shown_s else 0.0
        button: Button = "early" if passed_s < self.pending.earliest_s else "live"
        if self.pending.answer is not None:
            button = "saved" if self.saved else "pressed"
        view = PageState(
            **vars(self.pending.choice),
            button=button,
            passed_s=passed_s,
            operator_called=bool(self.called_s),
            progress=self.progress,
            finger=self.finger,
        )
        return page(self.screen, view, wording)

    def record(self) -> dict[str, Any]:
        return {
            "screen": _name(self.screen),
            "shown_s": self.shown_s[0] if self.shown_s else None,
            "operator_called_s": self.called_s,
            **frame_record(self.shown_s, self.interval_s),
        }

    def answer(
        self, past: list[dict[str, Any]], display: dict[str, Any], wording: Wording
    ) -> dict[str, Any]:
        """Return the message with the answer, and with all screens since the last one in `past`."""
        screens = [*past, self.record()]
        trace = {**self.pending.trace(), "screens": screens, "display": display}
        if isinstance(self.screen, Ask) and self.screen.question.form == "scale":
            trace["scale"] = look(self.screen, wording, display)
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


ALIVE_EVERY_S = 0.2
# For virtual screens and drivers that report no rate.
_USUAL_REFRESH_HZ = 60.0
ORPHANED_S = 60.0
"""How long the last page remains once the session's process is gone."""
_SLICE_S = 0.004
"""Interval of input polls between frames, which limits the resolution of reaction times."""

_TRIAL_FLIPS = 6
_HELD_BACK = 0.7
"""If every flip takes at least this part of a refresh interval, flips wait for the screen."""

_EARLY_SHARE = 0.5
"""If so, a frame is drawn after this part of the interval, and the flip waits for the rest."""


class Canvas(Protocol):
    """The window's drawing surface and inputs."""

    closed: bool
    state: dict[str, bool]
    """Of the window: `has_keys` if keys reach it, `is_shown` unless it is minimised."""
    lost: str
    """Why the participant may not see the window any more; empty while they do."""

    def look(self) -> dict[str, Any]:
        """Return the properties of the screen."""

    def draw(self, page: Page) -> None:
        """Draw into the back buffer."""

    def prepare(self, element: Element) -> None:
        """Build the stimuli of `element` in advance."""

    def flip(self) -> float:
        """Show the back buffer; return the time of the flip, s on the monotonic clock."""

    def inputs(self) -> list[tuple[float, Input]]:
        """Return the inputs since the last call, each with its time."""

    def press(self, given: Input) -> None:
        """Let `given` arrive as if a person had made it."""


Mailbox = queue.SimpleQueue[Mapping[str, Any]]
"""Messages from the session; the last one is `end`, or `lost` if its process is gone."""


@dataclass
class WindowServer:
    """Shows the screens from the mailbox until the session ends or the window is closed.

    If the session's process is gone, nobody knows of the output: the page that asks to lift the
    finger stays for a while.
    """

    canvas: Canvas
    settings: Settings
    mailbox: Mailbox
    send: Callable[[Mapping[str, Any]], None]
    now_s: Callable[[], float] = time.monotonic
    random: Callable[[], float] = random.random
    _standing: ShownScreen = field(init=False)
    _past: list[dict[str, Any]] = field(default_factory=list, init=False)
    _progress: tuple[int, int] | None = field(default=None, init=False)
    _ends_s: float = field(default=inf, init=False)
    _alive_s: float = field(default=0.0, init=False)
    _due_s: float = field(default=0.0, init=False)
    _share: float = field(default=1.0, init=False)
    _drawn: Page | None = field(default=None, init=False)
    _told: dict[str, bool] = field(default_factory=dict, init=False)

    def run(self) -> None:
        """Show a page that asks to wait, then serve."""
        self._display, self._told = self.canvas.look(), dict(self.canvas.state)
        self._interval_s = 1 / (self._display["refresh_hz"] or _USUAL_REFRESH_HZ)
        # A page from the beginning: the session may need a while before it sends the first one.
        self._show(0, Notice(text="wait"))
        self._frame()
        # After a frame was really drawn: no session begins with a window that cannot draw.
        self.send({"opened": self._display})
        self._learn_pace()
        coming = self._coming()
        while self.now_s() < self._ends_s and not (self.canvas.closed or self.canvas.lost):
            self._wait()
            self._frame()
            # One per frame, so that the session never waits: a whole page at once takes a busy
            # computer a second, in which the window neither draws nor says that it lives.
            if foreseen := next(coming, None):
                self.canvas.prepare(foreseen)
        if self.canvas.closed:
            self.send({"closed": True})
        elif self.canvas.lost:
            self.send({"unseen": self.canvas.lost})

    def _coming(self) -> Iterator[Element]:
        """Yield what the pages to come consist of, each element once."""
        seen: set[Element] = set()
        for screen in self.settings.foreseen:
            for state in states(screen):
                new = [it for it in page(screen, state, self.settings.wording) if it not in seen]
                seen.update(new)
                yield from new

    def _learn_pace(self) -> None:
        """Measure whether flips wait for the screen and, if so, the refresh interval."""
        flipped_s = []
        for _ in range(_TRIAL_FLIPS):
            self.canvas.draw(self._page())
            flipped_s.append(self.canvas.flip())
        flips_s = [later - earlier for earlier, later in pairwise(flipped_s)]
        # The shortest one decides: a busy computer makes single flips late, which must not pass for
        # a screen that holds them back.
        if min(flips_s) >= _HELD_BACK * self._interval_s:
            # As measured, because the interval so far may only be the usual one.
            self._share, self._interval_s = _EARLY_SHARE, median(flips_s)
        self._display["paced_by"] = "clock" if self._share == 1.0 else "screen"
        self._display["interval_ms"] = round(self._interval_s * 1000, 3)

    def _wait(self) -> None:
        """Wait until the next frame is due or a message arrives; poll the inputs at least once."""
        while True:
            self._take_inputs()
            left_s = self._due_s - self.now_s()
            wait_s = min(max(left_s, 0.0), _SLICE_S)
            try:
                message = self.mailbox.get(wait_s > 0, wait_s)
            except queue.Empty:
                if left_s <= 0 or self.canvas.closed:
                    return None
            else:
                return self._obey(message)

    def _obey(self, message: Mapping[str, Any]) -> None:
        match message:
            case {"show": number}:
                # The record of a page that was answered went with its answer.
                if self._standing.pending.answer is None:
                    self._past.append(self._standing.record())
                self._show(number, screen_of(message))
            case {"progress": [int(trial), int(total)]}:
                self._progress = trial, total
            case {"finger": dict(finger)}:
                self._standing.finger = OwnFinger(**finger)
            case {"press": _}:
                for given in inputs_of(message):
                    self.canvas.press(given)
            case {"saved": number}:
                self._standing.saved |= number == self._standing.number
            case _:
                self._end(lost="lost" in message)

    def _end(self, *, lost: bool) -> None:
        """End; if the session is lost, let the last page stand for a while, unless it stood."""
        screen, self._ends_s = self._standing.screen, self.now_s()
        if lost and not is_last(screen):
            self._show(self._standing.number + 1, Notice(text="stopped"))
            self._ends_s += ORPHANED_S

    def _show(self, number: int, screen: Screen) -> None:
        pending = PendingResponse(screen, self.settings.readable_s, self.random())
        self._standing = ShownScreen(number, pending, self._interval_s, self._progress)

    def _frame(self) -> None:
        first, page_now = not self._standing.shown_s, self._page()
        # The last frame may stand where a clock paces them and `alive` is not due.
        ticks, changed = self._share == 1.0, first or page_now != self._drawn
        if changed or not (ticks and self.now_s() - self._alive_s < ALIVE_EVERY_S):
            self.canvas.draw(page_now)
            flipped_s, self._drawn = self.canvas.flip(), page_now
        else:
            flipped_s = self.now_s()
        self._standing.shown_s.append(flipped_s)
        earliest_s = flipped_s - self._interval_s
        # Added to the time that was due, so that small delays do not add up; but a long one is not
        # made good by a burst of frames, and the frame after a page that came early is not late.
        from_s = min(max(self._due_s, earliest_s), flipped_s)
        self._due_s = from_s + self._interval_s * self._share
        if first and self._standing.number:
            self.send({"shown": self._standing.number, "at_s": flipped_s})
        if flipped_s - self._alive_s >= ALIVE_EVERY_S or self._told != self.canvas.state:
            self._alive_s, self._told = flipped_s, dict(self.canvas.state)
            # Sent from here: it says that frames are drawn, not only that a process exists.
            self.send({"alive": flipped_s, "state": self._told})

    def _page(self) -> Page:
        return self._standing.page(self.now_s(), self.settings.wording)

    def _take_inputs(self) -> None:
        for t_s, given in self.canvas.inputs():
            if isinstance(given, Key) and given.name == STOP.name:
                # Before all else and on every page, because a finger may lie on the beam.
                self.send({"stop": True})
                continue
            standing = self._standing
            answered, called = standing.pending.answer, len(standing.called_s)
            standing.take(given, t_s)
            if len(standing.called_s) > called:
                self.send({"operator": True})
            if answered is None and standing.pending.answer is not None:
                if self._ends_s < inf:
                    self._ends_s = self.now_s()  # nobody is there to be told that it was read
                past, self._past = self._past, []
                self.send(standing.answer(past, self._display, self.settings.wording))


def serve_window() -> None:
    """Open the window with the settings in the first line of standard input and serve it.

    Standard output carries messages only: whatever libraries print goes to standard error.
    """
    # Libraries also print from C, so the descriptor itself is redirected.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def send(message: Mapping[str, Any]) -> None:
        with suppress(BrokenPipeError):  # the session's process is gone, as the mailbox says
            answers.write(line_of(message))
            answers.flush()

    settings = settings_of(message_of(sys.stdin.readline()))
    try:
        # Here: the import opens the display and fails without one, as a message must say.
        from runner.window.canvas import PsychopyCanvas

        canvas = PsychopyCanvas(settings)
    except WorkFailed as error:
        return send({"failed": str(error)})
    except Exception as error:
        display = os.environ.get("DISPLAY", "this screen")
        why = f"the participant's window cannot open on {display} ({_first_line(error)})"
        return send({"failed": why})
    try:
        WindowServer(canvas, settings, mailbox_of(sys.stdin), send).run()
    except Exception as error:
        # Drawing fails, too, if somebody has closed the window. Then that is the reason.
        return send({"broken": _first_line(error)} if canvas.is_there() else {"closed": True})
    return canvas.close()


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0] or type(error).__name__


def mailbox_of(source: TextIO) -> Mailbox:
    """Return a mailbox that a thread fills from `source`, so that no frame waits for input."""
    mailbox: Mailbox = Mailbox()

    def read() -> None:
        try:
            for line in source:
                mailbox.put(message_of(line))
        except ValueError as error:  # of the text's encoding too
            print(error, file=sys.stderr)  # the session reports the last line
        mailbox.put({"lost": True})

    # A daemon: a read that blocks cannot be interrupted.
    threading.Thread(target=read, name="screens", daemon=True).start()
    return mailbox
