"""A virtual participant, who touches a beam, feels its friction, answers and scores.

It feels the friction that the simulated device really produces, through a control connection, or on
a real device a predicted one (`untouched_beam`). It knows neither the plan nor the drive. What it
is like, feels and answers is in `device.people`.
"""

import random
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol, cast

import numpy as np

from device.arrays import FloatArray
from device.drivers.driver import Reading
from device.friction.calibration import Calibration
from device.friction.changes import Moment, friction_at
from device.friction.surfaces import PAPERS
from device.people import answering
from device.people.person import People, Person, normal_quantile, uniforms
from protocol.errors import WorkFailed
from protocol.study import study_question
from protocol.study.rules import Rating
from protocol.study.study import Study
from protocol.study.track import Find
from runner import screens
from runner.clock import Clock

_SKIPPED = 0.1
"""How often a question is skipped that may be."""
_LEAST_FORCE = 0.5
"""Of a trembling finger, relative to its mean force."""
_ROUNDING = 1e-9
"""Of the time since a touch began, relative to the touch's."""


class VirtualParticipantLeft(WorkFailed):
    """A virtual participant has dropped out."""


class Finger(Protocol):
    """A finger on the beam."""

    def touch(
        self, force_n: float, position_m: float, direction: str, speed_m_s: float = 0.0
    ) -> float:
        """Put it down, moving on in `direction` at its speed; return the friction it feels."""

    def lift(self) -> None:
        """Take it off the beam."""


@dataclass
class _Touch:
    """A touch in progress: its course, and what the finger has felt of it so far."""

    control: Finger
    way: answering.Course
    tremor: Callable[[], float] | None
    _friction: list[float] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        self._parts = answering.fractions(self.way.mark)

    def go_on(self, part: float) -> None:
        """Feel what is due at this part of the touch's time, and put the finger where it is."""
        way, last = self.way, len(self._parts) - 1
        due = self._parts[
            min(len(self._friction), last) : np.searchsorted(self._parts, part, "right")
        ]
        # The last part is felt again each time, so that it is as the touch really ended.
        if due.size:
            del self._friction[last:]
            places_m, speed_m_s = way.places_m(due)[0], float(way.speed_m_s[0])
            self._friction += [self._put(float(place_m), speed_m_s) for place_m in places_m]
        # A finger that rests without trembling is there already, as hard as it should press.
        if way.mark.slides or self.tremor:
            moves = float(way.speed_factor[0]) * part < 1
            place_m = float(way.places_m(np.array([part]))[0, 0])
            self._put(place_m, float(way.speed_m_s[0]) * moves, self.tremor)

    def _put(
        self, place_m: float, speed_m_s: float, tremor: Callable[[], float] | None = None
    ) -> float:
        force_n = float(self.way.force_n[0]) * (tremor() if tremor else 1.0)
        return self.control.touch(force_n, place_m, self.way.mark.direction, speed_m_s)

    @property
    def felt(self) -> answering.Felt:
        """What was felt; a touch that was cut short felt to its end as it did last."""
        rest = [self._friction[-1]] * (len(self._parts) - len(self._friction))
        return answering.Felt(mark=self.way.mark, friction=np.array([self._friction + rest]))


@dataclass
class VirtualParticipant(screens.Participant):
    """A participant who answers at once.

    A touch for which `slips` returns True is pressed twice as hard as instructed. `name` determines
    all random numbers: see `device.people.person.session_name`. On a surface whose friction is not
    known `worth` returns the change that the running trial is to this person, NaN for none known.
    """

    control: Finger
    clock: Clock
    person: Person
    name: str
    slips: Callable[[], bool] = lambda: False
    length_m: float = PAPERS.length_m
    """Of the surface, at whose ends a finger stops."""
    worth: Callable[[], FloatArray] | None = None
    _people: People = field(init=False)
    _answering: answering.Answering = field(init=False)
    _streams: dict[str, random.Random] = field(init=False)
    _screen: screens.Screen | None = field(default=None, init=False)
    _pacing_from_s: float = field(default=0.0, init=False)
    _touches: list[_Touch] = field(default_factory=list, init=False)
    _resting: FloatArray | None = field(default=None, init=False)
    _counts: Counter[str] = field(default_factory=Counter, init=False)
    """Of touches and questions so far."""

    def __post_init__(self) -> None:
        self._people = People.of([self.person])
        self._answering = answering.Answering(self._people)
        # One for each purpose, so that a further question leaves touches and scores alone.
        purposes = ("ready", "own questions", "tremor")
        self._streams = {each: random.Random(f"{each}/{self.name}") for each in purposes}
        # Loads scipy, which may take a busy computer longer than a touch may wait for.
        normal_quantile(np.array([0.5]))

    def show(self, screen: screens.Screen) -> None:
        """Receive `screen`; a pacing cue puts the finger on the beam."""
        self._screen = screen
        if isinstance(screen, screens.Pacing):
            self._pacing_from_s = self.clock.monotonic_s()
            u = self._numbers("touches", answering.TOUCH_NUMBERS)
            way = answering.course(self._people, u, screen.mark, self.length_m)
            if self.slips():
                way = replace(way, force_n=2 * way.force_n)
            tremor = self._tremor if self.person.tremor else None
            self._touches.append(_Touch(self.control, way, tremor))
            self._touches[-1].go_on(0.0)
        elif isinstance(screen, screens.Notice) and screen.text == "touch.end":
            self.control.lift()

    def progress(self, number: int, total: int) -> None:  # noqa: ARG002 - it counts itself
        """Forget the touches of a trial that is begun anew."""
        self._touches.clear()

    def poll(self) -> screens.Response | None:
        """Return the answer to the current screen, unless it has left; while touching, go on."""
        match self._screen:
            case screens.Pacing() as pacing:
                passed_s = self.clock.monotonic_s() - self._pacing_from_s
                # Ticks that are summed up may end just before the end.
                part = passed_s / pacing.duration_s + _ROUNDING
                self._touches[-1].go_on(min(part, 1.0))
                return None
            case screens.Instruction() | screens.Welcome() as page:
                if isinstance(page, screens.Instruction) and page.text == "remember":
                    self._resting = self._taken()[-1].friction[:, -1]
                return self._respond("ready", self._seconds("ready"))
            case screens.Ask(question=question):
                return self._answer(question)
        return None

    def _answer(self, question: study_question.StudyQuestion) -> screens.Response:
        names = (each for each in study_question.QUESTIONS if each == question.name)
        if change := next(names, None):
            return self._change(change)
        asked, _, found = question.name.partition("_")
        if asked in {"which", "is"} and question.text == {}:  # no study's own question
            return self._track(question, found)
        if question.name == study_question.RATING and question.text == {}:
            return self._rating(question)
        if question.name == study_question.SCORE:
            score, seconds = self._answering.score()
            lowest, highest, _ = question.scale
            return self._respond(f"{answering.on_scale(score, lowest, highest)[0]:.0f}", seconds[0])
        stream, skips = self._streams["own questions"], not question.required
        drawn = study_question.KINDS[question.kind].drawn
        # At random but plausible.
        own = "" if skips and stream.random() < _SKIPPED else drawn(question, stream)
        return self._respond(own, self._seconds("own questions"))

    def _track(self, question: study_question.StudyQuestion, found: str) -> screens.Response:
        felt = self._taken()
        named, seconds = self._answering.track(
            self._levels(felt),
            cast(Find, found),
            self._numbers("tracks", answering.TRACK_NUMBERS),
        )
        order = ("no", "yes") if len(felt) == 1 else question.values
        return self._respond(order[int(named[0])], seconds[0])

    def _rating(self, question: study_question.StudyQuestion) -> screens.Response:
        felt, (lowest, highest, _) = self._taken(), question.scale
        score, seconds = self._answering.rate(
            self.worth() if self.worth else self._levels(felt)[:, -1],
            self._numbers("questions", answering.QUESTION_NUMBERS),
            Rating(minimum=int(lowest), maximum=int(highest)),
        )
        return self._respond(f"{score[0]:.0f}", seconds[0])

    def _levels(self, felt: Sequence[answering.Felt]) -> FloatArray:
        """Return the log friction of each touch relative to the beam at rest, (1, touches)."""
        # The output is off while a question is asked: the beam is felt at rest.
        mark = felt[-1].mark
        resting = np.array([self.control.touch(mark.force_n, mark.end_m, mark.direction)])
        self.control.lift()
        return answering.felt_level(felt, resting)

    def _taken(self) -> list[answering.Felt]:
        """Return what was felt since the last question, and forget it."""
        felt = [touch.felt for touch in self._touches]
        self._touches.clear()
        return felt

    def _numbers(self, purpose: str, width: int) -> FloatArray:
        # Numbered, so that a further question does not change what later touches are like.
        self._counts[purpose] += 1
        return uniforms(f"{purpose}/{self.name}", self._counts[purpose], width)[-1:]

    def _respond(self, answer: str, seconds: float) -> screens.Response:
        if self._answering.left[0]:
            raise VirtualParticipantLeft(f"the virtual participant {self.name} has left")
        self._screen = None
        return screens.Response(answer=answer, reaction_time_s=float(seconds))

    def _seconds(self, purpose: str) -> float:
        return round(self._streams[purpose].uniform(0.4, 2), 3)

    def _tremor(self) -> float:
        return max(1 + self._streams["tremor"].gauss(0, self.person.tremor), _LEAST_FORCE)

    def _change(self, question: study_question.Question) -> screens.Response:
        felt = self._taken()
        marks = [touch.mark for touch in felt]
        resting = felt[0].friction[:, 0] if self._resting is None else self._resting
        beyond = answering.beyond(answering.kind_of_change(question, marks), self._people)
        answer, seconds = self._answering.change(
            self.worth() if self.worth else answering.felt_contrast(question, felt, resting),
            0 * beyond if self.worth else beyond,
            np.array([study_question.QUESTIONS[question].less is not None]),
            self._numbers("questions", answering.QUESTION_NUMBERS),
        )
        return self._respond(answering.answer_of(question, int(answer[0])), seconds[0])


# A real beam that nobody touches, in a dry run: its friction is predicted from what is read back.
#
# A virtual participant on a real device cannot feel it. It gets the friction that the model
# predicts for what the device has said last about its drive, so that its answers follow what was
# driven.

_FREQUENCY_DIGITS = 4
"""Of the drive relative to the resonance: each new frequency takes the model about 50 ms."""


@dataclass
class UntouchedBeam:
    """The finger of a virtual participant on a beam that is driven, and that nobody touches.

    `reading` returns what the device has said last, and `resonance_hz` the resonance of the mounted
    beam, 0 before it is known.
    """

    study: Study
    rig: Calibration
    reading: Callable[[], Reading | None]
    resonance_hz: Callable[[], float]

    def __post_init__(self) -> None:
        finger = self.study.touch
        self._beam = finger.beam
        # Loads the model, which takes longer than a touch may wait for.
        self.touch(finger.force_n, finger.smooth_place_m, "right")

    def mount(self, beam: str) -> None:
        self._beam = beam

    def touch(
        self,
        force_n: float,
        position_m: float,
        direction: str,
        speed_m_s: float = 0.0,  # noqa: ARG002 - it slides as fast as the study says
    ) -> float:
        said, finger = self.reading(), self.study.touch
        voltage_v, frequency = 0.0, 1.0  # what is not driven feels as at rest
        if said is not None and said.output and (resonance_hz := self.resonance_hz()):
            frequency = round(said.frequency_hz / resonance_hz, _FREQUENCY_DIGITS)
            voltage_v = said.amplitude_v
        moment = Moment(
            voltage_v=voltage_v,
            frequency=frequency,
            direction="left" if direction == "left" else "right",
            coverage="local",
            force_n=force_n,
            contact_m=finger.contact_m,
            sliding_speed_m_s=finger.sliding_speed_m_s,
            has_bodies=self._beam is None or self.study.beams[self._beam] > 0,
            beam=self._beam,
        )
        return float(friction_at(moment, (position_m,), rig=self.rig)[0])

    def lift(self) -> None:
        """Do nothing: no finger is there."""


CLOSES_AFTER_S = 2.0
"""How long the last page is read."""


class Keys(screens.Participant, Protocol):
    """A window with a keyboard."""

    def press(self, answer: str, reaction_time_s: float) -> None:
        """Let `answer` be chosen and confirmed once the screen was shown for that long."""


@dataclass
class VirtualAtWindow(screens.Participant):
    """A virtual `person` who touches and answers as ever, but gives each answer in the `window`.

    The window says what was answered and when, as it does for people.
    """

    person: screens.Participant
    window: Keys
    _screen: screens.Screen | None = field(default=None, init=False)
    _meant: screens.Response | None = field(default=None, init=False)

    def show(self, screen: screens.Screen) -> None:
        """Show `screen` to the person in the window; the last one is closed when it is read."""
        # What was meant for the page before must not be compared with an answer on this one.
        self._screen, self._meant = screen, None
        self.window.show(screen)
        self.person.show(screen)
        if screens.is_last(screen):
            # Nobody is there to close the last page.
            self.window.press("ready", CLOSES_AFTER_S)

    def progress(self, number: int, total: int) -> None:
        self.window.progress(number, total)
        self.person.progress(number, total)

    def saved(self) -> None:
        self.window.saved()

    def felt(self, finger: screens.OwnFinger) -> None:
        self.window.felt(finger)

    def stops(self) -> bool:
        return self.window.stops()

    def window_state(self) -> screens.WindowState | None:
        return self.window.window_state()

    def poll(self) -> screens.Response | None:
        """Return the answer that the window took, None before it did.

        Raises `WorkFailed` if it is another answer than the person gave.
        """
        if meant := self.person.poll():
            self._meant = meant
            self.window.press(meant.answer, meant.reaction_time_s)
        # The window decides what was answered, as it does for people, so that a rehearsal tries it.
        given = self.window.poll()
        if given is not None and isinstance(self._screen, screens.Ask):
            answer, wanted = self._screen.question.answer, self._meant
            if wanted is None or answer(given.answer) != answer(wanted.answer):
                raise WorkFailed(
                    f"the participant's window took {given.answer!r}, which the virtual "
                    "participant did not answer; leave its keys alone"
                )
        return given
