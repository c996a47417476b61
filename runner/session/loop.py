"""The session loop: what may begin or resume, every trial, and the device off however it ends."""

from collections.abc import Callable
from contextlib import suppress
from datetime import datetime, timedelta

from device.errors import OutputLastOff, OutputUnknown
from protocol.errors import BadInput, WorkFailed
from protocol.journal import events
from protocol.journal.records import Compliance
from protocol.journal.state import SessionState
from protocol.plan.orders import Stream
from protocol.plan.plan import deferral
from protocol.plan.trials import FEEDBACK_S, Trial
from protocol.study.participant_texts import numbers_touches
from protocol.study_file.loading import text_digest
from runner.journal.amendments import accepted_digests
from runner.journal.cohort import cannot_go_on
from runner.journal.names import chain_name, chains_of, parsed_name, session_name
from runner.journal.store import Journal, JournalError, abort_trial, close_interrupted
from runner.journal.verification import chain_is_unbroken
from runner.screens import Notice
from runner.session.session import Session, SessionContext
from runner.session.setup import prepare
from runner.session.track_levels import as_made, ended
from runner.session.trial import ask, ask_due, introduce, read_pages, touch
from runner.session.waiting import RepeatTrial, pause_if_wanted, show_page, update_view, wait
from runner.signals import errors_are_last, stops_allowed, stops_deferred

_OFF = "output off, read back"
_RESUMABLE = "run the same command again to resume"
_NOTICE_S = 3.0
"""How long participants are told that a touch does not count."""


def run(context: SessionContext) -> None:
    """Run the session from the state in its log to its end.

    Raises:
        DeviceError: the device cannot be trusted; the session can be resumed.
        OutputUnknown: the output could not be read back as off.
        StoppedByOperator: the operator stopped the session; it can be resumed.
    """
    _resume(context)
    run_then_turn_off(_run_trials, context)
    show_page(context, Notice(text="thanks"))
    update_view(context)


def _run_trials(context: SessionContext) -> None:
    prepare(context)
    read_pages(context, "session")
    _leave_out(context)
    ask_due(context)
    block, last = None, None
    # Asked anew each time: a repeated or deferred trial stays pending, and the order may change.
    while left := context.pending:
        # The journal's log grows with each event. It is copied between blocks only, because nobody
        # touches the beam then and nobody's reaction is timed.
        if block not in {None, left[0].block}:
            context.log.journal.checkpoint()
        block = left[0].block
        pause_if_wanted(context, left[0])
        introduce(context, left[0], last)
        last = left[0]
        _run_trial(context, last)
        # Before the questions, because a stop may end a block or the session.
        _leave_out(context)
        ask_due(context)


def _leave_out(context: SessionContext) -> None:
    """Record which trials of tracks are not needed any more."""
    for stopped in ended(context.session, context.log.state):
        context.log.append(stopped)


def _run_trial(context: SessionContext, trial: Trial) -> None:
    """Run one trial; if it must be repeated, it remains pending."""
    # Before anything is shown: a session killed from here on is known to have been in this trial.
    context.log.append(events.TrialStarted(index=trial.index, kind=trial.kind))
    total = len(context.session.plan.trials)
    context.participant.progress(len(context.log.state.answered) + 1, total)
    update_view(context)
    try:
        done: list[Compliance] = []
        touches = as_made(context.session, context.log.state, trial).touches
        numbered = numbers_touches(context.session.study, context.session.language, len(touches))
        for number, to_make in enumerate(touches):
            interval = number + 1 if numbered else 0
            done.append(touch(context, number, to_make, interval))
            if deferred(context, trial, done[-1]):
                return
        given = ask(context, trial, done)
        context.log.append(given)
        # Only now: the page says "Saved" of nothing that a power cut could still take.
        context.participant.saved()
        _tell(context, given)
    except RepeatTrial as wish:
        context.device.off()
        # The output is off before this is shown: a window that fails here cannot keep it on.
        show_page(context, Notice(text="touch.end"))
        abort_trial(context.log, str(wish))
    if trial.kind == "practice":
        renew_practice(context)


def _tell(context: SessionContext, given: events.Answered) -> None:
    answer = given.track
    if answer is None or answer.correct is None or answer.role == "catch":
        return
    if context.session.study.track_of(answer.name).feedback:
        show_page(context, Notice(text="feedback.right" if given.agrees else "feedback.wrong"))
        wait(context, FEEDBACK_S)


def _resume(context: SessionContext) -> None:
    log, session = context.log, context.session
    if context.opened_now:
        return
    # A process that was killed could record neither its trial nor the output as ended.
    close_interrupted(log)
    log.append(session.recorded_as(events.SessionResumed))
    if session.study.session.practise_again == "on resume":
        practice = {trial.index for trial in session.plan.trials if trial.kind == "practice"}
        # Practice that has no answer yet is pending anyway.
        if again := sorted(practice & log.state.answered):
            log.append(events.PracticeRenewed(indices=tuple(again)))


def run_then_turn_off(part: Callable[[SessionContext], None], context: SessionContext) -> None:
    """Run `part`; however it ends, turn the output off first and record that second.

    A signal after the last answer takes effect once the session is complete.
    """
    # Signals are deferred here and allowed only in `part`, so that none can skip `_turn_off`.
    with stops_deferred(), errors_are_last():
        try:
            with stops_allowed():
                part(context)
        except BaseException as error:
            doubt = error if isinstance(error, OutputUnknown) else None
            # On every way out, even at an error of ours: a finger may lie on the beam.
            _turn_off(context, str(error) or type(error).__name__, doubt, stopped=True)
            error.add_note(_OFF)
            if not isinstance(error, BadInput):  # the same input would fail again
                error.add_note(_RESUMABLE)
            raise
        _turn_off(context, "end of session")
        # Last, so that no session counts as complete whose output was not read back as off.
        context.log.append(events.SessionCompleted())


def _turn_off(
    context: SessionContext, why: str, doubt: OutputUnknown | None = None, *, stopped: bool = False
) -> None:
    """Turn the output off and record it; an unknown output is always reported first.

    If the session was `stopped`, the participant is told so before that is recorded.

    With `doubt` the device has already failed to confirm it. One good answer after that does not
    count as a confirmation, so that the journal agrees with what the operator is told.
    """
    # First the device: a window that hangs or a full disk must not keep the output on.
    unknown = doubt
    try:
        context.device.off()
    except OutputUnknown as error:
        unknown = error
    try:
        if stopped:
            with suppress(WorkFailed):  # the window itself may have failed
                show_page(context, Notice(text="stopped"))
        # The trial first: the journal permits `device-off` only where no trial is running.
        abort_trial(context.log, why)
        if context.log.state.name in {"armed", "paused"}:
            context.log.append(events.DeviceOff(confirmed=unknown is None, why=why))
        if unknown is not None:
            update_view(context, unknown=not isinstance(unknown, OutputLastOff))
    except Exception as error:
        if unknown is not None:
            # That the output may be on matters more than what could not be shown or recorded.
            raise unknown from error
        error.add_note(_OFF)
        error.add_note(_RESUMABLE)
        raise
    if unknown is not None:
        raise _with_way_on(unknown)


def _with_way_on(unknown: OutputUnknown) -> OutputUnknown:
    """Return the error, with how to go on if the amplifier need not be cut first."""
    if isinstance(unknown, OutputLastOff):
        unknown.add_note(_RESUMABLE)
    return unknown


def deferred(context: SessionContext, trial: Trial, made: Compliance) -> bool:
    """Defer the running `trial` if a touch, just made, was not as instructed; return whether.

    Practice is renewed as a whole instead. After the last attempt that the study allows, the trial
    goes on.
    """
    session, state = context.session, context.log.state
    # Counted from the journal, so that a session that was resumed does not begin to count anew.
    before = sum(index == trial.index for index, _ in state.deferred)
    allowed = session.study.as_instructed.retries
    if trial.kind == "practice" or not made.missed or before >= allowed:
        return False
    place = (session.plan.session, session.plan.slot, trial.index, before)
    # A stream for each attempt: a draw does not depend on those made before it.
    stream = Stream(session.study.study.seed, "again", *place)
    index, after = deferral(session.study, context.order, trial, state.beam, stream)
    # Before it is told: no trial runs then, which `repeat` during the notice could repeat, too.
    context.log.append(events.TrialDeferred(index=index, missed=made.missed, after=after))
    # The participant reads one reason at a time; the journal has all of them.
    show_page(context, Notice(text=f"again.{made.missed[0]}"))
    wait(context, _NOTICE_S)
    return True


def renew_practice(context: SessionContext) -> None:
    """Repeat practice once it is over, if too few of its last touches were as instructed."""
    rules, state = context.session.study.as_instructed, context.log.state
    practice = [trial.index for trial in context.order if trial.kind == "practice"]
    is_over = state.answered >= set(practice)
    # A rig without sensors judges no touch: `recent` is then empty, and practice is not repeated.
    recent = state.practised[-rules.practise_of :]
    lacking = bool(recent) and sum(recent) < rules.practise_until
    if is_over and lacking and state.practice_rounds < rules.practice_rounds:
        context.log.append(events.PracticeRenewed(indices=tuple(practice)))


def require_resumable(
    journal: Journal, session: Session, before: SessionState | None, now: datetime
) -> None:
    """Refuse a session that cannot start, or resume from the state `before`, as requested.

    Raises `BadInput` with reason and remedy, and `JournalError` if recorded events were changed.
    """
    name = session_name(session.participant, session.number)
    rehearsal = session.kind == "rehearsal"
    chain = chain_name(journal, session.participant, session.number, rehearsal=rehearsal)
    # A new session, too, must follow the study file of the others, or its latest amendment.
    accepted = [] if rehearsal else accepted_digests(journal)
    if accepted and text_digest(session.study_text) != accepted[-1]:
        raise BadInput(
            "study.toml has changed since the last session; restore it, its pictures and language "
            "files, or accept the change with touchbeam amend --reason TEXT"
        )
    if before is None:
        return
    # Payloads may be missing here, because a withdrawn session is refused below for that reason.
    if not chain_is_unbroken(chain, journal.chain(chain), erased=True):
        raise JournalError(
            f"{name}: cannot resume, because its chain of events is broken; run touchbeam verify, "
            "and choose another participant or --session"
        )
    if before.is_excluded or before.name in {"completed", "withdrawn"}:
        what = f"the rehearsal {name}" if rehearsal else name
        raise BadInput(f"{what} is already {before.shown_name}; {_instead(session)}")
    assert before.opened is not None, "session-opened is the first event of every session"
    if why := cannot_go_on(session.study, session.plan.trials, before):
        own = chains_of(journal, session.participant, rehearsal=rehearsal)
        number = 1 + max(parsed_name(each).number for each in own)
        extra = "" if session.slides else " --extra"
        raise BadInput(f"{name} {why}; begin anew with --session {number}{extra}")
    _require_fresh(name, session, before.last_event_utc, now)


def _instead(session: Session) -> str:
    """Return what to do if the session is over."""
    if session.slides:
        return f"--session {session.number + 1} draws the block anew"
    if session.kind == "rehearsal":
        return "to rehearse again give another --participant (rehearsals do not use up the session)"
    return "give another --participant or --session"


def _require_fresh(name: str, session: Session, last_event: datetime | None, now: datetime) -> None:
    if last_event is None:
        return
    limit_h = session.study.session.resume_within_h
    # A clock may be set back by less than the limit, as an interruption may last that long.
    if last_event - now > timedelta(hours=limit_h):
        raise BadInput(
            f"{name} was interrupted at {last_event:%Y-%m-%d %H:%M} UTC, which lies in the future; "
            "check this computer's clock"
        )
    if now - last_event > timedelta(hours=limit_h):
        other = "" if session.slides else "participant or "
        hours = (now - last_event).total_seconds() / 3600
        raise BadInput(
            f"{name} was interrupted {hours:.0f} h ago and must be resumed within {limit_h:g} h; "
            f"exclude it (touchbeam exclude) and choose another {other}--session"
        )
