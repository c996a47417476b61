"""A device, a clock and people that live in the test's own process."""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import Any, cast

from device.drivers.limits import Setpoint
from device.drivers.pace import Pace
from device.errors import DeviceError, OutputUnknown
from device.force_channel.recording import Forces, Samples
from device.resonance import Resonance
from protocol.address import SIMULATED
from protocol.journal.events import ScoresImported, SessionOpened
from protocol.journal.records import Identity, ReadBack
from protocol.plan.plan import plan
from protocol.plan.trials import Plan
from protocol.study.study import Study
from protocol.study.study_question import SCORE
from protocol.study_file.loading import parsed_study, template
from runner.journal.names import chain_name
from runner.journal.store import Journal, SessionLog
from runner.screens import (
    Ask,
    Instruction,
    OperatorView,
    OwnFinger,
    Response,
    Screen,
    Wanted,
    Welcome,
    WindowState,
)
from runner.session.session import Session, SessionContext, SessionKind


@dataclass
class FakeClock:
    """Time that passes only by `sleep`."""

    passed_s: float = 0.0

    def utc(self) -> datetime:
        return datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=self.passed_s)

    def monotonic_s(self) -> float:
        return self.passed_s

    def sleep(self, seconds: float) -> None:
        self.passed_s += seconds


@dataclass
class FakeDevice:
    """Records its calls; the call named in `fails` fails. One that is `deaf` stays at 0 V."""

    fails: str = ""
    on: bool = False
    has_watchdog: bool = False
    has_guardian: bool = False
    pace: Pace | None = None
    measures_resonance: bool = True
    trips: bool = True
    idn: str = "fake"
    deaf: bool = False
    calls: list[str] = field(default_factory=list)
    looked: int = 0
    driven: list[Setpoint] = field(default_factory=list)
    rate_hz: int = 0

    def _called(self, name: str) -> None:
        self.calls.append(name)
        if name == self.fails:
            raise DeviceError(f"{name} failed")

    def arm(self) -> Identity:
        self._called("arm")
        return Identity(idn=self.idn, boot=1, device_time_s=0.0)

    def watchdog_trips(self, meanwhile: Callable[[], None]) -> bool:
        self._called("watchdog_trips")
        self.on = True
        meanwhile()
        self.on = False
        return self.trips

    def resonance(self, near_hz: float, sleep: Callable[[float], None]) -> Resonance:
        self._called("resonance")
        self.on = True
        sleep(0.1)
        self.on = False
        return Resonance(frequency_hz=1.01 * near_hz, tip_m_per_v=1e-8)

    def drive(self, setpoint: Setpoint) -> ReadBack:
        self._called("drive")
        self.on = True
        self.driven.append(setpoint)
        return self.read_back()

    def read_back(self) -> ReadBack:
        self.looked += 1
        last = self.driven[-1]
        return ReadBack(
            output=self.on,
            voltage_v=0.0 if self.deaf else last.voltage_v,
            frequency_hz=last.frequency_hz,
            monitor_v=last.voltage_v,
            force_n=0.5,
            position_m=0.04,
            device_time_s=1.0,
        )

    def record(self, rate_hz: int, clock_s: Callable[[], float] | None = None) -> None:
        self._called("record")
        self.rate_hz = rate_hz

    def recorded(self) -> Samples:
        self._called("recorded")
        rate_hz, self.rate_hz = self.rate_hz, 0
        return Samples(
            source="board",
            rate_hz=rate_hz,
            first_s=1.0,
            scale=(2.5e-4, 2.5e-4, 5e-6),
            counts=array("h", [800] * 10 + [2000] * 10 + [8000] * 10).tobytes(),
            saturated=0,
            clock_offset_s=-1.0,
            clock_error_s=1e-3,
        )

    @property
    def forces(self) -> Forces | None:
        if not self.rate_hz:
            return None
        return Forces(at_s=1.0, tangential_n=0.2, normal_n=0.5, position_m=0.04)

    def off(self) -> None:
        self.calls.append("off")
        if self.fails == "off":
            raise OutputUnknown("no answer")
        self.on = False

    def emergency_stop(self) -> None:
        self.calls.append("emergency stop")
        self.on = False

    def beat(self) -> None:
        self._called("beat")


@dataclass
class FakeParticipant:
    """Gives `changes` in turn and `answers` by the name of the question; remembers the screens."""

    changes: Iterable[str] = ()
    score: str = "7"
    answers: Mapping[str, str] = field(default_factory=dict)
    shown: list[Screen] = field(default_factory=list)
    stops_at: str = ""
    fingers: list[tuple[Screen, OwnFinger]] = field(default_factory=list)
    """What was shown of the finger, each with the screen on which it was."""
    states: list[WindowState] = field(default_factory=list)
    """What is said of the window, one at a time."""

    def show(self, screen: Screen) -> None:
        self.shown.append(screen)
        if self.stops_at and self.stops_at in str(screen):
            raise KeyboardInterrupt("Ctrl-C")

    def progress(self, number: int, total: int) -> None:
        pass

    def felt(self, finger: OwnFinger) -> None:
        self.fingers.append((self.shown[-1], finger))

    def saved(self) -> None:
        pass

    def stops(self) -> bool:
        return False

    def window_state(self) -> WindowState | None:
        return self.states.pop(0) if self.states else None

    def poll(self) -> Response | None:
        match self.shown[-1]:
            case Instruction() | Welcome():
                return Response(answer="ready", reaction_time_s=0.5)
            case Ask(question=question) if question.name in self.answers:
                return Response(answer=self.answers[question.name], reaction_time_s=1.5)
            case Ask(question=question) if question.name != SCORE:
                answer = next(iter(self.changes), question.values[0])
                return Response(answer=answer, reaction_time_s=1.0)
            case Ask(question=question):
                return Response(answer=self.score, reaction_time_s=2.0)
        return None


@dataclass
class FakeOperator:
    """Answers at once; asserts that beams are swapped only while the output is off.

    Gives `orders` in turn, each when the session is in the state it is paired with.
    """

    device: FakeDevice
    orders: list[tuple[str, Any]] = field(default_factory=list)
    mounts: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)
    answers: list[str] = field(default_factory=list)
    seen: list[OperatorView] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)
    pages: list[str] = field(default_factory=list)

    def mount(self, beam: str) -> None:
        assert not self.device.on, "the output must be off while a beam is swapped"
        self.mounts.append(beam)

    def confirm(self, text: str) -> None:
        assert not self.device.on
        self.asked.append(text)

    def ask(self, text: str) -> None:
        self.asked.append(text)

    def answered(self) -> str | None:
        return self.answers.pop(0) if self.answers else ""

    def withdraw_question(self) -> None:
        self.asked.append("")

    def order(self) -> Wanted | None:
        if self.orders and self.seen and self.seen[-1].state == self.orders[0][0]:
            return cast(Wanted, self.orders.pop(0)[1])
        return None

    def page(self, name: str, *, typed: bool = False) -> None:
        self.pages.append(name)

    def window(self, state: WindowState) -> None:
        self.notices.append(str(state))

    def recall(self, messages: Sequence[tuple[str, str]]) -> None:
        pass

    def show(self, view: OperatorView) -> None:
        self.seen.append(view)

    def notify(self, text: str) -> None:
        self.notices.append(text)

    def pausing(self, wanted: bool) -> None:
        self.notices.append("pausing" if wanted else "not pausing")


@cache
def _planned(text: str) -> tuple[Study, Plan]:
    study = parsed_study(text)
    return study, plan(study, slot=0)


def context(
    journal: Journal,
    device: FakeDevice,
    participant: FakeParticipant,
    text: str = template("paper"),
    operator: FakeOperator | None = None,
    *,
    kind: SessionKind = "participant",
    address: str = SIMULATED,
) -> SessionContext:
    """Return the context of session P01/1 of the study `text`; open it in `journal` if new."""
    clock = FakeClock()
    log = SessionLog(journal, chain_name(journal, "P01", 1, rehearsal=kind == "rehearsal"), clock)
    if log.state.opened:
        clock.passed_s = 3600.0
    study, made = _planned(text)
    session = Session(
        participant="P01", number=1, kind=kind, study=study, study_text=text, plan=made
    )
    new = log.state.name == "new"
    if new:
        log.append(session.recorded_as(SessionOpened))
    return SessionContext(
        session=session,
        device=device,
        address=address,
        participant=participant,
        operator=operator or FakeOperator(device),
        clock=clock,
        log=log,
        opened_now=new,
    )


IMPORTED = ScoresImported(
    participant="1",
    session=1,
    conditions=("a",),
    scores={"a": 1.0},
    source="table.csv",
    source_sha256="x",
)
"""The first event of a subject of a published table."""
