"""Session setup: arm the device, ask the operator, mount the beam, measure its resonance."""

from protocol.errors import BadInput
from protocol.journal.events import BeamMounted, DeviceArmed, ResonanceMeasured, RigDescribed
from protocol.study.rules import OperatorQuestion
from protocol.study.study_question import Label, StudyQuestion
from protocol.study_file.limits import problems_at
from runner.screens import Notice, Welcome
from runner.session.operator_view import update_view
from runner.session.recording import tare
from runner.session.session import SessionContext
from runner.session.waiting import operator_answer, response, wait
from runner.session.watchdog import require_watchdog

_QUESTIONS: dict[OperatorQuestion, tuple[str, StudyQuestion]] = {
    "skin state": (
        "What is the state of the skin (dry, normal, moist)?",
        StudyQuestion(
            name="skin_state",
            kind="choice",
            labels=tuple(Label(value=state) for state in ("dry", "normal", "moist")),
            required=False,
        ),
    ),
    "room temperature": (
        "What is the room temperature, in °C?",
        StudyQuestion(
            name="room_temperature",
            kind="number",
            minimum=0,
            maximum=50,
            decimals=2,
            required=False,
        ),
    ),
    "humidity": (
        "What is the relative humidity of the air, in %?",
        StudyQuestion(
            name="humidity", kind="number", minimum=0, maximum=100, decimals=2, required=False
        ),
    ),
    "cleaning": (
        "How and when was the beam cleaned?",
        StudyQuestion(name="cleaning", kind="text", max_length=200, required=False),
    ),
}
"""How the operator is asked what the study wants to know, and what may be the answer."""


def prepare(context: SessionContext) -> None:
    """Arm the device, measure the resonance of the untouched beam, then welcome the participant.

    Raises:
        BadInput: a touch would exceed a limit at the resonance of the mounted beam.
    """
    context.participant.show(Notice(text="wait"))
    update_view(context)
    study = context.session.study
    identity = context.device.arm()
    context.identity = identity.idn
    context.log.append(DeviceArmed(**vars(identity)))
    update_view(context, warning="; ".join(identity.remarks))
    require_watchdog(context, identity.idn)
    answers: dict[str, str] = {}
    for asked in study.session.operator_asks:
        answers[asked] = _noted(context, asked)
    if answers:
        context.log.append(RigDescribed(answers=answers))
        context.operator.notify(f"noted: {context.log.state.noted}")
    mount(context, study.touch.beam)
    if context.device.measures_resonance:
        update_view(
            context,
            warning="measuring the resonance: hands off the beam",
            busy="10 V at most, searching",
        )
    found = context.device.resonance(
        study.rig.nominal_resonance_hz, lambda seconds: wait(context, seconds)
    )
    hz = found.frequency_hz
    context.log.append(ResonanceMeasured(frequency_hz=hz, tip_m_per_v=found.tip_m_per_v))
    for problem in problems_at(study, hz, sliding=context.session.slides):
        raise BadInput(f"the resonance of this beam is {hz:.0f} Hz: {problem}")
    context.resonance_hz = hz
    update_view(context, warning=tare(context))  # nobody touches the beam yet
    context.participant.show(Welcome(consent=context.session.consent))
    response(context)


def _noted(context: SessionContext, asked: OperatorQuestion) -> str:
    """Ask until the answer is possible; an empty one says that nothing was noted."""
    text, question = _QUESTIONS[asked]
    context.operator.ask(text)
    while True:
        try:
            answer = question.answer(operator_answer(context))
        except ValueError as error:
            context.operator.ask(f"{error}. {text}")
        else:
            return "" if answer is None else str(answer)


def mount(context: SessionContext, beam: str | None) -> None:
    """Have the operator mount `beam`, with the output off, unless it is already mounted."""
    if beam is None or (beam == context.log.state.beam and not context.beam_in_doubt):
        return
    context.beam_in_doubt = True  # and stays so if the operator does not confirm
    context.participant.show(Notice(text="wait.beam"))
    context.operator.mount(beam)
    operator_answer(context)
    context.participant.show(Notice(text="wait.touch"))
    context.beam_in_doubt, context.zero = False, None  # beams differ in weight
    context.log.append(BeamMounted(beam=beam))
