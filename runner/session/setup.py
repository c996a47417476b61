"""Session setup: arm the device, ask the operator, mount the beam, measure its resonance."""

from collections.abc import Callable, Iterator
from functools import partial
from random import Random

from device.errors import DeviceError
from protocol.errors import BadInput
from protocol.journal import events
from protocol.journal.records import QuestionAnswer
from protocol.study.rules import Label, OperatorQuestion
from protocol.study.study_question import KINDS, Answer, StudyQuestion, answer_text
from protocol.study_file.limits import problems_at
from runner.screens import Notice, Welcome
from runner.session.measured import tare
from runner.session.session import Session, SessionContext, known_before
from runner.session.waiting import (
    keeps_its_group,
    operator_answer,
    response,
    show_page,
    update_view,
    wait,
)
from runner.session.watchdog import require_watchdog

MOST_OVER_S = 1.0
"""A touch that lasted longer than planned by more than this is not the planned one."""
_optional = partial(StudyQuestion, required=False)
_STATES = tuple(Label(value=state) for state in ("dry", "normal", "moist"))
OPERATOR_QUESTIONS: dict[OperatorQuestion, tuple[str, StudyQuestion]] = {
    "skin state": (
        "What is the state of the skin (dry, normal, moist)?",
        _optional(name="skin_state", kind="choice", labels=_STATES),
    ),
    "room temperature": (
        "What is the room temperature, in °C?",
        _optional(name="room_temperature", kind="number", minimum=0, maximum=50, decimals=2),
    ),
    "humidity": (
        "What is the relative humidity of the air, in %?",
        _optional(name="humidity", kind="number", minimum=0, maximum=100, decimals=2),
    ),
    "cleaning": (
        "How and when was the surface cleaned?",
        _optional(name="cleaning", kind="text", max_length=200),
    ),
}
"""How the operator is asked what the study wants to know, and what may be the answer."""


def prepare(context: SessionContext) -> None:
    """Arm the device, measure the resonance of the untouched beam, then welcome the participant.

    Raises `BadInput` if a touch would exceed a limit at the resonance of the mounted beam.
    """
    show_page(context, Notice(text="wait"))
    update_view(context)
    study = context.session.study
    # Before anything is asked, because arming turns the output off and refuses a foreign device.
    identity = context.device.arm()
    context.identity = identity.idn
    context.log.append(events.DeviceArmed(**vars(identity)))
    pace = context.device.pace
    touches = [touch for trial in context.session.plan.trials for touch in trial.touches]
    changing = any(touch.sweep_to or touch.end_voltage_v != touch.voltage_v for touch in touches)
    if why := pace.too_late(MOST_OVER_S, changing=changing) if pace else "":
        raise DeviceError(f"{why}; nothing was driven")
    update_view(context, warning="; ".join(identity.remarks))
    # Before any drive above 0 V: from here on the watchdog is relied on.
    require_watchdog(context, identity.idn)
    deciding = {group.when.question for group in study.group if group.when}
    answers: dict[str, str] = {}
    for asked in study.session.operator_asks:
        # Another answer, in a session that is resumed, would be that of another group.
        known = context.log.state.described.get(asked) if asked in deciding else None
        answer = known or _possible_answer(context, *OPERATOR_QUESTIONS[asked])
        # An empty one says that nothing was noted.
        answers[asked] = "" if answer is None else str(answer)
    if answers:
        context.log.append(events.RigDescribed(answers=answers))
        context.operator.notify(f"noted: {context.log.state.noted}")
    ask_at_desk(context)
    # Before the resonance is measured, which is that of the mounted beam.
    mount(context, study.touch.beam)
    # A generator drives nothing here: its resonance is kept in the study's folder.
    if context.device.measures_resonance:
        hands_off = "measuring the resonance: hands off the surface"
        update_view(context, warning=hands_off, busy="10 V at most, searching")
    near_hz, session = study.rig.nominal_resonance_hz, context.session
    resonance = context.device.resonance(near_hz, partial(wait, context))
    hz = resonance.frequency_hz
    context.log.append(events.ResonanceMeasured(frequency_hz=hz, tip_m_per_v=resonance.tip_m_per_v))
    # The study was checked at the nominal resonance. Drives are relative to the measured one, so
    # that limits of frequency, slew rate and current are looked at again.
    if problems := problems_at(study, hz, sliding=session.slides, volts=session.volts):
        raise BadInput(f"the resonance of this beam is {hz:.0f} Hz: {problems[0]}")
    context.resonance_hz = hz
    update_view(context, warning=tare(context))  # nobody touches the beam yet
    show_page(context, Welcome(consent=context.session.consent))
    response(context)


def _possible_answer(
    context: SessionContext, text: str, question: StudyQuestion, drawn: Callable[[], str] = str
) -> Answer:
    """Return what the operator types, once it is possible; what is `drawn` if that is nothing."""
    context.operator.ask(text)
    while True:
        try:
            return question.answer(operator_answer(context) or drawn())
        except ValueError as error:
            context.operator.ask(f"{error}. {text}")


def answered_before(session: Session) -> Iterator[events.Event]:
    """Yield what the operator answered before the session was opened, to follow its opening."""
    study, noted = session.study, session.noted
    asked: set[str] = {*study.session.operator_asks}
    if described := {name: answer for name, answer in noted.items() if name in asked}:
        yield events.RigDescribed(answers=described)
    for question in study.questions("desk"):
        if question.name in noted:
            yield _at_desk(question, question.answer(noted[question.name]))


def _at_desk(question: StudyQuestion, answer: Answer, took_s: float = 0.0) -> events.Event:
    given = QuestionAnswer(name=question.name, answer=answer, reaction_time_s=took_s, trace=None)
    return events.QuestionAnswered(when="desk", **vars(given))


def ask_at_desk(context: SessionContext) -> None:
    """Ask the operator what the study wants to know, and has not been told, until it is possible.

    With a virtual participant what nobody answers is drawn, as the participant's answers are.
    """
    session, log = context.session, context.log
    while left := _left_to_ask(context):
        question = left[0]
        began_s = context.clock.monotonic_s()
        drawn = str if session.virtual is None else partial(_drawn, session, question)
        answer = _possible_answer(context, spoken(question), question, drawn)
        # While it was asked, a correction may have answered it, or made it one that is not asked.
        if question not in _left_to_ask(context):
            continue
        log.append(_at_desk(question, answer, context.clock.monotonic_s() - began_s))
        kept = keeps_its_group(context, question.name)
        context.operator.notify(f"noted: {question.name} {answer_text(answer)}{kept}")


def _left_to_ask(context: SessionContext) -> list[StudyQuestion]:
    session, state = context.session, context.log.state
    known = known_before(session, state)
    return [
        question
        for question in session.study.questions("desk", session.number)
        if (question.name, None) not in state.questions and question.follows(known)
    ]


def _drawn(session: Session, question: StudyQuestion) -> str:
    """Return an answer at random; if the group follows from it, one that leads into the group."""
    stream = Random(f"{session.seed} {session.participant}/{session.number} {question.name}")
    rule = next((it.when for it in session.study.group if it.name == session.group), None)
    for _ in range(1_000):
        typed = KINDS[question.kind].drawn(question, stream)
        if rule is None or rule.question != question.name:
            break
        if rule.met_by({question.name: question.answer(typed)}):
            break
    return typed


def spoken(question: StudyQuestion) -> str:
    """Return a question with what may answer it, as the operator reads it.

    >>> spoken(StudyQuestion(name="age", kind="number", text={"en": "Age?"}, unit="years"))
    'Age? (years)'
    """
    low, high = question.ends
    ends = f"{low:g} to {high:g}" if low is not None and high is not None else ""
    skips = "" if question.required else "Enter skips it"
    told = ", ".join(filter(None, [*question.values, ends, question.unit, skips]))
    text = question.text.get("en") or next(iter(question.text.values()), question.name)
    return f"{text} ({told})" if told else text


def mount(context: SessionContext, beam: str | None) -> None:
    """Have the operator mount `beam`, with the output off, unless it is already mounted."""
    # After a `repeat` while this was asked, the other beam may be mounted already.
    if beam is None or (beam == context.log.state.beam and not context.beam_in_doubt):
        return
    context.beam_in_doubt = True  # and stays so if the operator does not confirm
    show_page(context, Notice(text="wait.beam"))
    context.operator.mount(beam)
    operator_answer(context)
    show_page(context, Notice(text="wait.touch"))
    context.beam_in_doubt, context.zero = False, None  # beams differ in weight
    # Once it is confirmed: the journal holds what was mounted, not what was asked for.
    context.log.append(events.BeamMounted(beam=beam))
