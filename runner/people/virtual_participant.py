"""A virtual participant, who touches a beam, feels its friction, answers and rates.

It feels the friction that the simulated device really produces, through a control connection, or on
a real device a predicted one (`untouched_beam`). It knows neither the plan nor the drive.
"""

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from device.simulator.client import BeamControl
from protocol.study.questions import ANSWERS, QUESTIONS, Question
from protocol.study.rating import PAPERS_SCALE
from protocol.study.study_question import BETWEEN, SCORE, StudyQuestion
from runner.clock import Clock
from runner.people.virtual_hand import Hand
from runner.screens import (
    Ask,
    Instruction,
    Notice,
    OwnFinger,
    Pacing,
    Response,
    Screen,
    Welcome,
)

_SKIPPED, _CHOSEN = 0.1, 0.4
"""How often a question is skipped that may be, and how often one of several labels is chosen."""
_REMARKS = ("nothing", "quite smooth", "rough at first", "hard to tell")
_SLIGHT = 0.01
"""Change of log friction within a touch below which the touch counts as constant."""


@dataclass(frozen=True, kw_only=True)
class Character:
    """Parameters of a virtual participant: score = bias + gain · |felt contrast| + noise.

    On the paper's scale, whatever the study's. A felt contrast (with noise of SD `felt_noise`)
    below `criterion` is answered as no change.
    """

    bias: float
    gain: float
    felt_noise: float = 0.01
    criterion: float = 0.018
    rating_noise: float = 0.8


def drawn_character(random_stream: random.Random) -> Character:
    """Return a character from a population like the nine people of the paper's Table 4.

    The criteria give false alarms on 5 to 10% of catch trials.
    """
    return Character(
        bias=random_stream.gauss(6.6, 0.7),
        gain=random_stream.gauss(5.0, 1.0),
        criterion=random_stream.uniform(0.0165, 0.0195),
    )


def drawn_person(seed: int, participant: str, session: int) -> tuple[Character, random.Random]:
    """Return the character of a session's virtual participant, and the stream of its answers."""
    stream = random.Random(f"virtual/{seed}/{participant}/{session}")
    return drawn_character(stream), stream


class Finger(Protocol):
    """A finger on the beam."""

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        """Put it down, moving on in `direction`; return the friction coefficient it feels."""
        ...

    def lift(self) -> None:
        """Take it off the beam."""
        ...


@dataclass(frozen=True, kw_only=True)
class _Felt:
    """Friction coefficient felt at a position."""

    position_m: float
    friction: float


@dataclass
class VirtualParticipant:
    """A participant who answers at once.

    It compares the last touch of a trial with the first. If there is only one touch, it compares
    the end with the beginning, or, if they feel the same, with the remembered beam at rest. A
    touch for which `slips` returns True is pressed twice as hard as instructed.

    With a `hand` its finger moves smoothly, as that hand does, trembling by `tremor_stream`.
    Without one it jumps along with the mark, exactly as instructed.
    """

    control: Finger
    clock: Clock
    character: Character
    random_stream: random.Random
    slips: Callable[[], bool] = lambda: False
    questions_stream: random.Random = field(default_factory=lambda: random.Random(1))
    hand: Hand | None = None
    tremor_stream: random.Random = field(default_factory=lambda: random.Random(1))
    _screen: Screen | None = field(default=None, init=False)
    _pacing_from_s: float = field(default=0.0, init=False)
    _touches: list[list[_Felt]] = field(default_factory=list, init=False)
    _resting: float | None = field(default=None, init=False)
    _contrast: float = field(default=0.0, init=False)
    _presses: float = field(default=1.0, init=False)

    def show(self, screen: Screen) -> None:
        """Receive `screen`; a pacing cue puts the finger on the beam."""
        self._screen = screen
        if isinstance(screen, Pacing):
            self._pacing_from_s = self.clock.monotonic_s()
            self._touches.append([])
            self._presses = 2.0 if self.slips() else 1.0
            self._feel(screen)
        elif isinstance(screen, Notice) and screen.text == "touch.end":
            self.control.lift()
        elif isinstance(screen, Notice) and screen.text.startswith("again."):
            self._touches.clear()

    def progress(self, number: int, total: int) -> None:
        """Do nothing, because a virtual participant needs no encouragement."""

    def felt(self, finger: OwnFinger) -> None:
        """A virtual finger needs no picture of itself."""

    def saved(self) -> None:
        """Do nothing, because a virtual participant needs no confirmation."""

    def poll(self) -> Response | None:
        """Return the answer to the current screen; while touching, move the finger."""
        match self._screen:
            case Pacing() as pacing:
                self._feel(pacing)
                return None
            case Instruction(text="remember"):
                self._resting = self._touches[-1][-1].friction
                self._touches.clear()
                return self._respond("ready")
            case Instruction() | Welcome():
                return self._respond("ready")
            case Ask(question=question) if question.name in {*QUESTIONS, SCORE}:
                return self._respond(self._answer(question))
            case Ask(question=question):
                return self._respond(self._own(question), self.questions_stream)
        return None

    def _answer(self, question: StudyQuestion) -> str:
        for change in QUESTIONS:
            if question.name == change:
                return self._change(change)
        return str(self._score(question))

    def _own(self, question: StudyQuestion) -> str:
        """Return an answer to a question of the study's own, at random but plausible."""
        stream = self.questions_stream
        if not question.required and stream.random() < _SKIPPED:
            return ""
        match question.kind:
            case "choice":
                return stream.choice(question.values)
            case "several":
                chosen = [value for value in question.values if stream.random() < _CHOSEN]
                return BETWEEN.join(chosen or [stream.choice(question.values)])
            case "number":
                low, high, decimals = _range(question)
                return f"{stream.uniform(low, high):.{decimals}f}"
            case "text":
                return stream.choice(_REMARKS)[: question.longest]
        # Most people avoid the ends of a scale.
        return str(question.place(round(stream.betavariate(2, 2) * question.places)))

    def _respond(self, answer: str, stream: random.Random | None = None) -> Response:
        self._screen = None
        seconds = (stream or self.random_stream).uniform(0.4, 2)
        return Response(answer=answer, reaction_time_s=round(seconds, 3))

    def _feel(self, pacing: Pacing) -> None:
        passed_s = self.clock.monotonic_s() - self._pacing_from_s
        force_n = pacing.force_n * self._presses
        if self.hand is None:
            fraction = min(passed_s / pacing.duration_s, 1.0)
            position_m = pacing.start_m + fraction * (pacing.end_m - pacing.start_m)
            friction = self.control.touch(force_n, position_m, pacing.direction)
        else:
            position_m, speed_m_s = self.hand.place_m(pacing, passed_s)
            trembles = max(1 + self.tremor_stream.gauss(0, self.hand.tremor), 0.5)
            force_n *= self.hand.force_factor * trembles
            friction = self.control.touch(force_n, position_m, pacing.direction, speed_m_s)
        self._touches[-1].append(_Felt(position_m=position_m, friction=friction))

    def _change(self, question: Question) -> str:
        noise = self.random_stream.gauss(0, self.character.felt_noise)
        felt = self._felt_contrast(question) + noise
        self._touches.clear()
        self._contrast = felt
        more, *less, same = ANSWERS[question]
        if abs(felt) < self.character.criterion:
            return same
        return more if felt > 0 else (*less, same)[0]

    def _felt_contrast(self, question: Question) -> float:
        """Return the change of log friction that `question` asks about."""
        first, last = self._touches[0], self._touches[-1]
        effect = QUESTIONS[question].effect
        if effect == "places":
            return _swap(first, last)
        resting = self._resting or first[0].friction
        if effect == "depth":
            return _depth(last, resting) - _depth(first, resting)
        return math.log(self._before(resting) / last[-1].friction)

    def _before(self, resting: float) -> float:
        """Return the friction to compare the last touch with."""
        first = self._touches[0]
        if len(self._touches) > 1:
            return first[-1].friction
        changed = abs(math.log(first[0].friction / first[-1].friction)) > _SLIGHT
        return first[0].friction if changed else resting

    def _score(self, question: StudyQuestion) -> int:
        """Return the score of the size of the change, as far between the ends of this scale."""
        character = self.character
        score = character.bias + character.gain * abs(self._contrast)
        score += self.random_stream.gauss(0, character.rating_noise)
        above = min(max(score, PAPERS_SCALE.minimum), PAPERS_SCALE.maximum) - PAPERS_SCALE.minimum
        lowest, highest, _ = question.scale
        return round(lowest + above * ((highest - lowest) / PAPERS_SCALE.span))


def _range(question: StudyQuestion) -> tuple[float, float, int]:
    """Return between which ends, and with how many decimals, a number is drawn."""
    low, high, decimals = question.minimum, question.maximum, question.decimals or 0
    if low is None:
        low = 20.0 if high is None else high - 50.0
    high = low + 50.0 if high is None else high
    steps = 10**decimals
    return math.ceil(low * steps) / steps, math.floor(high * steps) / steps, decimals


def _depth(touch: list[_Felt], resting: float) -> float:
    """Return the root mean square of the log friction relative to the beam at rest."""
    logs = [math.log(felt.friction / resting) for felt in touch]
    return math.sqrt(sum(log * log for log in logs) / len(logs))


def _swap(there: list[_Felt], back: list[_Felt]) -> float:
    """Return the root mean square difference of log friction between two slides, by position."""
    returned = sorted(back, key=lambda felt: felt.position_m)
    logs = [math.log(felt.friction / _nearest(returned, felt.position_m)) for felt in there]
    return math.sqrt(sum(log * log for log in logs) / len(logs))


def _nearest(touch: list[_Felt], position_m: float) -> float:
    return min(touch, key=lambda felt: abs(felt.position_m - position_m)).friction


def swapping(control: BeamControl, body_spacing_m: Mapping[str, float]) -> Callable[[str], None]:
    """Return a function that mounts one of the study's beams, by name, on the simulated device."""
    return lambda beam: control.swap_beam(body_spacing_m[beam])
