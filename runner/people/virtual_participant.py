"""A virtual participant: touches the simulated beam, feels its friction, answers and rates.

What it feels is what the simulated device really does, by way of the hand on its beam; it knows
neither the plan nor the drive.
"""

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from device.simulator.client import ControlClient
from protocol.study.questions import Question
from runner.clock import Clock
from runner.screens import (
    AskChange,
    AskScore,
    Instruction,
    Notice,
    Pacing,
    Response,
    Screen,
    Welcome,
)

JUST_NOTICEABLE = 0.01
"""Change of log friction below which a virtual participant says that nothing changed."""


@dataclass(frozen=True, kw_only=True)
class Character:
    """How a virtual participant judges: rating = bias + gain · felt contrast + noise."""

    bias: float
    gain: float
    felt_noise: float = 0.02
    rating_noise: float = 0.8


def drawn_character(random_stream: random.Random) -> Character:
    """Return a character from a population like the nine people of the paper's Table 4."""
    return Character(bias=random_stream.gauss(6.6, 0.7), gain=random_stream.gauss(5.0, 1.0))


@dataclass(frozen=True, kw_only=True)
class _Felt:
    """Friction coefficient felt at a place."""

    position_m: float
    friction: float


@dataclass
class VirtualParticipant:
    """Answers at once.

    It compares a trial's last touch with its first one. Where there is only one it compares its end
    with its beginning, or, if nothing changed meanwhile, with the resting beam it remembers.
    """

    control: ControlClient
    clock: Clock
    character: Character
    random_stream: random.Random
    _screen: Screen | None = field(default=None, init=False)
    _pacing_from_s: float = field(default=0.0, init=False)
    _touches: list[list[_Felt]] = field(default_factory=list, init=False)
    _resting: float | None = field(default=None, init=False)
    _contrast: float = field(default=0.0, init=False)

    def show(self, screen: Screen) -> None:
        """Take note of `screen`; a pacing cue puts the finger on the beam."""
        self._screen = screen
        if isinstance(screen, Pacing):
            self._pacing_from_s = self.clock.monotonic_s()
            self._touches.append([])
            self._feel(screen)
        elif isinstance(screen, Notice) and screen.text == "touch.end":
            self.control.lift()

    def poll(self) -> Response | None:
        """Return the answer to the last screen; while touching, move the finger on."""
        match self._screen:
            case Pacing() as pacing:
                self._feel(pacing)
                return None
            case Instruction(text="remember"):
                self._resting = self._touches[-1][-1].friction
                self._touches.clear()
                return self._given("ready")
            case Instruction() | Welcome():
                return self._given("ready")
            case AskChange(question=question):
                return self._given(self._judged(question))
            case AskScore():
                return self._given(str(self._rated()))
        return None

    def _given(self, answer: str) -> Response:
        self._screen = None
        return Response(answer=answer, reaction_time_s=round(self.random_stream.uniform(0.4, 2), 3))

    def _feel(self, pacing: Pacing) -> None:
        passed_s = self.clock.monotonic_s() - self._pacing_from_s
        fraction = min(passed_s / pacing.duration_s, 1.0)
        position_m = pacing.start_m + fraction * (pacing.end_m - pacing.start_m)
        friction = self.control.touch(pacing.force_n, position_m, pacing.direction)
        self._touches[-1].append(_Felt(position_m=position_m, friction=friction))

    def _judged(self, question: Question) -> str:
        noise = self.random_stream.gauss(0, self.character.felt_noise)
        felt = self._felt_contrast(question) + noise
        self._touches.clear()
        self._contrast = felt
        if question == "places":
            return "swapped" if felt > JUST_NOTICEABLE else "not swapped"
        more, less = {"roughness": ("smoother", "rougher"), "strength": ("stronger", "weaker")}[
            question
        ]
        if abs(felt) < JUST_NOTICEABLE:
            return "same"
        return more if felt > 0 else less

    def _felt_contrast(self, question: Question) -> float:
        """Change of log friction in the sense of `question`."""
        first, last = self._touches[0], self._touches[-1]
        if question == "places":
            return _swap(first, last)
        resting = self._resting or first[0].friction
        if question == "strength":
            return _depth(last, resting) - _depth(first, resting)
        return math.log(self._before(resting) / last[-1].friction)

    def _before(self, resting: float) -> float:
        """What the last feeling is compared with: the touch before, or how this one began."""
        first = self._touches[0]
        if len(self._touches) > 1:
            return first[-1].friction
        changed = abs(math.log(first[0].friction / first[-1].friction)) > JUST_NOTICEABLE
        return first[0].friction if changed else resting

    def _rated(self) -> int:
        character = self.character
        rating = character.bias + character.gain * self._contrast
        rating += self.random_stream.gauss(0, character.rating_noise)
        return round(min(max(rating, 0.0), 10.0))


def _depth(touch: list[_Felt], resting: float) -> float:
    """How much the friction differs from that of the resting beam, root mean square of its log."""
    logs = [math.log(felt.friction / resting) for felt in touch]
    return math.sqrt(sum(log * log for log in logs) / len(logs))


def _swap(there: list[_Felt], back: list[_Felt]) -> float:
    """Difference of log friction between two ways, place by place, root mean square."""
    returned = sorted(back, key=lambda felt: felt.position_m)
    logs = [math.log(felt.friction / _nearest(returned, felt.position_m)) for felt in there]
    return math.sqrt(sum(log * log for log in logs) / len(logs))


def _nearest(touch: list[_Felt], position_m: float) -> float:
    return min(touch, key=lambda felt: abs(felt.position_m - position_m)).friction


def swapping(control: ControlClient, body_spacing_m: Mapping[str, float]) -> Callable[[str], None]:
    """Return a function that mounts one of the study's beams on the simulated device."""
    return lambda beam: control.swap_beam(body_spacing_m[beam])
