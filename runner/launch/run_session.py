"""A session from options to end: opens locks, window, rig, journal and people, in this order."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass

from device.resonance import Resonance
from protocol.address import SIMULATED
from protocol.errors import BadInput, WorkFailed
from protocol.journal.records import VirtualTruth
from protocol.journal.state import SessionState
from protocol.plan.plan import plan
from protocol.pseudonyms import pseudonym
from protocol.study.participant_texts import Wording, lacking, study_codes, study_wording
from protocol.study.study import Study
from runner.clock import Clock, Pace, SteppedClock, WallClock
from runner.interfaces import AnswerSource
from runner.journal.cohort import slot_for, states
from runner.journal.location import checked_place, mounts_of_this_machine
from runner.journal.opening import journal_if_used
from runner.journal.session_log import SessionLog
from runner.journal.store import Journal, JournalError, session_name
from runner.journal.verification import touchbeam_versions
from runner.launch.device_access import kept_calibration, session_rig
from runner.launch.locks import rig_lock, session_lock
from runner.launch.participants import Say, participant_and_operator
from runner.people.participant_console import require_typist
from runner.people.terminal import said_in_background
from runner.people.virtual_participant import drawn_person
from runner.session.loop import run
from runner.session.resume import require_resumable
from runner.session.session import Session, SessionContext, SessionKind, versions
from runner.signals import Stopped
from runner.study.check import validated_study
from runner.study.folder import StudyFolder
from runner.window.client import WindowParticipant
from runner.window.preflight import study_window


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """The options of `touchbeam run`."""

    folder: StudyFolder
    participant: str
    number: int = 1
    device: str | None = None
    ratings: AnswerSource = "window"
    pace: Pace | None = None
    rehearsal: bool = False
    language: str = "en"
    consent: str | None = None
    seed: int | None = None
    calibration: Resonance | None = None
    law: str | None = None
    rung: str | None = None
    screen: int = 0
    windowed: bool = False
    touchbeam: Sequence[str] = ("touchbeam",)


def run_session(options: SessionOptions, say: Say) -> SessionState:
    """Run or resume the session given by `options`; return its final state.

    Raises:
        BadInput, StudyError, AddressError: an input is wrong; nothing was changed.
        DeviceError, JournalError, ParticipantGone, RigInUse: the work failed; it can be resumed.
    """
    request = _request(options)
    context: SessionContext | None = None
    try:
        with ExitStack() as stack:
            say = stack.enter_context(said_in_background(say))
            context = _context(request, say, stack)
            run(context)
            return context.log.state
    except (WorkFailed, BadInput) as error:
        # Note that the session was already complete when it was stopped: nothing is left to resume.
        completed = context is not None and context.log.state.name == "completed"
        if isinstance(error, Stopped) and completed:
            error.add_note("output off, read back; the session is complete")
        if request.kind == "rehearsal":
            error.add_note("this run is a rehearsal")
        raise


@dataclass(frozen=True, kw_only=True)
class Request:
    """The options, checked against the study and this machine."""

    options: SessionOptions
    study: Study
    text: str
    wording: Wording
    url: str
    pace: Pace
    kind: SessionKind

    @property
    def name(self) -> str:
        """The session in the journal."""
        return session_name(self.options.participant, self.options.number)

    @property
    def seed(self) -> int:
        """The seed of all that is simulated."""
        return self.study.study.seed if self.options.seed is None else self.options.seed


def _request(options: SessionOptions) -> Request:
    """Check everything that can be checked before anything is opened or changed."""
    text = options.folder.text()
    study = validated_study(text, str(options.folder.study_file))
    url = options.device or study.rig.device
    request = Request(
        options=options,
        study=study,
        text=text,
        wording=_wording(study, options.language),
        url=url,
        pace=_pace(options, url),
        kind=_kind(options, study, url),
    )
    pseudonym(options.participant)
    checked_place(options.folder.path, mounts_of_this_machine())
    if options.ratings != "virtual":
        require_typist(sys.stdin)
    return request


def _pace(options: SessionOptions, url: str) -> Pace:
    """Return the requested pace, or the default for the kind of ratings.

    Raises:
        BadInput: pace, device, its law or rung, and ratings do not go together.
    """
    simulated = url == SIMULATED
    if not simulated and (options.law or options.rung):
        raise BadInput(f"--law and --rung are for --device sim, got {url}")
    if options.ratings == "virtual" and not simulated:
        raise BadInput(f"--ratings virtual needs --device sim, got {url}")
    if options.pace == "stepped" and not (simulated and options.ratings == "virtual"):
        raise BadInput(
            "--pace stepped needs --device sim and --ratings virtual (people answer in real time)"
        )
    return options.pace or ("stepped" if options.ratings == "virtual" else "wall")


def _kind(options: SessionOptions, study: Study, url: str) -> SessionKind:
    """Return the kind of the session.

    Raises:
        BadInput: the study requires a consent and none is given.
    """
    if options.rehearsal or url == SIMULATED or options.ratings == "virtual":
        return "rehearsal"
    if study.session.consent_required and not options.consent:
        raise BadInput("this study requires a consent: give its reference with --consent REF")
    return "participant"


def _wording(study: Study, code: str) -> Wording:
    """Return what the participant reads in the language asked for, if nothing of it is lacking."""
    if code not in study_codes(study):
        raise BadInput(f"--language must be one of {', '.join(study_codes(study))}, got {code!r}")
    for text in lacking(study, code):
        raise BadInput(f"--language {code}: this study lacks {text} in it")
    return study_wording(study, code)


def _context(request: Request, say: Say, stack: ExitStack) -> SessionContext:
    """Open everything that the session needs.

    `stack` closes it in reverse order: first the device, then the window, which stays open until
    the participant has read the last page; the locks are released after both.
    """
    options, name = request.options, request.name
    stack.enter_context(session_lock(name, options.folder.path))
    stack.enter_context(rig_lock(request.url))
    # The window before the rig: without a window to instruct the participant nothing is driven.
    window = stack.enter_context(_window(request))
    calibration = options.calibration or kept_calibration(options.folder.path)
    rig = stack.enter_context(
        session_rig(
            request.url,
            request.study.rig,
            options.touchbeam,
            request.seed,
            calibration,
            law=options.law,
            rung=options.rung,
        )
    )
    clock: Clock = WallClock()
    if request.pace == "stepped" and rig.control is not None:
        clock = SteppedClock(clock.utc(), rig.control.advance)
    # The rig before the journal: if no device answers, no session is opened.
    journal = stack.enter_context(journal_if_used(options.folder.journal))
    new = name not in journal.sessions()
    earlier = touchbeam_versions(journal.events(name))[-1:]
    if other := nearly_the_same(journal, options.participant):
        say(f"warning: {options.participant} is taken for another participant than {other}")
    session = opened_session(request, journal, clock)
    log = SessionLog(journal, name, clock)
    if earlier and earlier[0] != (now := versions()["touchbeam"]):
        say(f"{name} was last recorded by touchbeam {earlier[0]} and continues with {now}.")
    virtual = options.ratings == "virtual"
    participant, operator = stack.enter_context(
        participant_and_operator(session, rig, clock, say, window, virtual=virtual)
    )
    stack.enter_context(checkpointed(journal))
    return SessionContext(
        session=session,
        device=rig.device,
        address=request.url,
        participant=participant,
        operator=operator,
        clock=clock,
        log=log,
        opened_now=new,
    )


def nearly_the_same(journal: Journal, participant: str) -> str | None:
    """Return a participant of the study whose pseudonym differs only in capitals, if any."""
    known = (name.rpartition("/")[0] for name in journal.sessions())
    alike = (other for other in known if other.casefold() == participant.casefold())
    return next((other for other in alike if other != participant), None)


def _window(request: Request) -> AbstractContextManager[WindowParticipant | None]:
    """Return the participant's window as a context manager, which yields None without a window."""
    options = request.options
    if options.ratings != "window":
        return nullcontext()
    return study_window(
        options.touchbeam,
        request.study,
        request.wording,
        options.consent,
        screen=options.screen,
        windowed=options.windowed,
    )


def opened_session(request: Request, journal: Journal, clock: Clock) -> Session:
    """Return the session to run, and open it in the journal if it is new.

    A slot is taken by opening the session; choosing and opening must therefore not be separated.
    """
    options, name = request.options, request.name
    with journal.alone():
        sessions = states(journal)
        slot = slot_for(sessions, options.participant, request.kind)
        session = Session(
            participant=options.participant,
            number=options.number,
            kind=request.kind,
            study=request.study,
            study_text=request.text,
            plan=plan(request.study, slot, options.number),
            language=options.language,
            consent=options.consent,
            seed=request.seed,
            virtual=_virtual_truth(request),
        )
        require_resumable(journal, session, sessions.get(name), clock.utc())
        if name not in sessions:
            SessionLog(journal, name, clock).append(session.opening())
    return session


def _virtual_truth(request: Request) -> VirtualTruth | None:
    """Return the true parameters of a virtual participant; None for a person."""
    if request.options.ratings != "virtual":
        return None
    from device.friction.contrasts import LAW, RUNG

    options = request.options
    character, _ = drawn_person(request.seed, options.participant, options.number)
    return VirtualTruth(**vars(character), law=options.law or LAW, rung=options.rung or RUNG)


@contextmanager
def checkpointed(journal: Journal) -> Iterator[None]:
    """Checkpoint the journal after the body; an error of the body takes precedence."""
    try:
        yield
    except BaseException:
        with suppress(JournalError):
            journal.checkpoint()
        raise
    journal.checkpoint()
