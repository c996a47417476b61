"""A session from options to end: opens locks, window, rig, journal and people, in this order."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from device.friction.calibration import NOMINAL
from device.resonance import Resonance
from protocol.address import SIMULATED, AddressError
from protocol.errors import BadInput, WorkFailed
from protocol.journal.events import SessionOpened
from protocol.journal.records import RigCalibration, VirtualTruth
from protocol.journal.state import SessionState
from protocol.plan.plan import plan
from protocol.plan.slide_plan import slide_plan, slide_study
from protocol.pseudonyms import pseudonym
from protocol.registration.registration import Registration, locked
from protocol.study.participant_texts import Wording, lacking, study_codes, study_wording
from protocol.study.study import Study
from protocol.study_file.language_files import located
from protocol.study_file.limits import slide_problems
from protocol.study_file.loading import StudyError
from runner.clock import Clock, Pace, SteppedClock, WallClock
from runner.interfaces import AnswerSource
from runner.journal.cohort import slot_for, states
from runner.journal.location import checked_place, mounts_of_this_machine
from runner.journal.names import chain_name, chains_of, session_name
from runner.journal.opening import journal_if_used, read_journal
from runner.journal.session_log import SessionLog
from runner.journal.store import Journal, JournalError
from runner.journal.verification import touchbeam_versions
from runner.launch.confirmation import Confirm, nearly_the_same, refused
from runner.launch.device_access import SessionRig, gauge_address, session_rig
from runner.launch.locks import real_address, rig_lock, session_lock
from runner.launch.participant_screen import participants_screen
from runner.launch.participants import Say, participant_and_operator
from runner.people.participant_console import require_typist
from runner.people.terminal import said_in_background
from runner.people.untouched_beam import UntouchedBeam
from runner.session.loop import run
from runner.session.resume import require_resumable
from runner.session.session import Session, SessionContext, SessionKind, answer_order, versions
from runner.signals import Stopped
from runner.study.calibration import fitted_calibration, kept_calibration
from runner.study.check import validated_study
from runner.study.folder import StudyFolder
from runner.study.registered import registration_of, require_registered
from runner.window.client import WindowParticipant
from runner.window.messages import Settings
from runner.window.preflight import study_window

if TYPE_CHECKING:
    from device.people.person import Person
    from device.people.population import Population
    from runner.people.virtual_participant import Finger


@dataclass(frozen=True, kw_only=True)
class SessionOptions:
    """The options of `touchbeam run`, and of `touchbeam slide` if the session `slides`.

    A sliding experiment has the participant `SLIDE`.
    """

    folder: StudyFolder
    participant: str
    number: int = 1
    device: str | None = None
    ratings: AnswerSource = "window"
    pace: Pace | None = None
    rehearsal: bool = False
    language: str | None = None
    consent: str | None = None
    seed: int | None = None
    calibration: Resonance | None = None
    law: str | None = None
    rung: str | None = None
    damping: float | None = None
    people: "Population | None" = None
    screen: int | None = None
    windowed: bool = False
    extra: bool = False
    new_name: bool = False
    slides: bool = False
    touchbeam: Sequence[str] = ("touchbeam",)


def run_session(options: SessionOptions, say: Say, confirm: Confirm = refused) -> SessionState:
    """Run or resume the session given by `options`; return its final state.

    Raises:
        BadInput, StudyError, AddressError: an input is wrong; nothing was changed.
        DeviceError, JournalError, ParticipantGone, RigInUse: the work failed; it can be resumed.
    """
    request = _request(options)
    _require_meant(request, confirm)
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
    registration: Registration | None = None

    @property
    def name(self) -> str:
        """What people call the session."""
        return session_name(self.options.participant, self.options.number)

    @property
    def rehearsal(self) -> bool:
        """Whether the session is a rehearsal."""
        return self.kind == "rehearsal"

    def chain(self, journal: Journal) -> str:
        """Return the name of the session in `journal`."""
        options = self.options
        return chain_name(journal, options.participant, options.number, rehearsal=self.rehearsal)

    @property
    def seed(self) -> int:
        """The seed of all that is simulated; a registration seeds the plan alone."""
        return self.study.study.seed if self.options.seed is None else self.options.seed


def _request(options: SessionOptions) -> Request:
    """Check everything that can be checked before anything is opened or changed."""
    text = options.folder.text()
    source = str(options.folder.study_file)
    study = validated_study(text, source)
    if options.slides:
        if found := slide_problems(study):  # a study without [slide] was not asked for it
            raise StudyError(source, located(text, found))
        study = slide_study(study)
    url = options.device or study.rig.device
    request = Request(
        options=options,
        study=study,
        text=text,
        wording=_wording(study, options.language or study.session.language),
        url=url,
        pace=_pace(options, url),
        kind=_kind(options, study, url),
        registration=registration_of(options.folder.path),
    )
    if not options.slides:
        pseudonym(options.participant)
    checked_place(options.folder.path, mounts_of_this_machine())
    if options.ratings != "virtual":
        require_typist(sys.stdin)
    return request


def _pace(options: SessionOptions, url: str) -> Pace:
    """Return the requested pace, or the default for the kind of ratings.

    Raises:
        BadInput: pace, device, its law, rung or damping, people and ratings do not go together.
    """
    simulated = url == SIMULATED
    if not simulated and (options.law or options.rung or options.damping):
        raise BadInput(f"--law, --rung and --damping are for --device sim, got {url}")
    if options.people is not None and options.ratings != "virtual":
        raise BadInput(f"--people is for --ratings virtual, got {options.ratings}")
    unattended = simulated and options.ratings == "virtual"
    if options.pace == "stepped" and not unattended:
        raise BadInput(
            "--pace stepped needs --device sim and --ratings virtual (people answer in real time)"
        )
    return options.pace or ("stepped" if unattended else "wall")


def _kind(options: SessionOptions, study: Study, url: str) -> SessionKind:
    """Return the kind of the session.

    Raises:
        BadInput: the study requires a consent and none is given.
    """
    if options.rehearsal or url == SIMULATED or options.ratings == "virtual":
        return "rehearsal"
    if options.slides:
        return "slide"
    if study.session.consent_required and not options.consent:
        raise BadInput("this study requires a consent: give its reference with --consent REF")
    return "participant"


def _require_meant(request: Request, confirm: Confirm) -> None:
    """Have the operator confirm what is more often a slip than meant.

    Raises:
        BadInput: it is not confirmed, or a session is requested that the study does not plan.
    """
    options, planned = request.options, request.study.design.sessions
    if options.slides:  # a name that cannot be mistaken, and as many as anybody wants
        return
    if options.number > planned and not options.extra:
        raise BadInput(
            f"--session {options.number}: the study plans {planned} for each participant; add "
            "--extra for another one"
        )
    person = options.consent is not None or options.ratings != "virtual"
    if person and request.rehearsal and not options.rehearsal:
        why = "the device is simulated" if request.url == SIMULATED else "the ratings are virtual"
        confirm(
            f"{why}: {request.name} will be a rehearsal, which no report counts",
            "add --rehearsal if that is meant; otherwise give the device with --device",
        )
    if not options.new_name and (other := _resembling(request)):
        confirm(
            f"{options.participant} resembles {other}, who has a session here, and is taken for "
            "somebody else",
            f"give --participant {other} if that is meant, else add --new",
        )


def _resembling(request: Request) -> str | None:
    """Return another participant whose pseudonym is nearly the same, if there is one."""
    path = request.options.folder.journal
    with suppress(JournalError):  # the session's own attempt to open the journal will tell
        if path.exists():
            with read_journal(path) as journal:
                participant = request.options.participant
                return nearly_the_same(journal, participant, rehearsal=request.rehearsal)
    return None


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
    # Also of the rehearsal of that name: nobody runs both at once.
    stack.enter_context(session_lock(name, options.folder.path))
    gauge = gauge_address(request.study.force_channel, request.url)
    gauge = gauge if request.url != SIMULATED else None
    if gauge and real_address(gauge) == real_address(request.url):
        raise AddressError(
            f"force_channel.gauge must have a port of its own, got {gauge}, the device's"
        )
    for url in filter(None, (request.url, gauge)):
        stack.enter_context(rig_lock(url))
    # The window before the rig: without a window to instruct the participant nothing is driven.
    window = stack.enter_context(_window(request, say))
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
            damping=options.damping,
            force_channel=request.study.force_channel,
        )
    )
    clock: Clock = WallClock()
    if request.pace == "stepped" and rig.control is not None:
        clock = SteppedClock(clock.utc(), rig.control.advance)
    # The rig before the journal: if no device answers, no session is opened.
    journal = stack.enter_context(journal_if_used(options.folder.journal))
    chain = request.chain(journal)
    new = chain not in journal.sessions()
    earlier = touchbeam_versions(journal.events(chain))[-1:]
    session = opened_session(request, journal, clock)
    log = SessionLog(journal, chain, clock)
    if new and not request.rehearsal and chains_of(journal, options.participant, rehearsal=True):
        say(f"{options.participant} was a rehearsal before; this is the session itself.")
    if earlier and earlier[0] != (now := versions()["touchbeam"]):
        say(f"{name} was last recorded by touchbeam {earlier[0]} and continues with {now}.")
    finger = _finger(request, rig, say, lambda: context.resonance_hz)
    participant, operator = stack.enter_context(
        participant_and_operator(session, rig, clock, say, window, finger)
    )
    stack.enter_context(checkpointed(journal))
    context = SessionContext(
        session=session,
        device=rig.device,
        address=request.url,
        participant=participant,
        operator=operator,
        clock=clock,
        log=log,
        opened_now=new,
    )
    return context


def _finger(
    request: Request, rig: SessionRig, say: Say, resonance_hz: Callable[[], float]
) -> "Finger | None":
    """Return what a virtual participant feels with; None for a person or a block."""
    if request.options.ratings != "virtual" or request.options.slides:
        return None
    if rig.control is not None:
        return rig.control
    say(f"DRY RUN on {request.url}: the device is driven. Nobody may touch the beam.")
    return UntouchedBeam(request.study, lambda: rig.device.reading, resonance_hz)


def _window(request: Request, say: Say) -> AbstractContextManager[WindowParticipant | None]:
    """Return the participant's window as a context manager, which yields None without a window."""
    options = request.options
    if options.ratings != "window":
        return nullcontext()
    return study_window(
        options.touchbeam,
        request.study,
        Settings(
            wording=request.wording,
            screen=participants_screen(options.touchbeam, options.screen, say),
            windowed=options.windowed,
            folder=str(options.folder.path.resolve()),
        ),
        options.consent,
        say,
    )


def opened_session(request: Request, journal: Journal, clock: Clock) -> Session:
    """Return the session to run, and open it in the journal if it is new.

    A slot is taken by opening the session; choosing and opening must therefore not be separated.
    """
    options, registered = request.options, request.registration
    digest = None if registered is None else registered.digest
    study = request.study if digest is None else locked(request.study, digest)
    with journal.alone():
        require_registered(journal, registered, rehearsal=request.rehearsal)
        sessions, chain = states(journal), request.chain(journal)
        slot = 0 if options.slides else slot_for(sessions, options.participant, request.kind, chain)
        session = Session(
            participant=options.participant,
            number=options.number,
            kind=request.kind,
            study=study,
            study_text=request.text,
            plan=slide_plan(study, options.number)
            if options.slides
            else plan(study, slot, options.number),
            language=request.wording.code,
            answer_order=answer_order(study, slot, sessions.get(chain)),
            consent=options.consent,
            seed=request.seed,
            virtual=_virtual_truth(request, sessions.get(chain)),
            registration=digest,
            calibration=_calibration(options),
        )
        require_resumable(journal, session, sessions.get(chain), clock.utc())
        if chain not in sessions:
            SessionLog(journal, chain, clock).append(session.opening())
    return session


def _calibration(options: SessionOptions) -> RigCalibration | None:
    """Return the calibration in force; a sliding experiment, which predicts nothing, has none."""
    rig = NOMINAL if options.slides else fitted_calibration(options.folder.path)
    return RigCalibration(**vars(rig)) if rig.origin else None


def _virtual_truth(request: Request, before: SessionState | None) -> VirtualTruth | None:
    """Return the true parameters of a virtual participant; None for a person or a block.

    Those of the beam are known if it is simulated. `before` is the state of a resumed session.
    """
    options = request.options
    if options.ratings != "virtual" or options.slides:
        return None
    from device.people.population import truth_of
    from device.people.world import World
    from device.simulator.hardware.beam_and_finger import SimulatedBeam

    person = _person(request, before)
    if request.url != SIMULATED:
        return replace(truth_of(person, World()), damping_ratio=None, beam_gain=None)
    chosen = {"law": options.law, "rung": options.rung, "damping_ratio": options.damping}
    given: dict[str, Any] = {name: each for name, each in chosen.items() if each is not None}
    return truth_of(person, SimulatedBeam(request.seed, **given).world)


def _person(request: Request, before: SessionState | None) -> "Person":
    """Return a virtual participant: the same one in each of the study's sessions.

    A session is resumed by the person who began it, whom the journal describes.

    Raises:
        BadInput: `--people` describes somebody else.
    """
    from device.people.population import DEFAULT, drawn_person, person_name, person_of

    options = request.options
    name = person_name(request.seed, options.participant)
    person = drawn_person(options.people or DEFAULT, name)
    begun = before.opened if before else None
    if not isinstance(begun, SessionOpened) or begun.virtual is None:
        return person
    kept = person_of(begun.virtual)
    if options.people is not None and person != kept:
        raise BadInput(
            f"--people gives {request.name} another virtual person than began it; resume it "
            "without --people, since the journal describes that person"
        )
    return kept


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
