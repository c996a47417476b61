"""What the operator sees of a running session."""

from dataclasses import replace

from protocol.journal.records import ReadBack
from protocol.plan.trials import Trial, remaining_s
from runner.screens import OperatorView
from runner.session.session import SessionContext


def update_view(
    context: SessionContext,
    device: ReadBack | None = None,
    warning: str = "",
    *,
    busy: str = "",
    unknown: bool = False,
) -> None:
    """Show the operator the session's progress and, while the output is on, its read-back."""
    state, session = context.log.state, context.session
    left = [entry for entry in session.plan.trials if entry.index not in state.answered]
    running = [entry for entry in left if entry.index == state.trial]
    coming = [entry for entry in left if entry.index != state.trial]
    context.operator.show(
        OperatorView(
            session=f"{session.participant}/{session.number}",
            kind=session.kind,
            state=state.name,
            trial=_label(running),
            next_trial=_label(coming),
            done=len(state.answered),
            total=len(session.plan.trials),
            left_s=_left_s(context, left),
            device=device,
            busy=busy,
            watchdog_s=session.study.rig.watchdog_s,
            last_answer=next(reversed(state.answers.values()), ""),
            warning=warning,
            unknown=unknown,
        )
    )


def _left_s(context: SessionContext, left: list[Trial]) -> float:
    """Return the expected time to the end of the session; touches already made do not count."""
    state, study = context.log.state, context.session.study
    ahead = [
        replace(entry, touches=entry.touches[state.touch or 0 :], break_s=0.0)
        if entry.index == state.trial
        else entry
        for entry in left
    ]
    return remaining_s(study, ahead, state.beam or study.touch.beam)


def _label(trials: list[Trial]) -> str:
    """Return the operator's label for the first of `trials`."""
    return (trials[0].condition or trials[0].kind) if trials else "-"
