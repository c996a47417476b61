"""A session from options to end: opens locks, window, rig, journal and people, in this order.

What the journal already knows of a session that is resumed comes from there: its person, its beam.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from typing import Any

from device.friction.calibration import NOMINAL
from device.people import person as people
from device.people.people_file import require_effects
from device.simulator.client import Friction
from protocol.address import SIMULATED
from protocol.errors import BadInput, Problem, WorkFailed
from protocol.journal.events import SessionOpened
from protocol.journal.records import RigCalibration, VirtualTruth
from protocol.journal.state import SessionState
from protocol.plan.plan import plan, slide_plan
from protocol.plan.trials import Plan
from protocol.proof.slide_checks import slide_plan_problems
from protocol.proof.trial_checks import cohort_problems, cycle
from protocol.registration.registration import locked
from protocol.study.study import Study
from runner.clock import Clock, WallClock
from runner.journal.amendments import changed_since_rehearsal
from runner.journal.cohort import Arrival, states
from runner.journal.names import chains_of
from runner.journal.opening import journal_if_used
from runner.journal.store import Journal, JournalError, SessionLog
from runner.journal.verification import touchbeam_versions
from runner.launch import device_access
from runner.launch.locks import session_lock
from runner.launch.participants import Say, participant_and_operator, participants_screen
from runner.launch.request import (
    Confirm,
    Request,
    SessionOptions,
    lacking_before,
    recorded,
    refused,
    requested,
    require_meant,
    with_group,
)
from runner.people.operator_console import recalled
from runner.people.terminal import said_in_background
from runner.people.virtual_participant import Finger, UntouchedBeam
from runner.session.loop import require_resumable, run
from runner.session.session import Session, SessionContext, answer_order, versions
from runner.session.setup import answered_before
from runner.signals import Stopped, never_suspended
from runner.study.calibration import fitted_calibration, kept_calibration
from runner.study.check import require_proved
from runner.study.registered import require_registered
from runner.study.tracks import solved_volts
from runner.window.client import WindowParticipant
from runner.window.messages import Settings
from runner.window.preflight import study_window


def run_session(options: SessionOptions, say: Say, confirm: Confirm = refused) -> SessionState:
    """Run or resume a session; return its state.

    Raises `BadInput` if nothing was changed, and `WorkFailed` if the session can be resumed.
    """
    request = requested(options)
    require_meant(request, confirm, WallClock().utc())
    request = with_group(request, say)
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
    stack.enter_context(device_access.rig_locks(request.url, request.study.force_channel))
    # The window before the rig: without a window to instruct the participant nothing is driven.
    window = stack.enter_context(_window(request, say))
    if request.pace == "wall":  # a stepped rig is simulated in this process, and stands still too
        stack.enter_context(never_suspended())
    rig = stack.enter_context(_rig(request))
    if not request.rehearsal:
        device_access.require_real(rig.device.arm().idn, request.url)
    clock = rig.clock
    # The rig before the journal: if no device answers, no session is opened.
    journal = stack.enter_context(journal_if_used(options.folder.journal))
    chain = request.chain(journal)
    new = chain not in journal.sessions()
    before = journal.events(chain)
    earlier = touchbeam_versions(before)[-1:]
    had = Arrival(states(journal), options.participant, request.kind, chain).known_group
    if request.rehearsal and (number := lacking_before(request, journal)):
        say(f"WARNING: session {number} of {options.participant} is not completed.")
    changed = not options.slides and changed_since_rehearsal(journal, request.text)
    session = opened_session(request, journal, clock)
    log = SessionLog(journal, chain, clock)
    if session.group is not None:
        drawn = request.rehearsal and had is None and options.group is None
        chance = ", drawn by chance for this rehearsal: --group names another" * drawn
        say(f"{options.participant} belongs to the group {session.group}{chance}.")
    if changed:
        say("study.toml has changed since the last rehearsal.")
    if new and not request.rehearsal and chains_of(journal, options.participant, rehearsal=True):
        say(f"{options.participant} was a rehearsal before; this is the session itself.")
    if earlier and earlier[0] != (now := versions()["touchbeam"]):
        say(f"{name} was last recorded by touchbeam {earlier[0]} and continues with {now}.")

    # Asked once the session runs, and measures it.
    finger = _finger(request, rig, say, resonance_hz=lambda: context.resonance_hz)
    participant, operator = stack.enter_context(
        participant_and_operator(session, rig, say, window, finger, lambda: log.state.trial)
    )
    operator.recall(recalled(before))
    stack.enter_context(checkpointed(journal))
    context = SessionContext(
        session=session,
        device=rig.device,
        address=request.url,
        study_folder=options.folder.path,
        participant=participant,
        operator=operator,
        clock=clock,
        log=log,
        opened_now=new,
    )
    return context


def _rig(request: Request) -> AbstractContextManager[device_access.SessionRig]:
    options, study = request.options, request.study
    calibration = options.calibration or kept_calibration(options.folder.path)
    friction = Friction(law=options.law, rung=options.rung, damping=options.damping)
    stepped, session = device_access.stepped_rig, partial(device_access.session_rig, request.url)
    opened = stepped if request.pace == "stepped" else session
    folder = options.folder.path
    return opened(study.rig, request.seed, calibration, study.force_channel, folder, **friction)


def _finger(
    request: Request, rig: device_access.SessionRig, say: Say, resonance_hz: Callable[[], float]
) -> Finger | None:
    """Return what a virtual participant feels with; None for a person or a block."""
    if request.options.ratings != "virtual" or request.options.slides:
        return None
    if rig.control is not None:
        return rig.control
    say(f"DRY RUN on {request.url}: the device is driven. Nobody may touch the surface.")
    calibration = fitted_calibration(request.options.folder.path, request.study)
    return UntouchedBeam(request.study, calibration, lambda: rig.device.reading, resonance_hz)


def _window(request: Request, say: Say) -> AbstractContextManager[WindowParticipant | None]:
    options = request.options
    if options.ratings != "window" and not options.at_window:
        return nullcontext()
    command = device_access.touchbeam_command()
    settings = Settings(
        wording=request.wording,
        screen=participants_screen(command, options.screen, say, windowed=options.windowed),
        windowed=options.windowed,
        folder=str(options.folder.path.resolve()),
    )
    return study_window(command, request.study, settings, options.consent, say)


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


def opened_session(request: Request, journal: Journal, clock: Clock) -> Session:
    """Return the session to run, opened in the journal if it is new; `WrongPlan` opens nothing.

    A slot is taken by opening the session; choosing and opening must therefore not be separated.
    """
    options, registered = request.options, request.registration
    digest = None if registered is None else registered.digest
    study = locked(request.study, digest)
    with journal.alone():
        require_registered(journal, registered, rehearsal=request.rehearsal)
        sessions, chain = states(journal), request.chain(journal)
        group, slot = None, 0
        who = Arrival(sessions, options.participant, request.kind, chain)
        if not options.slides:
            group = who.group(study, options.group)
            study, slot = study.of_group(group), who.slot(group)
        # A sliding experiment predicts nothing, so that no calibration is in force.
        rig = NOMINAL if options.slides else fitted_calibration(options.folder.path, study)
        session = Session(
            participant=options.participant,
            number=options.number,
            kind=request.kind,
            study=study,
            study_text=request.text,
            plan=_proved_plan(request, study, slot),
            language=request.wording.code,
            answer_order=answer_order(study, slot, sessions.get(chain)),
            consent=options.consent,
            group=group,
            noted=options.noted,
            seed=request.seed,
            virtual=_virtual_truth(request, sessions.get(chain), group),
            override=options.override,
            told=who.told(study),
            volts=solved_volts(study, rig),
            registration=digest,
            calibration=RigCalibration(**rig.values) if rig.origin else None,
        )
        require_resumable(journal, session, sessions.get(chain), clock.utc())
        if chain not in sessions:
            log = SessionLog(journal, chain, clock)
            # With it, so that a session that is resumed asks for nothing that decided on its group.
            for event in (session.recorded_as(SessionOpened), *answered_before(session)):
                log.append(event)
    return session


def _proved_plan(request: Request, study: Study, slot: int) -> Plan:
    """Return the plan; raises `WrongPlan` if code that did not draw it finds a fault in it."""
    number = request.options.number
    if request.options.slides:
        drawn = slide_plan(study, number)
        found = slide_plan_problems(study, drawn)
    else:
        # One order tells nothing about balance: all slots that balance each other are drawn.
        together = cycle(study, slot)
        plans = [plan(study, each, number) for each in together]
        drawn = plans[together.index(slot)]
        sessions = max(study.design.sessions, number)  # an extra one was asked for
        design = study.design.model_copy(update={"sessions": sessions})
        allowed = study.model_copy(update={"design": design})
        found = cohort_problems(allowed, plans, together.start)
    if drawn.session != number:
        found.append(
            Problem(where="plan", rule=f"must be of session {number}", value=str(drawn.session))
        )
    require_proved(request.name, found)
    return drawn


def as_begun(request: Request) -> Request:
    """Return the request with seed and simulated beam of the session it resumes, from the journal.

    Raise `BadInput` if an option gives another beam.
    """
    options = request.options
    first = recorded(request, lambda journal: journal.events(request.chain(journal))[:1])
    records = (event.record for event in first or () if not event.erased)
    begun = next((it for it in records if isinstance(it, SessionOpened)), None)
    truth = None if begun is None else begun.virtual
    # The damping ratio is known of simulated beams alone.
    if begun is None or truth is None or truth.damping_ratio is None or request.url != SIMULATED:
        return request
    kept: dict[str, Any] = {
        "seed": request.seed if begun.seed is None else begun.seed,
        "law": truth.law,
        "rung": truth.rung,
        "damping": truth.damping_ratio,
    }
    for name, value in kept.items():
        if (given := vars(options)[name]) not in {None, value}:
            raise BadInput(
                f"--{name} {given} gives {request.name} another simulated beam than it began with, "
                f"{name} {value}; resume it without --{name}, since the journal describes that beam"
            )
    return replace(request, options=replace(options, **kept))


def _virtual_truth(
    request: Request, before: SessionState | None, group: str | None
) -> VirtualTruth | None:
    """Return a virtual participant's parameters, and a simulated beam's; None for a person."""
    options = request.options
    if options.ratings != "virtual" or options.slides:
        return None
    from device.simulator.hardware.beam_and_finger import SimulatedBeam

    person, effect = _person(request, before, group), _effect(request, before)
    if request.url != SIMULATED:
        truth = people.truth_of(person, people.World(effect=effect))
        return replace(truth, damping_ratio=None, beam_gain=None)
    touched = device_access.simulated_surface(options.folder.path)
    beam = SimulatedBeam(request.seed, options.law, options.rung, options.damping, **touched)
    return people.truth_of(person, replace(beam.world, effect=effect))


def _effect(request: Request, before: SessionState | None) -> Mapping[str, float] | None:
    """Return what conditions are to a virtual participant where no friction is known, if told."""
    begun, population = before.opened if before else None, request.options.people
    given = None
    if request.study.surface.kind == "given" and population is not None:
        require_effects(population, request.study)
        given = population.effect
    if not isinstance(begun, SessionOpened) or begun.virtual is None:
        return given
    kept = begun.virtual.effect
    if population is not None and given != kept:
        raise BadInput(
            f"--people gives {request.name} other effects of conditions than it began with; resume "
            "it without --people, since the journal has them"
        )
    return kept


def _person(request: Request, before: SessionState | None, group: str | None) -> people.Person:
    """Return the virtual participant, the same in all sessions: who began this one, if any did."""
    options = request.options
    name = people.person_name(request.seed, options.participant)
    person = people.drawn_person((options.people or people.DEFAULT).of_group(group), name)
    begun = before.opened if before else None
    if not isinstance(begun, SessionOpened) or begun.virtual is None:
        return person
    kept = people.person_of(begun.virtual)
    if options.people is not None and person != kept:
        raise BadInput(
            f"--people gives {request.name} another virtual person than began it; resume it "
            "without --people, since the journal describes that person"
        )
    return kept
