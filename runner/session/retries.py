"""What follows from a touch that was not as instructed: its trial comes again, or practice does."""

from protocol.journal.events import PracticeRenewed, TrialDeferred
from protocol.journal.records import Compliance
from protocol.plan.randomisation import Stream
from protocol.plan.retries import deferral
from protocol.plan.trials import Trial
from runner.screens import Notice
from runner.session.session import SessionContext
from runner.session.waiting import wait

_NOTICE_S = 3.0
"""How long participants are told that a touch does not count."""


def deferred(context: SessionContext, trial: Trial, made: Compliance) -> bool:
    """Defer the running `trial` if a touch, just made, was not as instructed; return whether.

    Practice is renewed as a whole instead. After the last attempt that the study allows, the trial
    goes on.
    """
    session, state = context.session, context.log.state
    before = sum(index == trial.index for index, _ in state.deferred)
    allowed = session.study.as_instructed.retries
    if trial.kind == "practice" or not made.missed or before >= allowed:
        return False
    place = (session.plan.session, session.plan.slot, trial.index, before)
    stream = Stream(session.study.study.seed, "again", *place)
    index, after = deferral(session.study, context.order, trial, state.beam, stream)
    context.log.append(TrialDeferred(index=index, missed=made.missed, after=after))
    context.participant.show(Notice(text=f"again.{made.missed[0]}"))
    wait(context, _NOTICE_S)
    return True


def renew_practice(context: SessionContext) -> None:
    """Repeat practice once it is over, if too few of its last touches were as instructed."""
    rules, state = context.session.study.as_instructed, context.log.state
    practice = [trial.index for trial in context.order if trial.kind == "practice"]
    is_over = state.answered >= set(practice)
    recent = state.practised[-rules.practise_of :]
    lacking = bool(recent) and sum(recent) < rules.practise_until
    if is_over and lacking and state.practice_rounds < rules.practice_rounds:
        context.log.append(PracticeRenewed(indices=tuple(practice)))
