"""The people of a day: a participant with a mind of their own, and an operator who types."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field

from device.simulator.in_process import InProcessDevice
from protocol.study.study_question import RATING, SCORE
from runner.people.participant_console import ParticipantGone
from runner.screens import (
    Ask,
    Instruction,
    Notice,
    OwnFinger,
    Pacing,
    Participant,
    Response,
    Screen,
    Welcome,
)
from tests.system.day.invariants import require
from tests.system.day.process import Process


@dataclass
class Person(Participant):
    """A participant who thinks for a while and answers anything that may be answered."""

    stream: random.Random
    device: InProcessDevice
    process: Process
    hang: Callable[[float], None]
    """Block the session's thread for some seconds."""
    given: list[tuple[str, float]] = field(default_factory=list)
    """The answers to questions since the last trial began, with their times."""
    gone: bool = False
    hangs_s: float = 0.0
    _screen: Screen | None = None
    _ready_s: float = 0.0

    def show(self, screen: Screen) -> None:
        self.process.crossing("people")
        self._screen = screen
        slow = self.stream.random() < 0.02
        self._ready_s = self.device.now_s() + self.stream.uniform(0, 8.0 if slow else 0.3)
        beam = self.device.inside.beam
        if isinstance(screen, Instruction):
            self.given.clear()
        if isinstance(screen, Pacing):
            beam.touch(screen.force_n * self.stream.uniform(0.4, 1.6), screen.start_m, "right")
        elif isinstance(screen, Notice):
            beam.lift()

    def progress(self, number: int, total: int) -> None:
        pass

    def felt(self, finger: OwnFinger) -> None:
        pass

    def saved(self) -> None:
        pass

    def poll(self) -> Response | None:
        self.process.crossing("people")
        if self.gone:
            raise ParticipantGone("the participant's window was closed")
        if self.hangs_s:
            seconds, self.hangs_s = self.hangs_s, 0.0
            self.hang(seconds)
        if self.device.now_s() < self._ready_s:
            return None
        match self._screen:
            case Instruction() | Welcome():
                return self._respond("ready")
            case Ask(question=question) if question.name not in {SCORE, RATING}:
                return self._respond(self.stream.choice(question.values), remember=True)
            case Ask(question=question):
                place = question.place(self.stream.randint(0, question.places))
                return self._respond(str(place), remember=True)
        return None

    def _respond(self, answer: str, *, remember: bool = False) -> Response:
        self._screen = None
        seconds = round(self.stream.uniform(0.1, 3.0), 3)
        if remember:
            self.given.append((answer, seconds))
        return Response(answer=answer, reaction_time_s=seconds)


@dataclass
class Typist:
    """An operator's hands: keys at their times, and Enter some time after each question."""

    stream: random.Random
    now_s: Callable[[], float]
    process: Process
    typed: list[str] = field(default_factory=list)
    """What is about to be typed."""
    continues_s: float = float("inf")
    """When the operator ends a pause."""
    _enter_s: float | None = None

    def __call__(self, asked: bool) -> str:
        self.process.crossing("people")
        if self.now_s() >= self.continues_s:
            self.continues_s = float("inf")
            return "p"
        if self.typed:
            return self.typed.pop(0)
        if not asked:
            self._enter_s = None
        elif self._enter_s is None:
            self._enter_s = self.now_s() + self.stream.uniform(0, 0.5)
        elif self.now_s() >= self._enter_s:
            self._enter_s = None
            return "\r"
        return ""


def said_of_output(line: str) -> str:
    """Return what a line to the operator says of the output: on, off, was off, unknown, or nothing.

    >>> said_of_output("P01/1 trial voltage; 3 of 7 trials, about 2 min left; output off")
    'off'
    """
    require(11, "\n" not in line and len(line) < 2000, f"not one line: {line!r}")
    if "UNKNOWN" in line:
        return "unknown"
    if "the output was off when it was last read back" in line:
        return "was off"
    if "output off" in line or "device off (read back)" in line:
        return "off"
    return "on" if "output ON" in line else ""
