"""The session that a request opens or resumes in the journal, and who takes part."""

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from device.friction.scenes import NOMINAL
from protocol.address import SIMULATED
from protocol.errors import BadInput, Problem
from protocol.journal.events import SessionOpened
from protocol.journal.records import RigCalibration, VirtualTruth
from protocol.journal.state import SessionState
from protocol.plan.plan import plan, slide_plan
from protocol.plan.trials import Plan
from protocol.proof.slide_checks import slide_plan_problems
from protocol.proof.trial_checks import cohort_problems, cycle
from protocol.registration.registration import locked
from protocol.study.study import Study
from runner.clock import Clock
from runner.journal.cohort import slot_for, states
from runner.journal.opening import read_journal
from runner.journal.session_log import SessionLog
from runner.journal.store import Journal, JournalError
from runner.launch.request import Request, SessionOptions
from runner.session.loop import require_resumable
from runner.session.session import Session, answer_order
from runner.study.calibration import fitted_calibration
from runner.study.check import require_proved
from runner.study.registered import require_registered

if TYPE_CHECKING:
    from device.people.person import Person


def opened_session(request: Request, journal: Journal, clock: Clock) -> Session:
    """Return the session to run, and open it in the journal if it is new.

    A slot is taken by opening the session; choosing and opening must therefore not be separated.

    Raises:
        WrongPlan: its plan was drawn wrongly; nothing is opened.
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
            plan=_proved_plan(request, study, slot),
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


def _proved_plan(request: Request, study: Study, slot: int) -> Plan:
    """Return the plan of a session if code that did not draw it finds that it is the study's.

    Raises:
        WrongPlan: it is not, so that nothing may be driven by it.
    """
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
    """Return the request with the seed and the simulated beam of the session that it resumes.

    The journal describes them where a virtual participant takes part.

    Raises:
        BadInput: an option gives another beam.
    """
    begun, options = _begun(request), request.options
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


def _begun(request: Request) -> SessionOpened | None:
    """Return how the session was opened, if it was and if the journal can be read."""
    path = request.options.folder.journal
    with suppress(JournalError):  # opening the journal for the session will tell
        if path.exists():
            with read_journal(path) as journal:
                first = journal.events(request.chain(journal))[:1]
                records = [event.record for event in first if not event.erased]
            return next((it for it in records if isinstance(it, SessionOpened)), None)
    return None


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
    from device.people.person import World, truth_of
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
    from device.people.person import DEFAULT, drawn_person, person_name, person_of

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
