"""From options to a session that runs: who sits down, on which rig, at which pace."""

import random
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from typing import Literal

from device.resonance import Resonance
from protocol.errors import BadInput
from protocol.journal.state import SessionState
from protocol.plan.plan import plan
from protocol.study.study import Language, Study
from protocol.study.texts import study_texts
from runner.clock import Clock, SteppedClock, WallClock
from runner.journal.cohort import slot_for, states
from runner.journal.location import checked_place, mounts_of_this_machine
from runner.journal.session_log import SessionLog
from runner.journal.store import Journal, JournalError, journal_if_used, session_name
from runner.launch.locks import rig_lock, session_lock
from runner.launch.rig import SIMULATED, SessionRig, kept_calibration, session_rig
from runner.people.operator_console import LiveDisplay, OperatorConsole, PlainDisplay
from runner.people.participant_console import ConsoleParticipant, TypedLines, require_typist
from runner.people.terminal import at_terminal, terminal_keys
from runner.people.virtual_participant import VirtualParticipant, drawn_character, swapping
from runner.ports import Operator, Participant
from runner.session.loop import run
from runner.session.resume import require_resumable
from runner.session.session import Session, SessionContext, SessionKind
from runner.signals import Stopped
from runner.study.check import validated_study
from runner.study.folder import StudyFolder, pseudonym
from runner.window.client import WindowParticipant
from runner.window.preflight import study_window

Ratings = Literal["window", "console", "virtual"]
Pace = Literal["wall", "stepped"]
Say = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """Everything that was asked for on the command line."""

    folder: StudyFolder
    participant: str
    number: int = 1
    device: str | None = None
    ratings: Ratings = "window"
    pace: Pace | None = None
    rehearsal: bool = False
    language: Language = "en"
    consent: str | None = None
    seed: int | None = None
    calibration: Resonance | None = None
    screen: int = 0
    windowed: bool = False
    touchbeam: Sequence[str] = ("touchbeam",)


def run_session(options: SessionOptions, say: Say) -> SessionState:
    """Carry out, or take up again, the session that `options` asks for; return its end.

    Raises:
        BadInput, StudyError, AddressError: something given is wrong; nothing was changed.
        DeviceError, JournalError, ParticipantGone, RigInUse: the work failed; it can be resumed.
    """
    text = options.folder.text()
    study = validated_study(text, str(options.folder.study_file))
    url = options.device or study.rig.device
    pace = _checked_pace(options, url)
    kind = _checked_kind(options, study, url)
    name = session_name(pseudonym(options.participant), options.number)
    checked_place(options.folder.path, mounts_of_this_machine())
    if options.ratings != "virtual":
        require_typist(sys.stdin)
    with ExitStack() as stack:
        told_of = stack.enter_context(_complete_at_last())
        place = options.folder.path.resolve()
        stack.enter_context(session_lock(name, place, name))
        stack.enter_context(rig_lock(url, f"{name} of {place}"))
        window = stack.enter_context(_window(options, study))
        seed = _seed(options, study)
        calibration = options.calibration or kept_calibration(options.folder.path)
        rig = stack.enter_context(session_rig(url, study.rig, options.touchbeam, seed, calibration))
        clock = _clock(pace, rig)
        journal = stack.enter_context(journal_if_used(options.folder.journal))
        new = name not in journal.sessions()
        session = _session(options, study, text, journal, kind, clock)
        log = SessionLog(journal, name, clock)
        participant, operator = stack.enter_context(
            _people(options, session, rig, clock, say, window)
        )
        stack.enter_context(_checkpointed(journal))
        told_of.append(log.state)
        run(
            SessionContext(
                session=session,
                device=rig.device,
                participant=participant,
                operator=operator,
                clock=clock,
                log=log,
                opened_now=new,
            )
        )
        return log.state


@contextmanager
def _complete_at_last() -> Iterator[list[SessionState]]:
    """Tell a stop that comes after the last answer what it is: nothing is left to go on with.

    The session's state is to be put into what is yielded.
    """
    told_of: list[SessionState] = []
    try:
        yield told_of
    except Stopped as stop:
        if any(state.name == "completed" for state in told_of):
            stop.add_note("output off, read back; the session is complete")
        raise


@contextmanager
def _checkpointed(journal: Journal) -> Iterator[None]:
    """Bring everything into the one file at last; what ended the session is told all the same."""
    try:
        yield
    except BaseException:
        with suppress(JournalError):
            journal.checkpoint()
        raise
    journal.checkpoint()


def _window(
    options: SessionOptions, study: Study
) -> AbstractContextManager[WindowParticipant | None]:
    """The participant's window, if there is to be one."""
    if options.ratings != "window":
        return nullcontext()
    return study_window(
        options.touchbeam,
        study,
        options.language,
        options.consent,
        screen=options.screen,
        windowed=options.windowed,
    )


def _checked_pace(options: SessionOptions, url: str) -> Pace:
    """The pace asked for, or the one that fits; virtual ratings need a beam they can feel."""
    simulated = url == SIMULATED
    if options.ratings == "virtual" and not simulated:
        raise BadInput(f"--ratings virtual feels the simulated device only, got --device {url}")
    if options.pace == "stepped" and not (simulated and options.ratings == "virtual"):
        raise BadInput(
            "--pace stepped needs --device sim and --ratings virtual: a person takes time"
        )
    return options.pace or ("stepped" if options.ratings == "virtual" else "wall")


def _checked_kind(options: SessionOptions, study: Study, url: str) -> SessionKind:
    """What the session is; one with a participant may need a consent."""
    if options.rehearsal or url == SIMULATED or options.ratings == "virtual":
        return "rehearsal"
    if study.session.consent_required and not options.consent:
        raise BadInput("this study asks for a consent: give its reference with --consent")
    return "participant"


def _seed(options: SessionOptions, study: Study) -> int:
    return study.study.seed if options.seed is None else options.seed


def _clock(pace: Pace, rig: SessionRig) -> Clock:
    if pace == "wall" or rig.control is None:
        return WallClock()
    return SteppedClock(WallClock().utc(), rig.control.advance)


def _session(
    options: SessionOptions,
    study: Study,
    text: str,
    journal: Journal,
    kind: SessionKind,
    clock: Clock,
) -> Session:
    """The session as it was opened, or as it is to be opened now.

    A slot counts as taken from the moment the session is opened, so both happen at once.
    """
    name = session_name(options.participant, options.number)
    with journal.alone():
        sessions = states(journal)
        session = Session(
            participant=options.participant,
            number=options.number,
            kind=kind,
            study=study,
            study_text=text,
            plan=plan(study, slot_for(sessions, options.participant, kind), options.number),
            language=options.language,
            consent=options.consent,
            seed=_seed(options, study),
        )
        require_resumable(journal, session, sessions.get(name), clock.utc())
        if name not in sessions:
            SessionLog(journal, name, clock).append(session.opening())
    return session


@contextmanager
def _people(
    options: SessionOptions,
    session: Session,
    rig: SessionRig,
    clock: Clock,
    say: Say,
    window: WindowParticipant | None,
) -> Iterator[tuple[Participant, Operator]]:
    swap = swapping(rig.control, session.study.beams) if rig.control else lambda _: None
    if options.ratings == "virtual":
        assert rig.control is not None
        stream = random.Random(f"virtual/{session.seed}/{session.participant}/{session.number}")
        virtual = VirtualParticipant(
            control=rig.control,
            clock=clock,
            character=drawn_character(stream),
            random_stream=stream,
        )
        with _console(quiet=isinstance(clock, SteppedClock), say=say) as (typed, display):
            yield virtual, OperatorConsole(typed, display, swap, alone=True)
        return
    if window is not None:
        with _operator(say, swap) as operator:
            window.call_operator = operator.called
            yield window, operator
        return
    lines = TypedLines(sys.stdin)
    texts = study_texts(session.study, session.language)
    participant = ConsoleParticipant(lines, say, session.language, texts)
    yield participant, _by_lines(lines, say, swap)


def _by_lines(lines: TypedLines, say: Say, swap: Callable[[str], None]) -> OperatorConsole:
    """An operator who types lines, or a file or program that does."""
    return OperatorConsole(
        lines.operator_typed, PlainDisplay(say), swap, lines.forget, piped=not lines.at_terminal
    )


@contextmanager
def _operator(say: Say, swap: Callable[[str], None]) -> Iterator[OperatorConsole]:
    """An operator who has the terminal to themselves; in a pipe, lines serve as well as keys."""
    if not at_terminal(sys.stdin, sys.stdout):
        yield _by_lines(TypedLines(sys.stdin), say, swap)
        return
    with _console(quiet=False, say=say) as (typed, display):
        yield OperatorConsole(typed, display, swap)


@contextmanager
def _console(
    *, quiet: bool, say: Say
) -> Iterator[tuple[Callable[[bool], str], LiveDisplay | PlainDisplay]]:
    """The operator's keys and display: live on a terminal, plain lines elsewhere."""
    if quiet or not at_terminal(sys.stdin, sys.stdout):
        yield lambda _: "", PlainDisplay((lambda _: None) if quiet else say)
        return
    with terminal_keys() as typed, LiveDisplay() as display:
        yield typed, display
