"""The block of a sliding experiment, in the participant's place: it is drawn along with a mark.

At a rig the operator draws it. On a simulated device a simulated finger does.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from device.force_channel.recording import Forces
from protocol.journal.records import LIFTED_N
from protocol.plan.trials import Plan
from runner import screens
from runner.clock import Clock
from runner.people.virtual_participant import Finger

_LEFT = 7
"""Columns for the figures at the axis of friction."""
_BESIDE = 5
"""Lines for the title, the axis of places with its figures, the pace and what is said of it."""
_LOWEST = 3
"""Lines of a plot that still shows something."""
_STEP = 0.05
"""Friction is drawn between two multiples of this."""


@dataclass(frozen=True, kw_only=True)
class Drawing:
    """The pass that is drawn: its ends, when the mark begins to move, and for how long it does."""

    label: str
    start_m: float
    end_m: float
    moves_s: float
    duration_s: float

    def mark_m(self, now_s: float) -> float:
        share = min(max((now_s - self.moves_s) / self.duration_s, 0.0), 1.0)
        return self.start_m + share * (self.end_m - self.start_m)


@dataclass
class SlidePlot:
    """Friction along the beam as it is measured, of one pass at a time.

    `resting` is the mean friction of the last pass at 0 V, None before there is one.
    """

    resting: float | None = None
    drawing: Drawing | None = None
    _points: list[tuple[float, float]] = field(default_factory=list, init=False)
    _last_s: float = field(default=0.0, init=False)
    _low: float = field(default=math.inf, init=False)
    _high: float = field(default=-math.inf, init=False)

    def begin(self, drawing: Drawing) -> None:
        self.drawing, self._points, self._last_s = drawing, [], 0.0

    def take(self, forces: Forces | None) -> None:
        """Add the newest forces, unless they are known already or the block is not on the beam."""
        if forces is None or forces.at_s == self._last_s or forces.normal_n < LIFTED_N:
            return
        self._last_s = forces.at_s
        friction = forces.tangential_n / forces.normal_n
        self._points.append((forces.position_m, friction))
        # Over all passes, so that the axis stays and passes can be compared.
        self._low, self._high = min(self._low, friction), max(self._high, friction)

    def end(self, *, driven: bool) -> str:
        """End the pass and return it in words; one at 0 V is what others are compared with."""
        if self.drawing is None or not self._points:
            return "no forces were measured: was the block on the beam?"
        values = [friction for _, friction in self._points]
        mean = sum(values) / len(values)
        if not driven:
            self.resting = mean
        return f"{self.drawing.label}: mu {mean:.3f}, from {min(values):.3f} to {max(values):.3f}"

    def lines(self, width: int, rows: int, now_s: float) -> list[str]:
        """Return `rows` lines of at most `width` columns; a few hold the pace alone."""
        if self.drawing is None:
            drawn = ["the plot begins with the first pass"]
        else:
            drawn = self._lines(self.drawing, max(width - _LEFT - 2, 10), rows, now_s)
        return [line[:width] for line in [*drawn, *[""] * rows][:rows]]

    def _lines(self, drawing: Drawing, columns: int, rows: int, now_s: float) -> list[str]:
        pace = _pace(drawing, columns, now_s, self._points[-1][0] if self._points else None)
        # On a low terminal the pace matters more than the plot: the operator follows it.
        if rows < _BESIDE + _LOWEST:
            return pace
        ends_mm = sorted((1e3 * drawing.start_m, 1e3 * drawing.end_m))
        left, right = (f"{end_mm:.0f} mm" for end_mm in ends_mm)
        return [
            f"mu against place  {drawing.label}",
            *self._grid(drawing, columns, rows - _BESIDE),
            f"{'':{_LEFT}}└{'─' * columns}",
            f"{'':{_LEFT}} {left:<{columns - len(right)}}{right}",
            *pace,
        ]

    def _grid(self, drawing: Drawing, columns: int, rows: int) -> list[str]:
        """Return the plot itself: a dot per column for the mean friction there."""
        # The axis holds everything so far, of all passes.
        known = [self._low, self._high] if self._low <= self._high else [0.4]
        known += [] if self.resting is None else [self.resting]
        low = _STEP * math.floor(min(known) / _STEP - 0.2)
        high = max(_STEP * math.ceil(max(known) / _STEP + 0.2), low + 2 * _STEP)
        cells = [[" "] * columns for _ in range(rows)]

        def row(friction: float) -> int:
            share = (high - friction) / (high - low)
            return min(max(round(share * (rows - 1)), 0), rows - 1)

        if self.resting is not None:
            cells[row(self.resting)] = ["·"] * columns
        within: dict[int, list[float]] = {}
        for place_m, friction in self._points:
            within.setdefault(_column(drawing, columns, place_m), []).append(friction)
        for column, values in within.items():
            cells[row(sum(values) / len(values))][column] = "●"
        figures = {0: f"{high:.2f}", rows // 2: "", rows - 1: f"{low:.2f}"}
        if self.resting is not None and figures.get(row(self.resting), "") == "":
            figures[row(self.resting)] = f"{self.resting:.3f}"
        return [
            f"{figures.get(number, ''):>{_LEFT - 1}} │{''.join(line)}".rstrip()
            for number, line in enumerate(cells)
        ]


def _column(drawing: Drawing, columns: int, place_m: float) -> int:
    left_m, right_m = sorted((drawing.start_m, drawing.end_m))
    share = (place_m - left_m) / (right_m - left_m)
    return min(max(int(share * columns), 0), columns - 1)


def _pace(drawing: Drawing, columns: int, now_s: float, block_m: float | None) -> list[str]:
    """Return the bar on which the mark (|) leads the block (◆), and what is said of it."""
    mark_m = drawing.mark_m(now_s)
    bar = ["─"] * columns
    if block_m is not None:
        bar[_column(drawing, columns, block_m)] = "◆"
    bar[_column(drawing, columns, mark_m)] = "┃"
    wait_s, left_s = drawing.moves_s - now_s, drawing.moves_s + drawing.duration_s - now_s
    # During the lead-in it is not known yet how long the pass will take.
    if wait_s > 0 or math.isinf(left_s):
        said = f"the mark moves in {max(math.ceil(wait_s), 0)}"
    elif left_s <= 0:
        said = "end of the pass: output off, lift the block"
    else:
        behind_mm = 0.0 if block_m is None else 1e3 * (mark_m - block_m)
        behind_mm *= 1 if drawing.end_m > drawing.start_m else -1
        side = "behind" if behind_mm > 0 else "ahead of"
        block = "" if block_m is None else f", the block is {abs(behind_mm):.0f} mm {side} the mark"
        said = f"draw: {left_s:.0f} s left{block}"
    return [f"{'pace':>{_LEFT - 1}}  {''.join(bar)}", f"{'':{_LEFT}} {said}"]


@dataclass
class SlidingBlock(screens.Participant):
    """The block, which is put on the beam, drawn along with the mark, and lifted.

    The `operator` puts it on the beam, and draws it unless a `finger` does, on a simulated device.
    `forces` returns the newest ones, None while nothing is recorded.
    """

    operator: screens.Operator
    forces: Callable[[], Forces | None]
    clock: Clock
    plan: Plan
    load_n: float
    plot: SlidePlot
    finger: Finger | None = None
    _screen: screens.Screen | None = field(default=None, init=False)
    _asked_s: float = field(default=0.0, init=False)
    _drawn: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self._pass = self.plan.trials[0]

    def show(self, screen: screens.Screen) -> None:
        """Receive `screen`: where to put the block, when to draw it, when to lift it."""
        self._screen, self._asked_s = screen, self.clock.monotonic_s()
        match screen:
            case screens.Instruction(touch=screens.FingerPath() as path) if self.finger is None:
                end = "left" if path.start_m < path.end_m else "right"
                self.operator.confirm(
                    f"Put the block ({self.load_n:g} N) on the beam at the {end} end of its way, "
                    f"its right edge at {1e3 * path.start_m:g} mm, then press Enter."
                )
            case screens.LeadIn() | screens.Pacing():
                self._draw(screen)
            # A session that is stopped in the middle of a pass shows no end of the touch.
            case screens.Notice(text="touch.end" | "stopped"):
                if self.finger is not None:
                    self.finger.lift()
                if self._drawn:
                    self._drawn = False
                    self.operator.notify(self.plot.end(driven=self._pass.touches[0].voltage_v > 0))

    def _draw(self, screen: screens.LeadIn | screens.Pacing) -> None:
        """Begin a pass, or with a lead-in the wait before it."""
        duration_s = math.inf if isinstance(screen, screens.LeadIn) else screen.duration_s
        before_s = screen.seconds if isinstance(screen, screens.LeadIn) else 0.0
        drawing = Drawing(
            label=f"pass {self._pass.index + 1}, {self._pass.condition}",
            start_m=screen.start_m,
            end_m=screen.end_m,
            moves_s=self._asked_s + before_s,
            duration_s=duration_s,
        )
        self.plot.begin(drawing)
        self._drawn = isinstance(screen, screens.Pacing)
        if self.finger is not None:
            direction = "right" if screen.end_m > screen.start_m else "left"
            # 0 during the lead-in: the block rests at its start.
            speed_m_s = abs(screen.end_m - screen.start_m) / duration_s
            self.finger.touch(self.load_n, screen.start_m, direction, speed_m_s)

    def progress(self, number: int, total: int) -> None:
        """Note which pass comes next: they are made in the order of the plan."""
        assert total == len(self.plan.trials), "every trial is a pass"
        self._pass = self.plan.trials[number - 1]

    def poll(self) -> screens.Response | None:
        """Return that the block is ready once it is on the beam; take what is measured meanwhile.

        Nobody has to be welcomed.
        """
        match self._screen:
            case screens.Pacing():
                self.plot.take(self.forces())
                return None
            case screens.Instruction() if self.finger is None:
                if self.operator.answered() is None:
                    return None
            case screens.Notice() | screens.LeadIn() | screens.Ask() | None:
                return None
        self._screen = None
        seconds = self.clock.monotonic_s() - self._asked_s
        return screens.Response(answer="ready", reaction_time_s=round(seconds, 3))
