"""The block of a sliding experiment, in the participant's place: it is drawn along with a mark.

At a rig the operator draws it. On a simulated device a simulated finger does.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from typing import Protocol

from device.force_channel.samples import Forces
from protocol.plan.trials import Plan
from runner.clock import Clock
from runner.interfaces import Operator
from runner.people.slide_plot import Drawing, SlidePlot
from runner.screens import (
    FingerPath,
    Instruction,
    LeadIn,
    Notice,
    OwnFinger,
    Pacing,
    Response,
    Screen,
    Welcome,
)


class MovingFinger(Protocol):
    """A simulated finger that moves by itself."""

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        """Put it down; it moves on in `direction` at its speed."""
        ...

    def lift(self) -> None:
        """Take it off the beam."""
        ...


@dataclass
class SlidingBlock:
    """The block, which is put on the beam, drawn along with the mark, and lifted.

    Args:
        operator: is asked to put the block on the beam, and told what was measured.
        forces: returns the newest forces, None while nothing is recorded.
        clock: the session's clock.
        plan: the passes.
        load_n: weight of the block.
        plot: shows what is measured.
        finger: draws the block on a simulated device; None where the operator does.
    """

    operator: Operator
    forces: Callable[[], Forces | None]
    clock: Clock
    plan: Plan
    load_n: float
    plot: SlidePlot
    finger: MovingFinger | None = None
    _screen: Screen | None = field(default=None, init=False)
    _asked_s: float = field(default=0.0, init=False)
    _drawn: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        self._pass = self.plan.trials[0]

    def show(self, screen: Screen) -> None:
        """Receive `screen`: where to put the block, when to draw it, when to lift it."""
        self._screen, self._asked_s = screen, self.clock.monotonic_s()
        match screen:
            case Instruction(touch=FingerPath() as path) if self.finger is None:
                self.operator.confirm(self._placed(path))
            case LeadIn() | Pacing():
                self._draw(screen)
            case Notice(text="touch.end" | "stopped"):
                self._lift()

    def _placed(self, path: FingerPath) -> str:
        end = "left" if path.start_m < path.end_m else "right"
        return (
            f"Put the block ({self.load_n:g} N) on the beam at the {end} end of its way, its right "
            f"edge at {1e3 * path.start_m:g} mm, then press Enter."
        )

    def _draw(self, screen: LeadIn | Pacing) -> None:
        """Begin a pass, or with a lead-in the wait before it."""
        duration_s = inf if isinstance(screen, LeadIn) else screen.duration_s
        before_s = screen.seconds if isinstance(screen, LeadIn) else 0.0
        drawing = Drawing(
            label=f"pass {self._pass.index + 1}, {self._pass.condition}",
            start_m=screen.start_m,
            end_m=screen.end_m,
            moves_s=self._asked_s + before_s,
            duration_s=duration_s,
        )
        self.plot.begin(drawing)
        self._drawn = isinstance(screen, Pacing)
        if self.finger is not None:
            direction = "right" if screen.end_m > screen.start_m else "left"
            speed_m_s = abs(screen.end_m - screen.start_m) / duration_s
            self.finger.touch(self.load_n, screen.start_m, direction, speed_m_s)

    def _lift(self) -> None:
        if self.finger is not None:
            self.finger.lift()
        if self._drawn:
            self._drawn = False
            self.operator.notify(self.plot.end(driven=self._pass.touches[0].voltage_v > 0))

    def progress(self, number: int, total: int) -> None:
        """Note which pass comes next: they are made in the order of the plan."""
        assert total == len(self.plan.trials), "every trial is a pass"
        self._pass = self.plan.trials[number - 1]

    def saved(self) -> None:
        """Do nothing: the operator sees what is done."""

    def felt(self, finger: OwnFinger) -> None:
        """Do nothing: the plot shows where the block is."""

    def poll(self) -> Response | None:
        """Return that the block is ready once it is on the beam; take what is measured meanwhile.

        Nobody has to be welcomed.
        """
        match self._screen:
            case Pacing():
                self.plot.take(self.forces())
                return None
            case Instruction() if self.finger is None:
                answered = self.operator.answered() is not None
            case Instruction() | Welcome():
                answered = True
            case _:
                answered = False
        if not answered:
            return None
        self._screen = None
        seconds = self.clock.monotonic_s() - self._asked_s
        return Response(answer="ready", reaction_time_s=round(seconds, 3))
