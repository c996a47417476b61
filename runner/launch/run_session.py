"""A session from options to end: opens locks, window, rig, journal and people, in this order."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from typing import TYPE_CHECKING

from device.resonance import Resonance
from device.simulator.client import Friction
from protocol.address import SIMULATED, AddressError
from protocol.errors import BadInput, WorkFailed
from protocol.journal.state import SessionState
from runner.clock import Clock, SteppedClock, WallClock
from runner.journal.names import chains_of
from runner.journal.opening import journal_if_used
from runner.journal.session_log import SessionLog
from runner.journal.store import Journal, JournalError
from runner.journal.verification import touchbeam_versions
from runner.launch.confirmation import Confirm, refused
from runner.launch.device_access import (
    SessionRig,
    gauge_address,
    require_real,
    session_rig,
    stepped_rig,
)
from runner.launch.locks import real_address, rig_lock, session_lock
from runner.launch.opened_session import as_begun, opened_session
from runner.launch.participant_screen import participants_screen
from runner.launch.participants import Say, participant_and_operator
from runner.launch.request import Request, SessionOptions, requested, require_meant
from runner.people.terminal import said_in_background
from runner.people.virtual_participant import UntouchedBeam
from runner.session.loop import run
from runner.session.session import SessionContext, versions
from runner.signals import Stopped
from runner.study.calibration import kept_calibration
from runner.window.client import WindowParticipant
from runner.window.messages import Settings
from runner.window.preflight import study_window

if TYPE_CHECKING:
    from runner.people.virtual_participant import Finger


def run_session(options: SessionOptions, say: Say, confirm: Confirm = refused) -> SessionState:
    """Run or resume the session given by `options`; return its final state.

    Raises:
        BadInput, StudyError, AddressError: an input is wrong; nothing was changed.
        DeviceError, JournalError, ParticipantGone, RigInUse: the work failed; it can be resumed.
    """
    request = requested(options)
    require_meant(request, confirm)
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


def _context(request: Request, say: Say, stack: ExitStack) -> SessionContext:
    """Open everything that the session needs.

    `stack` closes it in reverse order: first the device, then the window, which stays open until
    the participant has read the last page; the locks are released after both.
    """
    name = request.name
    # Also of the rehearsal of that name: nobody runs both at once.
    stack.enter_context(session_lock(name, request.options.folder.path))
    request = as_begun(request)
    options = request.options
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
    rig = stack.enter_context(_rig(request, calibration))
    if not request.rehearsal:
        require_real(rig.device.arm().idn, request.url)
    clock = _clock(request, rig)
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


def _rig(request: Request, calibration: Resonance | None) -> AbstractContextManager[SessionRig]:
    """Return the device as a context manager; a simulated one on a stepped clock is in here."""
    options, settings = request.options, request.study.rig
    channel = request.study.force_channel
    friction = Friction(law=options.law, rung=options.rung, damping=options.damping)
    if request.pace == "stepped":
        return stepped_rig(settings, request.seed, calibration, channel, **friction)
    return session_rig(
        request.url, settings, options.touchbeam, request.seed, calibration, channel, **friction
    )


def _clock(request: Request, rig: SessionRig) -> Clock:
    """Return the session's clock; a stepped one moves the device's time."""
    wall = WallClock()
    if request.pace == "stepped":
        # Imported here because a session with a real device needs no simulator.
        from device.simulator.in_process import InProcessHand

        if isinstance(rig.control, InProcessHand):
            return SteppedClock(wall.utc(), rig.control.pass_time, rig.control.now_s)
    return wall


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
    if options.ratings != "window" and not options.at_window:
        return nullcontext()
    return study_window(
        options.touchbeam,
        request.study,
        Settings(
            wording=request.wording,
            screen=participants_screen(
                options.touchbeam, options.screen, say, windowed=options.windowed
            ),
            windowed=options.windowed,
            folder=str(options.folder.path.resolve()),
        ),
        options.consent,
        say,
    )


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
