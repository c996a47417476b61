"""What the operator sees of a running session."""

from collections.abc import Sequence
from dataclasses import replace

from protocol.journal.records import ReadBack
from protocol.plan.trials import Trial, remaining_s
from runner.screens import Aim, OperatorView, PlanLine, pacing
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
    trials = context.order
    blind = session.study.session.blind_operator and state.name != "completed"
    running = next((trial for trial in trials if trial.index == state.trial), None)
    context.operator.show(
        OperatorView(
            session=f"{session.participant}/{session.number}",
            kind=session.kind,
            state=state.name,
            plan=tuple(
                PlanLine(
                    label=f"trial {number}" if blind else _label(trial),
                    answer=_answer(context, trial, blind=blind),
                    running=trial is running,
                )
                for number, trial in enumerate(trials, start=1)
            ),
            left_s=_left_s(context, [t for t in trials if t.index not in state.answers]),
            device=device,
            rig=session.study.rig,
            has_watchdog=context.device.has_watchdog,
            busy=busy,
            warning=warning,
            aim=_aim(context, running) if running and state.name == "touching" else None,
            identity=context.identity,
            resonance_hz=context.resonance_hz,
            beam=state.beam,
            unknown=unknown,
            blind=blind,
            records=session.study.force_channel.rate_hz is not None,
            zero_n=context.zero.forces_n if context.zero else (0.0, 0.0),
            unit=session.unit,
        )
    )


def _aim(context: SessionContext, trial: Trial) -> Aim:
    study = context.session.study
    touch = trial.touches[context.log.state.touch or 0].at(context.resonance_hz)
    cue = pacing(touch, study.touch)
    slack_n = study.as_instructed.force_within * cue.force_n
    return Aim(
        voltage_v=touch.end_voltage_v,
        frequency_hz=touch.end_frequency * context.resonance_hz,
        path_m=(cue.start_m, cue.end_m),
        force_n=cue.force_n,
        force_range_n=(cue.force_n - slack_n, cue.force_n + slack_n),
    )


def _left_s(context: SessionContext, left: Sequence[Trial]) -> float:
    """Return the expected time to the end of the session; touches already made do not count."""
    state, study = context.log.state, context.session.study
    ahead = [
        replace(trial, touches=trial.touches[state.touch or 0 :], break_s=0.0)
        if trial.index == state.trial
        else trial
        for trial in left
    ]
    return remaining_s(study, ahead, state.beam or study.touch.beam)


def _answer(context: SessionContext, trial: Trial, *, blind: bool) -> str | None:
    answer = context.log.state.answers.get(trial.index)
    return "answer given" if blind and answer is not None else answer


def _label(trial: Trial) -> str:
    """Return the operator's label of `trial`, such as `voltage, level 0.5`."""
    parts = [trial.condition or trial.kind]
    if trial.condition and trial.kind not in {"trial", "pass"}:
        parts.append(trial.kind)
    elif trial.level != 1:
        parts.append(f"level {trial.level:g}")
    return ", ".join([*parts, *["opposite order"] * trial.opposite])
