"""What the operator sees of a running session."""

from protocol.journal.records import ReadBack
from protocol.plan.trials import Trial, trial_s
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
            left_s=sum(trial_s(session.study, entry) for entry in left),
            device=device,
            busy=busy,
            watchdog_s=session.study.rig.watchdog_s,
            last_answer=state.last_answer,
            warning=warning,
            unknown=unknown,
        )
    )


def _label(trials: list[Trial]) -> str:
    """Return the operator's label for the first of `trials`."""
    return (trials[0].condition or trials[0].kind) if trials else "-"
