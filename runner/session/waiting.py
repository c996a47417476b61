"""Waiting while the watchdog is fed and the operator and participant are served."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal, NoReturn, TypeVar

from protocol.errors import WorkFailed
from protocol.journal.events import NoteTaken, Paused, QuestionAnswered, Unpaused, WindowChanged
from protocol.journal.records import QuestionAnswer, ReadBack
from protocol.plan.trials import Trial, remaining_s
from protocol.study.study_question import answer_text
from runner import screens
from runner.session.session import SessionContext, known_before
from runner.session.track_levels import as_made, standing
from runner.signals import raise_if_stopped, take_suspension


def show_page(context: SessionContext, screen: screens.Screen) -> None:
    context.participant.show(screen)
    blind = context.session.study.session.blind_operator
    typed = isinstance(screen, screens.Ask) and screen.question.form == "typed"
    context.operator.page(screens.page_name(screen, blind=blind), typed=typed)


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
    trials = [trial for trial in context.order if trial.index not in state.not_needed]
    # Once the session is complete, what the operator sees can no longer influence it.
    blind = session.study.session.blind_operator and state.name != "completed"
    answers = dict.fromkeys(state.answers, "answer given") if blind else state.answers
    running = next((trial for trial in trials if trial.index == state.trial), None)
    context.operator.show(
        screens.OperatorView(
            session=f"{session.participant}/{session.number}",
            kind=session.kind,
            state=state.name,
            plan=tuple(
                screens.PlanLine(
                    label=f"trial {number}" if blind else _label(trial),
                    answer=answers.get(trial.index),
                    running=trial is running,
                )
                for number, trial in enumerate(trials, start=1)
            ),
            left_s=_left_s(context, [t for t in trials if t.index not in state.answers]),
            device=device,
            rig=session.study.rig,
            kept_by=_keeper(context),
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
            track=None if blind or not session.study.track else standing(session, state, running),
        )
    )


def _keeper(context: SessionContext) -> Literal["watchdog", "guardian", ""]:
    if context.device.has_watchdog:
        return "watchdog"
    return "guardian" if context.device.has_guardian else ""


def _aim(context: SessionContext, trial: Trial) -> screens.Aim:
    study, state = context.session.study, context.log.state
    planned = as_made(context.session, state, trial).touches[state.touch or 0]
    touch = planned.at(context.resonance_hz)
    cue = screens.pacing(touch, study.touch)
    slack_n = study.as_instructed.force_within * cue.force_n
    return screens.Aim(
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
        # The break before the running trial is over.
        replace(trial, touches=trial.touches[state.touch or 0 :], break_s=0.0)
        if trial.index == state.trial
        else trial
        for trial in left
    ]
    return remaining_s(study, ahead, state.beam or study.touch.beam)


def _label(trial: Trial) -> str:
    """Return the operator's label of `trial`, such as `voltage, level 0.5`."""
    if trial.track is not None:
        return f"{trial.track.name}, {trial.track.role}"
    parts = [trial.condition or trial.kind]
    if trial.condition and trial.kind not in {"trial", "pass"}:
        parts.append(trial.kind)
    elif trial.level != 1:
        parts.append(f"level {trial.level:g}")
    return ", ".join([*parts, *["opposite order"] * trial.opposite])


class StoppedByOperator(WorkFailed):
    """The operator stopped the session; it can be resumed."""


class RepeatTrial(Exception):
    """The running trial is broken off, for the reason that the journal keeps, and repeated."""


def obey(context: SessionContext) -> None:
    """Carry out the next order, of the operator or of a stop key in the participant's window.

    Raises:
        StoppedByOperator: the operator stopped the session; an emergency stop has already sent
            the command that turns the output off.
        RepeatTrial: the operator asked to repeat the running trial, or to suspend the program.
    """
    if context.participant.stops():
        _stop_at_once(context, "emergency stop in the participant's window")
    _refuse_suspension(context)
    match context.operator.order():
        case "emergency stop":
            _stop_at_once(context, "emergency stop")
        case "stop":
            context.operator.notify("stopping; the output goes off")
            raise StoppedByOperator("stopped by the operator")
        case "repeat":
            _repeat(context, "repeated at the operator's request")
        case "pause":
            context.pause_wanted = not context.pause_wanted
            context.operator.pausing(context.pause_wanted)
        case screens.Note(text=text):
            # Confirmed only after it is stored.
            context.log.append(NoteTaken(text=text))
            context.operator.notify(f"noted: {text}")
        case screens.Correction() as correction:
            context.operator.notify(_corrected(context, correction))
    _follow_window(context)


def _stop_at_once(context: SessionContext, why: str) -> NoReturn:
    # First, without waiting for the port: nothing is printed or recorded before it.
    context.device.emergency_stop()
    context.operator.notify(f"{why}: off was sent")
    raise StoppedByOperator(why)


def _follow_window(context: SessionContext) -> None:
    """Record and show where the keyboard's keys go, when that has changed."""
    state = context.participant.window_state()
    if state is None or state == context.window_state:
        return
    context.window_state = state
    # Shown first, because the operator may need a stop key before a slow disk has stored it.
    context.operator.window(state)
    context.log.append(WindowChanged(**vars(state)))


def _corrected(context: SessionContext, wanted: screens.Correction) -> str:
    """Record another answer of the operator's; return what became of it."""
    session, state = context.session, context.log.state
    known = known_before(session, state)
    asked = {it.name: it for it in session.study.questions("desk", session.number)}
    answered = [name for name in asked if (name, None) in state.questions]
    due = [name for name, it in asked.items() if name not in answered and it.follows(known)]
    if wanted.name not in {*answered, *due}:
        return f"{wanted.name!r} has no answer to correct; answered: {', '.join(answered) or '-'}"
    if state.begun and not wanted.note:
        return "the session has begun: add the reason, as in `age 31 because misheard`"
    try:
        answer = asked[wanted.name].answer(wanted.answer)
    except ValueError as error:
        return str(error)
    given = QuestionAnswer(name=wanted.name, answer=answer, reaction_time_s=0.0, trace=None)
    known[wanted.name], moot = answer, []
    for name in answered:
        if not asked[name].follows(known):
            moot.append(name)
            del known[name]
    note, gone = wanted.note or None, tuple(moot) or None
    context.log.append(QuestionAnswered(when="desk", **vars(given), note=note, moot=gone))
    # Until the resonance is measured the desk asks for it itself.
    left = [
        name
        for name, question in asked.items()
        if name not in {*known, *due} and question.follows(known) and context.resonance_hz
    ]
    told = [
        f"corrected: {wanted.name} {answer_text(answer)}",
        *([f"no longer counts: {', '.join(moot)}"] if moot else []),
        *([f"now asked for: {', '.join(left)}; answer it as a correction"] if left else []),
    ]
    return "; ".join(told) + keeps_its_group(context, wanted.name)


def keeps_its_group(context: SessionContext, name: str) -> str:
    """Return what to do if the answer to `name`, just given, leads to another group; else ''."""
    session, known = context.session, known_before(context.session, context.log.state)
    rules = {group.name: group.when for group in session.study.group if group.when}
    leads_to = next((group for group, rule in rules.items() if rule.met_by(known)), None)
    decides = name in {rule.question for rule in rules.values()}
    if not decides or leads_to in {None, session.group}:
        return ""
    # The journal begins with the plan of the group, and proves it: it cannot be drawn anew.
    return (
        f"; the session keeps its group, {session.group}, because its trials are planned: for "
        f"{leads_to} end it, exclude it with the reason, and run the participant's next session"
    )


def _refuse_suspension(context: SessionContext) -> None:
    if not take_suspension():
        return
    context.operator.notify(
        "Ctrl-Z does not suspend a session; the order s stops it, and the same command resumes it"
    )
    # Whoever presses Ctrl-Z wants everything to stand still: a touch does not go on.
    if context.log.state.trial is not None:
        _repeat(context, "broken off by Ctrl-Z (SIGTSTP)")


def _repeat(context: SessionContext, why: str) -> None:
    state, unit = context.log.state, context.session.unit
    if state.trial is None:
        context.operator.notify(f"there is no running {unit} to repeat")
    # A second press would abort a trial of which nothing has been made.
    elif state.touch is None and state.aborted[-1:] == [state.trial]:
        context.operator.notify(f"this {unit} is being repeated already")
    else:
        context.operator.notify(f"the {unit} is broken off and will be repeated")
        raise RepeatTrial(why)


# Half of the time (0.1 s) after which the owner of the port feeds a watchdog of 0.5 s, because it
# feeds only if the session has moved since.
TICK_S = 0.05
SAVED_S = 0.5
"""How long a page may say that its answer is saved before the pause after it begins."""

_Thing = TypeVar("_Thing")


def wait_for(context: SessionContext, poll: Callable[[], _Thing | None]) -> _Thing:
    while (thing := poll()) is None:
        tick(context, TICK_S)
    return thing


def response(context: SessionContext) -> screens.Response:
    return wait_for(context, context.participant.poll)


def operator_answer(context: SessionContext) -> str:
    """Return the operator's answer, and keep serving the participant until it arrives.

    An unanswered question is withdrawn, because a late answer must have no effect.
    """

    def poll() -> str | None:
        context.participant.poll()
        return context.operator.answered()

    try:
        return wait_for(context, poll)
    except BaseException:
        context.operator.withdraw_question()
        raise


def wait(
    context: SessionContext,
    seconds: float,
    on_tick: Callable[[], None] = lambda: None,
    every_s: float = TICK_S,
) -> None:
    """Wait for `seconds`; serve the participant and call `on_tick` every `every_s`."""
    end_s = context.clock.monotonic_s() + seconds
    while (left_s := end_s - context.clock.monotonic_s()) > 1e-9:  # rounding of summed ticks
        context.participant.poll()
        on_tick()
        tick(context, min(every_s, left_s))
    context.participant.poll()


def tick(context: SessionContext, seconds: float) -> None:
    """Check signals, device and operator once, then sleep for `seconds`; raises what they order."""
    # A signal's exception can get lost in foreign code; asked here, it takes effect soon.
    raise_if_stopped()
    context.device.beat()
    obey(context)
    context.clock.sleep(seconds)


def pause_if_wanted(context: SessionContext, trial: Trial) -> None:
    """Wait before `trial`: the inter-trial interval, a planned break, the operator's pause."""
    pause_s = context.session.study.timing.inter_trial_s
    # First "Saved", then what is waited for: a page that changed at once would not be read.
    wait(context, min(SAVED_S, pause_s))
    show_page(context, screens.Notice(text="wait.touch"))
    wait(context, max(pause_s - SAVED_S, 0.0))
    if trial.break_s > 0:  # it ends when it is over and the participant wants to go on
        over_s = context.clock.monotonic_s() + trial.break_s
        show_page(context, screens.Instruction(text="break", after_s=trial.break_s))
        answer = None
        while answer is None or context.clock.monotonic_s() < over_s:
            # Kept, because a press that comes before the break is over is not asked for again.
            answer = answer or context.participant.poll()
            tick(context, TICK_S)
    if context.pause_wanted:
        _pause(context)


def _pause(context: SessionContext) -> None:
    context.log.append(Paused())
    show_page(context, screens.Notice(text="pause"))
    update_view(context)
    # `tick` takes the operator's orders, one of which ends the pause.
    while context.pause_wanted:
        context.participant.poll()
        tick(context, TICK_S)
    context.log.append(Unpaused())
