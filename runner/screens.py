"""The participant's screens and responses, and the operator's view and orders.

No screen reveals to the participant what the device does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol

from device.errors import UNKNOWN
from protocol.journal.records import ReadBack
from protocol.study import study_question
from protocol.study.participant_texts import touch_text
from protocol.study.rig_settings import Rig
from protocol.study.rules import Band, Rating
from protocol.study.study import Study
from protocol.study.surface import NO_PICTURE, Support
from protocol.study.touch import Direction, Mark, Touch, TouchDefaults, mark_of

if TYPE_CHECKING:
    from device.drivers.limits import Setpoint
    from device.drivers.pace import Pace
    from device.force_channel.recording import Forces, Samples
    from device.resonance import Resonance
    from protocol.journal.records import Identity

Order = Literal["pause", "stop", "repeat", "emergency stop"]


@dataclass(frozen=True, kw_only=True)
class Notice:
    """A text that needs no answer."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Welcome:
    """The first screen, with the reference of the signed consent; answered with `ready`."""

    consent: str | None = None


@dataclass(frozen=True, kw_only=True)
class ShownSurface:
    """How the surface is shown; by default as the paper's beam.

    Attributes:
        supports: of the left and the right end, None where nothing is known of them.
        picture: a file in the study's folder, shown in place of a bar; `none`: nothing is drawn.
        picture_shape: width of the picture over its height.
        path_in_picture: where `path_m` begins and ends in the picture, as parts of its width and
            height from its upper left corner; None if nothing is marked in it.
    """

    length_m: float = 0.1
    supports: tuple[Support, Support] | None = ("clamped", "free")
    picture: str | None = None
    picture_shape: float = 1.0
    path_m: tuple[float, float] = (0.0, 0.1)
    path_in_picture: tuple[tuple[float, float], tuple[float, float]] | None = None

    @property
    def is_marked(self) -> bool:
        """Whether pages show where to touch; else their words alone say it."""
        return self.picture is None or self.path_in_picture is not None

    def text(self, key: str, texts: Mapping[str, str]) -> str:
        """Return the text of `key`; where nothing is marked, one that speaks of no mark."""
        return texts[key] if self.is_marked else texts.get(f"{key}.unmarked", texts[key])


PAPERS_BEAM = ShownSurface()


def shown_surface(study: Study, folder: Path | None) -> ShownSurface:
    """Return how the surface of a study in `folder` is shown.

    Without a folder its picture counts as square, which moves marks but no text.
    """
    surface, path_m = study.surface, study.touch.path_m
    if surface.kind == "beam":
        supports = surface.supports or PAPERS_BEAM.supports
        length_m = surface.length_m or PAPERS_BEAM.length_m
        return ShownSurface(length_m=length_m, supports=supports, path_m=path_m)
    assert surface.length_m is not None, "a surface of this kind has a length"
    picture = surface.picture
    is_file = folder is not None and picture not in {None, NO_PICTURE}
    return ShownSurface(
        length_m=surface.length_m,
        supports=None,
        picture=picture,
        picture_shape=_shape(folder / str(picture)) if folder and is_file else 1.0,
        path_m=path_m,
        path_in_picture=surface.path_in_picture,
    )


def _shape(picture: Path) -> float:
    from PIL import Image

    with Image.open(picture, formats=("PNG", "JPEG")) as image:
        return image.width / image.height


@dataclass(frozen=True, kw_only=True)
class FingerPath:
    """The finger's path along the surface; start and end are equal if it does not slide.

    `interval` says which touch of several in a trial it is, from 1; 0 where participants are not
    told.
    """

    surface: ShownSurface = PAPERS_BEAM
    start_m: float
    end_m: float
    harder: bool = False
    several: bool = False
    interval: int = 0


@dataclass(frozen=True, kw_only=True)
class Instruction:
    """What to do next, with the finger's path if it is a touch; answered with `ready`.

    The answer counts once `after_s` have passed: the shortest time of a break.
    A page of the study's own may have a `picture`, a file in the study's folder.
    """

    text: str
    touch: FingerPath | None = None
    picture: str | None = None
    after_s: float = 0.0


@dataclass(frozen=True, kw_only=True)
class LeadIn(FingerPath):
    """The touch to make in `seconds`: the finger is put on the start of its path and waits."""

    text: str
    seconds: float
    countdown: bool


@dataclass(frozen=True, kw_only=True)
class Pacing(FingerPath):
    """The touch to make now, as `text` says: the finger's path, to be followed in `duration_s`."""

    text: str = "touch.now"
    duration_s: float
    force_n: float
    direction: Direction

    @property
    def mark(self) -> Mark:
        """The mark alone, which a virtual finger follows."""
        return Mark(**{entry.name: getattr(self, entry.name) for entry in fields(Mark)})

    @property
    def touch(self) -> FingerPath:
        """The path that the instruction for this touch showed."""
        return FingerPath(**{entry.name: getattr(self, entry.name) for entry in fields(FingerPath)})


@dataclass(frozen=True, kw_only=True)
class OwnFinger:
    """The participant's finger as just measured, shown during a touch.

    `force` is relative to the instructed one, and should differ from 1 by `within` at most.
    """

    position_m: float
    force: float
    within: float


@dataclass(frozen=True, kw_only=True)
class Ask:
    """A question; answered with a text that `StudyQuestion.answer` accepts.

    `bands` name ranges of a scale of scores; `letters` are those that the language's keyboard has
    beside those from a to z.
    """

    question: study_question.StudyQuestion
    bands: tuple[Band, ...] = ()
    letters: str = ""


def ask_change(question: study_question.Question) -> Ask:
    return Ask(question=study_question.change_question(question))


def ask_track(found: str, intervals: int) -> Ask:
    """Return the question of a track: which of its touches it was, or whether it was so."""
    return Ask(question=study_question.track_question(found, intervals))


def ask_score(rating: Rating) -> Ask:
    """Return the question how strong the change is."""
    return Ask(question=study_question.score_question(rating), bands=rating.bands)


def ask_rating(rating: Rating) -> Ask:
    """Return the question how strong what was felt is, without any about a change."""
    question = study_question.score_question(rating, study_question.RATING)
    return Ask(question=question, bands=rating.bands)


Screen = Notice | Welcome | Instruction | LeadIn | Pacing | Ask


def is_last(screen: Screen) -> bool:
    """Return whether no screen follows: the window shows it for a while and can then be closed."""
    return isinstance(screen, Notice) and screen.text in {"thanks", "stopped"}


@dataclass(frozen=True, kw_only=True)
class Response:
    """An answer: `ready`, or the answer to a question as text.

    `trace` records how it was given (marks, changes, frames) if the screen can measure that.
    """

    answer: str
    reaction_time_s: float
    trace: Mapping[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class WindowState:
    """Whether keys reach the participant's window, and whether it is shown, not minimised."""

    has_keys: bool
    is_shown: bool

    def __str__(self) -> str:
        if not self.is_shown:
            return "the participant's window is minimised"
        return f"keys {'' if self.has_keys else 'do not '}go to the participant's window"


@dataclass(frozen=True, kw_only=True)
class PlanLine:
    """A trial of the plan, as the operator sees it; `answer` is None until it is answered."""

    label: str
    answer: str | None = None
    running: bool = False


@dataclass(frozen=True, kw_only=True)
class Aim:
    """What the running touch leads to: the drive at its end, and the finger's path and force."""

    voltage_v: float
    frequency_hz: float
    path_m: tuple[float, float]
    force_n: float
    force_range_n: tuple[float, float]


PlanUnit = Literal["trial", "pass"]


def said_of(unit: PlanUnit, text: str) -> str:
    """Return what `text` says of trials, said of `unit`.

    >>> said_of("pass", "2 of 7 trials, and this trial")
    '2 of 7 passes, and this pass'
    """
    return text if unit == "trial" else text.replace("trials", "passes").replace("trial", unit)


@dataclass(frozen=True, kw_only=True)
class OperatorView:
    """The session's progress and the device's last read-back.

    `kept_by` says what turns the output off when it hears nothing of this program. `device` is None
    if the output has been read back as off, if it is `unknown`, or while the session is idle and
    the device has not been asked yet. `busy` says what the output is on for while no participant
    touches the beam. `aim` is None unless a touch is in progress. While the operator is `blind`,
    labels and answers say nothing, and figures of the drive are not shown. `records` says that
    touches are recorded; `zero_n` are the forces of the untouched beam. The lines of the plan are
    each a trial, or a `pass` of a block. `track` says where the running track stands, empty between
    its trials; it is None in a study without any, and while blind.
    """

    session: str
    kind: str
    state: str
    plan: tuple[PlanLine, ...]
    left_s: float
    device: ReadBack | None
    rig: Rig
    kept_by: Literal["watchdog", "guardian", ""]
    busy: str = ""
    warning: str = ""
    aim: Aim | None = None
    identity: str = ""
    resonance_hz: float = 0.0
    beam: str | None = None
    unknown: bool = False
    blind: bool = False
    records: bool = False
    zero_n: tuple[float, float] = (0.0, 0.0)
    unit: PlanUnit = "trial"
    track: str | None = None

    @property
    def trial(self) -> str:
        """The running trial, empty between trials."""
        return next((line.label for line in self.plan if line.running), "")

    @property
    def next_trial(self) -> str:
        """The trial after the running one, empty at the end."""
        ahead = (line for line in self.plan if line.answer is None and not line.running)
        return next((line.label for line in ahead), "")

    @property
    def place(self) -> str:
        """The session, what happens in it, and the running trial, in words."""
        phase = said_of(self.unit, _PHASES.get(self.state, self.state))
        return f"{self.session} {phase}" + (f": {self.trial}" if self.trial else "")

    def progress(self) -> str:
        """Return the progress in words, such as `3 of 7 trials, about 2 min left`."""
        done = sum(line.answer is not None for line in self.plan)
        minutes = round(self.left_s / 60)
        left = f"about {minutes} min left" if minutes else "less than 1 min left"
        shown = said_of(self.unit, f"{done} of {len(self.plan)} trials")
        return shown + (f", {left}" if self.left_s > 0 else "")

    def output(self) -> str:
        if self.unknown:
            # Before all else: what the device said before does not count any more.
            return UNKNOWN.removeprefix("output ")
        if self.busy:
            return f"ON, {self.busy}"
        if self.device is None and self.state == "idle":
            # Before it is armed nobody has asked the device, so that "off" would be a guess.
            return "not known yet"
        if self.device is None or not self.device.output:
            return "off"
        if self.blind:
            return "ON, as commanded"
        device = self.device
        return f"ON {device.voltage_v:.0f} V {device.frequency_hz:.0f} Hz" + (
            "" if device.monitor_v is None else f" (monitor {device.monitor_v:.0f} V)"
        )


_PHASES = {
    "idle": "getting ready",
    "armed": "between trials",
    "trial": "in a trial",
    "touching": "touching",
    "completed": "complete",
}
"""What a state of a session is called in the laboratory."""


def pacing(
    touch: Touch, finger: TouchDefaults, interval: int = 0, surface: ShownSurface = PAPERS_BEAM
) -> Pacing:
    """Return the cue for `touch`: a place to hold, or a slide at the study's speed."""
    return Pacing(
        text=touch_text(touch),
        several=touch.coverage == "full",
        interval=interval,
        surface=surface,
        **vars(mark_of(touch, finger)),
    )


def lead_in(cue: Pacing, finger: TouchDefaults) -> LeadIn:
    """Return the screen before `cue`, the same whatever the device does meanwhile."""
    seconds, countdown = finger.lead_in_s, finger.countdown
    return LeadIn(**vars(cue.touch), text=cue.text, seconds=seconds, countdown=countdown)


@dataclass(frozen=True, kw_only=True)
class Note:
    """A note by the operator."""

    text: str


@dataclass(frozen=True, kw_only=True)
class Correction:
    """Another answer of the operator's to a question of the desk, with the reason if given."""

    name: str
    answer: str
    note: str = ""


Wanted = Order | Note | Correction
"""What an operator may order."""


def page_name(screen: Screen, *, blind: bool) -> str:
    """Return what the operator reads of the participant's page; if `blind`, nothing of a trial."""
    match screen:
        case Ask(question=question):
            return "a question" if blind else f"question {question.name}"
        case Instruction(touch=None, text=text) | Notice(text=text):
            return text.partition(".")[0] if blind else text
        case Welcome():
            return "welcome"
    return "a touch"


# The interfaces of a session: device, participant, operator; each real or simulated.

AnswerSource = Literal["window", "console", "virtual"]
"""Where the participant answers, if it is one."""


class Device(Protocol):
    """The device under the finger. Every method raises `DeviceError` if it cannot be trusted."""

    def arm(self) -> Identity:
        """Turn the output off, identify the device, set limits and watchdog."""

    @property
    def has_watchdog(self) -> bool:
        """Whether the device turns its output off by itself when it hears nothing."""

    @property
    def pace(self) -> Pace | None:
        """How fast the device is, as measured when it was armed; None before."""

    @property
    def has_guardian(self) -> bool:
        """Whether a process of its own turns the output off when this program is silent."""

    def watchdog_trips(self, meanwhile: Callable[[], None]) -> bool:
        """Return whether it does so, tried with the output on at 0 V; leave the output off.

        `meanwhile` is called again and again; an error that it raises stops the test.
        """

    @property
    def measures_resonance(self) -> bool:
        """Whether `resonance` drives the beam; else it is the one kept as the rig's calibration."""

    def resonance(self, near_hz: float, sleep: Callable[[float], None]) -> Resonance:
        """Find the resonance of the untouched beam near `near_hz`; leave the output off."""

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Apply `setpoint`, switch the output on, and read it back."""

    def read_back(self) -> ReadBack:
        """Read the drive and the sensors."""

    def record(self, rate_hz: int, clock_s: Callable[[], float] | None = None) -> None:
        """Record the force channel from now on; raises `CannotRecord` if the device has none.

        `clock_s` is the session's clock, to which that of the samples is related.
        """

    def recorded(self) -> Samples:
        """Stop recording, and return everything since `record`."""

    @property
    def forces(self) -> Forces | None:
        """The newest forces; None while nothing is recorded."""

    def off(self) -> None:
        """Turn the output off and read it back; raises `OutputUnknown` if that fails."""

    def emergency_stop(self) -> None:
        """Turn the output off at once, even if the port is busy; refuse every later drive."""

    def beat(self) -> None:
        """Keep the watchdog fed; raise the device's failure, if there was one."""


class Participant(Protocol):
    """The person who touches the beam and answers, or a simulation. No method blocks.

    Who inherits from this needs none of `saved`, `felt`, `stops` and `window_state`.
    """

    def show(self, screen: Screen) -> None:
        """Show `screen` to the participant."""

    def progress(self, number: int, total: int) -> None:
        """Tell the participant that the `number`-th of `total` trials comes next."""

    def saved(self) -> None:
        """Tell the participant that the journal has the answer to the current screen."""
        return

    def felt(self, finger: OwnFinger) -> None:  # noqa: ARG002 - some draw nothing
        """Show the participant their own finger during a touch."""
        return

    def poll(self) -> Response | None:
        """Return the answer to the current screen, None before it is given."""

    def stops(self) -> bool:
        """Return whether the emergency stop was pressed where the participant answers."""
        return False

    def window_state(self) -> WindowState | None:
        """Return the state of the participant's window; None before it is known, or without one."""
        return None


class Operator(Protocol):
    """The person who supervises the rig and the session. No method blocks."""

    def ask(self, text: str) -> None:
        """Ask a question, such as the state of the skin."""

    def answered(self) -> str | None:
        """Return the answer, which may be empty; None before it is given."""

    def withdraw_question(self) -> None:
        """Withdraw the open question, if there is one."""

    def mount(self, beam: str) -> None:
        """Ask the operator to mount `beam`; the answer confirms it."""

    def confirm(self, text: str) -> None:
        """Ask the operator to do what `text` says; the answer confirms it."""

    def order(self) -> Wanted | None:
        """Return the operator's next order, None if there is none."""

    def page(self, name: str, *, typed: bool = False) -> None:
        """Show that the participant is on another page from now on.

        While an answer to it is `typed`, no letter is an order: the participant may type it here.
        """

    def window(self, state: WindowState) -> None:
        """Show where the keyboard's keys go."""

    def recall(self, messages: Sequence[tuple[str, str]]) -> None:
        """Show what was told before the session was interrupted, with the times of day."""

    def show(self, view: OperatorView) -> None:
        """Show the session's progress."""

    def notify(self, text: str) -> None:
        """Show the result of an order."""

    def pausing(self, wanted: bool) -> None:
        """Show whether the session pauses before the next trial."""
