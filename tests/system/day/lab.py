"""The laboratory: a rig, a study on a disk, and the processes that people start in it."""

import io
import json
import math
import random
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, redirect_stdout
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from unittest.mock import patch

from device.drivers.driver import driver_of
from device.drivers.limits import Setpoint
from device.errors import DeviceError
from device.link.codec import encoded
from device.link.link import Link
from device.link.port import Port, advice
from device.resonance import Resonance
from device.rig import Rig
from device.simulator.in_process import InProcessDevice
from device.study_limits import device_limits
from protocol.errors import BadInput
from protocol.study.participant_texts import study_wording
from protocol.study.study import Study
from protocol.study.study_question import QUESTIONS
from protocol.study.touch import Touch
from runner import signals
from runner.clock import Clock
from runner.journal.names import session_name
from runner.journal.opening import journal_if_used, open_journal
from runner.journal.store import SessionLog
from runner.launch.device_access import simulated_surface
from runner.launch.locks import session_lock
from runner.launch.request import Request, SessionOptions
from runner.launch.run_session import checkpointed, opened_session
from runner.people.operator_console import OperatorConsole, PlainDisplay
from runner.session.loop import run
from runner.session.session import SessionContext
from runner.signals import signals_raise
from runner.study.calibration import keep_calibration, kept_calibration
from runner.study.check import validated_study
from runner.study.folder import StudyFolder
from tests.device.in_process_clock import InProcessClock
from tests.protocol.surfaces import friction_csv
from tests.system.day.disk import Disk
from tests.system.day.guardian import LabGuardian
from tests.system.day.invariants import require
from tests.system.day.people import Person, Typist
from tests.system.day.process import Dead, Process
from tests.system.day.watch import TELLS, Watch
from touchbeam.cli.output import complaint

MORNING = datetime(2026, 1, 5, 8, tzinfo=UTC)
PORT = "COM1"
SEARCHED_POINTS = 5
"""Of the search for the resonance, twice; 21 find it more exactly, but take most of a day."""
DRIPS_S = 120.0
"""How long a device that was mended may still drip what it was asked before."""
_STILL_STEP_S = 0.02
LONGEST_S = 3600.0
"""Of a session; one that takes longer does not end."""


@cache
def checked_study(text: str) -> Study:
    """Return the study in `text`; checking it takes longer than anything else here."""
    return validated_study(text, "study.toml")


_version = cache(version)
"""Each session asks for it, and it is read from a file."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """How a process ended: its last line and exit code, or that it was killed."""

    line: str
    code: int | None
    process: Process

    @property
    def killed(self) -> bool:
        """Whether it was killed."""
        return self.code is None


@dataclass
class LabPort:
    """A process's end of the line; what is sent just before its death may arrive or not."""

    port: Port
    process: Process
    seen: Callable[[bytes], None]
    """Called with all that passes."""

    def receive(self, timeout_s: float) -> bytes:
        self.process.crossing("port")
        data = self.port.receive(timeout_s)
        if data:
            self.seen(data)
        return data

    def send(self, data: bytes) -> None:
        self.process.crossing("port")
        self.seen(data)
        self.port.send(data)
        self.process.crossing("port")

    def close(self) -> None:
        if self.process.alive:
            self.port.close()


@dataclass
class LabClock:
    """A process's clock."""

    clock: Clock
    process: Process
    ends_s: float

    def utc(self) -> datetime:
        return self.clock.utc()

    def monotonic_s(self) -> float:
        return self.clock.monotonic_s()

    def sleep(self, seconds: float) -> None:
        self.process.crossing("clock")
        self.clock.sleep(seconds)
        self.process.crossing("clock")
        require(11, self.monotonic_s() < self.ends_s, "a session that does not end")


class Lab:
    """One rig, one study, one disk."""

    def __init__(self, folder: Path, text: str, stream: random.Random, model: str) -> None:
        self.stream = stream
        self.model = model
        """Of the device."""
        self.folder = StudyFolder(path=folder)
        (folder / "friction.csv").write_text(friction_csv(), encoding="utf-8")
        self.write(text)
        late_s = stream.choice((0.001, 0.003, 0.02))
        if model != "board":  # many questions, and touches that end late do not count
            late_s = min(late_s, 0.003)
        self.device = InProcessDevice(
            seed=stream.randrange(1000),
            dialect=model,
            delay_s=lambda: late_s * stream.uniform(0.2, 1.0),
            cuts=lambda length: (stream.randrange(length),) if stream.random() < 0.1 else (),
            rung="mode",  # nothing here depends on the friction that is felt
            **simulated_surface(folder),
        )
        self.watch = Watch(self.device, checked_study(self.text))
        self.watch.late_s = late_s
        self.device.on_step = self.watch.look
        if not self.watch.is_board:
            found = Resonance(frequency_hz=self.watch.rig.nominal_resonance_hz, tip_m_per_v=1e-7)
            keep_calibration(folder, found, model, MORNING.isoformat())
        self.disk = Disk(self.folder.journal, stream, self._stored)
        self.touches: dict[str, list[str]] = {}
        """What the journal was given of the touches of each session."""
        self.person: Person | None = None
        self.typist: Typist | None = None
        self.rig: Rig | None = None
        self.guardian: LabGuardian | None = None
        self._block: int | None = None
        """Of the last trial that this process has begun."""
        self._unwarned = ""
        """The session whose operator has to be told of a touch before its next event."""
        self.answers: dict[tuple[str, int], tuple[str | None, int | None]] = {}
        """The change and the score that each trial was answered with, by session and index."""
        self.record: list[tuple[float, object]] = []
        """All data on the line, events, lines to people and ends of processes, with their times."""

    def write(self, text: str) -> None:
        """Write the study file."""
        self.written = text
        self.folder.study_file.write_text(text, encoding="utf-8")
        self.text = self.folder.text()

    @contextmanager
    def entered(self) -> Iterator[None]:
        """Let every clock, file and random number in the body be one of this laboratory."""
        salts = random.Random(0).randbytes
        with (
            self.disk.installed(),
            patch("touchbeam.cli.journal.WallClock", lambda: _Calendar(self.device)),
            patch("touchbeam.cli.study.WallClock", lambda: _Calendar(self.device)),
            patch("runner.journal.opening.open_journal", partial(open_journal, random_bytes=salts)),
            patch("device.resonance._POINTS", SEARCHED_POINTS),
            patch("runner.session.session.version", _version),
            patch("runner.launch.locks.COMMON", self.folder.path),
        ):
            yield

    def session(self, participant: str, number: int, process: Process) -> Outcome:
        """Run `touchbeam run` and return how it ended."""
        return self._ended(process, lambda: self._run(participant, number, process))

    def command(self, work: Callable[[], None]) -> Outcome:
        """Run another command, in a process of its own."""
        process, running = Process(), self.disk.process
        printed = io.StringIO()

        def printing() -> str:
            with redirect_stdout(printed):
                work()
            return printed.getvalue().strip()

        self.disk.process = process
        try:
            # What a process knows of its signals is its own; the session's may have to wait.
            with patch.object(signals, "_stop", signals._stop):
                return self._told(printing, process)
        finally:
            self.disk.process = running

    def tried(self) -> None:
        """Try the rig as a technician does: what exceeds a limit is refused, and nothing is sent.

        The watchdog of a board is tried too.
        """
        rig = self.opened()
        limits = self.watch.rig
        rig.arm()
        for _ in range(4):
            setpoint, fits = self._setpoint()
            self.watch.touch = Touch.model_construct(
                place="smooth", voltage_v=setpoint.voltage_v, frequency=1.0
            )
            self.watch.resonance_hz = setpoint.frequency_hz
            before = self.watch.drive_set()
            try:
                rig.drive(setpoint)
            except BadInput:
                require(4, not fits, f"refused: {setpoint}")
                require(4, self.watch.drive_set() == before, f"refused, but sent: {setpoint}")
            else:
                require(4, fits, f"not refused: {setpoint}, {limits}")
            rig.off()
        if rig.has_watchdog:
            require(3, rig.watchdog_trips(), "the trial of the watchdog")
        rig.drive(Setpoint(voltage_v=0.0, frequency_hz=1.0, ramp_v_per_s=1.0))
        rig.close()
        self.watch.touch = None

    def opened(self) -> Rig:
        """Open the device for nobody's session; nothing happens to it meanwhile."""
        return self._opened(checked_study(self.text), Process())

    def _setpoint(self) -> tuple[Setpoint, bool]:
        """Return a drive at the edge of the limits, or beyond, and whether it is within them."""
        rig, choice = self.watch.rig, self.stream.choice
        most_v = rig.max_voltage_v
        volts, v_fits = choice(((0.0, True), (most_v, True), (most_v / 2, True),
                                (most_v * 1.0001, False), (-1.0, False)))  # fmt: skip
        hertz, f_fits = choice(((1.0, True), (rig.max_frequency_hz, True), (24_000.0, True),
                                (rig.max_frequency_hz + 1, False), (0.9, False)))  # fmt: skip
        ramp, r_fits = choice(((0.001, True), (rig.ramp_v_per_s, True), (1.0, True),
                                (rig.ramp_v_per_s * 1.001, False), (0.0009, False)))  # fmt: skip
        slew = 2e-6 * math.pi * hertz * volts
        fits = v_fits and f_fits and r_fits and slew <= rig.max_slew_v_per_us
        return Setpoint(voltage_v=volts, frequency_hz=hertz, ramp_v_per_s=ramp), fits

    def repair(self) -> None:
        """Repair the device, and cut the amplifier for a while; wait until slow answers are out."""
        dripped = "slow-drip" in self.watch.faults_s
        self.watch.repair()
        if self.device.inside.instrument.output_v > 0:
            self.device.reset()
        if dripped:
            self.device.advance(DRIPS_S)

    def _ended(self, process: Process, work: Callable[[], str]) -> Outcome:
        self.disk.process, self._unwarned, self._block = process, "", None
        self.disk.may_crash = process.will_die
        broken_before = set(self.watch.faults_s)
        try:
            outcome = self._told(work, process)
            self._require_way_on(outcome)
            self._require_cause(outcome, broken_before)
            excused = {"disk full", "disk error", "locked", "stopped"}
            self.watch.polled &= not excused & set(process.happened)
            self.watch.said(outcome.line, last=True)
        except Dead:
            outcome = Outcome(line="", code=None, process=process)
            if self.guardian is not None:
                self.guardian.close()
            if self.disk.open:
                self.disk.crash()
        self.disk.unlock()
        if outcome.code == 0 and not {"disk full", "disk error", "locked"} & set(process.happened):
            journal = self.folder.journal
            files = [path.name for path in journal.parent.glob(f"{journal.name}*")]
            require(12, files == [journal.name], f"nobody uses the journal, but there are {files}")
        self.disk.process = Process()
        self.watch.alone()
        if not outcome.killed:
            self.watch.forget(killed=False)
        self.device.advance(2 * self.watch.rig.watchdog_s)
        self.disk.checked()  # may find the end of a touch whose process died as it stored it
        self._unwarned = ""
        self.watch.forget(killed=outcome.killed)
        require(12, not self.disk.open, "a connection to the journal is open")
        self.watch.armed = False
        return outcome

    def _require_way_on(self, outcome: Outcome) -> None:
        """A session that is broken off once it was armed says how to go on."""
        disk = {"disk full", "disk error", "locked"} & set(outcome.process.happened)
        if self.watch.armed and not disk and outcome.code not in {0, 2}:
            told = "run the same command again" in outcome.line or "UNKNOWN" in outcome.line
            require(11, told, f"not told how to go on: {outcome.line}")

    def _require_cause(self, outcome: Outcome, broken_before: set[str]) -> None:
        """A session that one fault alone has ended says which."""
        broken = set(self.watch.faults_s) | broken_before
        alone = set(outcome.process.happened) <= {"broken", *broken} and self.watch.is_board
        if alone and len(broken) == 1 and outcome.code == 1:
            cause = TELLS.get(broken.pop(), "")
            require(11, re.search(cause, outcome.line), f"not told {cause!r}: {outcome.line}")

    def _told(self, work: Callable[[], str], process: Process) -> Outcome:
        try:
            with signals_raise():
                line, code = work(), 0
        except Exception as error:
            line, code = complaint(error)
        self._record((line, code))
        require(11, not line.startswith("internal error"), line)
        require(8, "does not allow the event" not in line, line)
        return Outcome(line=line, code=code, process=process)

    def _run(self, participant: str, number: int, process: Process) -> str:
        study, name = checked_study(self.text), session_name(participant, number)
        request = Request(
            options=SessionOptions(folder=self.folder, participant=participant, number=number),
            study=study,
            text=self.text,
            wording=study_wording(study, "en"),
            url=PORT,
            pace="wall",
            kind="participant",
        )
        with ExitStack() as stack:
            stack.enter_context(session_lock(name, self.folder.path))
            rig = self.rig = self._opened(study, process)
            stack.callback(rig.close)
            clock = LabClock(
                InProcessClock(MORNING, self.device, rig), process, self.device.now_s() + LONGEST_S
            )
            journal = stack.enter_context(journal_if_used(self.folder.journal))
            new = name not in journal.sessions()
            session = opened_session(request, journal, clock)
            log = SessionLog(journal, name, clock)
            self.person = Person(self.stream, self.device, process, self._hang)
            self.typist = Typist(self.stream, self.device.now_s, process)
            operator = OperatorConsole(
                self.typist,
                PlainDisplay(lambda line: self._said(line, process)),
                lambda beam: self.device.swap_beam(study.beams[beam]),
            )
            stack.enter_context(checkpointed(journal))
            context = SessionContext(
                session=session,
                device=rig,
                participant=self.person,
                operator=operator,
                clock=clock,
                log=log,
                opened_now=new,
            )
            self.watch.begin()
            run(context)
            answered = len(log.state.answered)
            require(11, log.state.name == "completed", f"{name} ended, but is {log.state.name}")
        return f"{name} is complete: {answered} trials answered, device off (read back)."

    def _opened(self, study: Study, process: Process) -> Rig:
        process.crossing("port")
        try:
            line = self.device.port()
        except OSError as error:
            raise DeviceError(f"{PORT}: {advice(error)}") from error
        port = LabPort(line, process, self._record)
        limits, now_s = device_limits(study.rig), self.device.now_s
        driver = driver_of(study.rig.dialect)(Link(port, now_s), limits, now_s)
        if self.watch.has_guardian:
            off = encoded("") + encoded(driver.off_command)
            self.guardian = LabGuardian(self.device, line, off, limits.watchdog_s)
        calibration = kept_calibration(self.folder.path)
        return Rig(driver, limits, calibration, now_s, guardian=self.guardian)

    def _record(self, what: object) -> None:
        self.record.append((self.device.now_s(), what))

    def _stored(self, session: str, tag: str, payload: str) -> None:
        self._record((session, tag, payload))
        self.watch.stored(session, tag, payload)
        self._forget_renewed(session, tag, payload)
        if tag == "trial-aborted" and '"why": "stopped by SIG' in payload:
            self._unwarned = ""  # a signal may come before the warning; the touch is made again
        untold = f"nobody was told that a touch of {session} was not as instructed"
        require(11, session != self._unwarned, untold)
        if tag == "touch-ended":
            self.touches.setdefault(session, []).append(payload)
        if tag == "touch-ended" and False in json.loads(payload)["judged"].values():
            self._unwarned = session
        if tag == "trial-started":
            self._require_copied(session, json.loads(payload)["index"])
        if tag == "paused" and self.typist is not None:
            self.typist.continues_s = self.device.now_s() + self.stream.uniform(0, 1)
        if tag == "answered" and self.person is not None:
            answer = json.loads(payload)
            change, score = answer["change"], answer["score"]
            self._require_asked(session, answer["index"], change, score)
            own = [each["answer"] for each in answer.get("questions", ())]
            said = [str(each) for each in (change, score, *own) if each is not None]
            given = [text for text, _ in self.person.given]
            require(2, said == given, f"{session} {answer['index']}: stored {said}, said {given}")
            self.answers[session, answer["index"]] = (change, score)

    def _require_asked(
        self, session: str, index: int, change: str | None, score: int | None
    ) -> None:
        """A trial asks for a change, and for a score, where the study does; for no other."""
        trial, rule = self.watch.planned[session][index], self.watch.study.rating.score_when
        scored = trial.condition is not None
        if scored and trial.question is not None:
            noticed = change not in {question.same for question in QUESTIONS.values()}
            scored = trial.kind != "catch" and (
                rule == "always" or (noticed if rule == "noticed" else change == trial.expected)
            )
        asked = trial.question is not None or trial.kind == "track"
        holds = (change is not None, score is not None) == (asked, scored)
        require(9, holds, f"{session} {index} ({trial.kind}): {change} with the score {score}")

    def _forget_renewed(self, session: str, tag: str, payload: str) -> None:
        """Practice that is begun again no longer has the answers that were given."""
        again = json.loads(payload)["indices"] if tag == "practice-renewed" else ()
        for index in again:
            self.answers.pop((session, index), None)

    def _require_copied(self, session: str, index: int) -> None:
        """A block that is over is in the journal's file itself, and not in its log alone."""
        before, self._block = self._block, self.watch.planned[session][index].block
        undisturbed = not {"disk full", "disk error", "locked"} & set(self.disk.process.happened)
        if undisturbed and before not in {None, self._block}:
            alone, all_of_it = (
                self.disk.answers(session, "&immutable=1"),
                self.disk.answers(session),
            )
            require(
                1, alone == all_of_it, f"{session}: the file has {alone} of {all_of_it} answers"
            )

    def _said(self, line: str, process: Process) -> None:
        process.crossing("people")
        self._record(line)
        self.watch.said(line)
        if "did not follow the instruction" in line:
            self._unwarned = ""

    def stand_still(self, seconds: float) -> None:
        """Let nothing of the process run, as when it is stopped or the computer sleeps."""
        self.watch.stands_still(seconds)
        for _ in range(round(seconds / _STILL_STEP_S)):
            self.device.advance(_STILL_STEP_S)
            if self.guardian is not None:
                self.guardian.look()
            self.watch.look()
        self.watch.hanging_from_s = float("inf")

    def _hang(self, seconds: float) -> None:
        """Let the session's thread do nothing, while the owner of the port works on."""
        assert self.rig is not None
        self.watch.hanging_from_s = self.device.now_s()
        InProcessClock(MORNING, self.device, self.rig).sleep(seconds)
        self.watch.hanging_from_s = float("inf")


class _Calendar(InProcessClock):
    """The clock of a process that has no rig."""

    def __init__(self, device: InProcessDevice) -> None:
        self._start, self._device = MORNING, device
