"""Session setup: arm the device, ask the operator, mount the beam, measure its resonance."""

from protocol.errors import BadInput
from protocol.journal.events import BeamMounted, DeviceArmed, ResonanceMeasured, RigDescribed
from protocol.study.rules import OperatorQuestion
from protocol.study_file.limits import problems_at
from runner.screens import Notice, Welcome
from runner.session.operator_view import update_view
from runner.session.recording import tare
from runner.session.session import SessionContext
from runner.session.waiting import operator_answer, response, wait
from runner.session.watchdog import require_watchdog

_QUESTIONS: dict[OperatorQuestion, str] = {
    "skin state": "What is the state of the skin (dry, normal, moist)?",
    "room temperature": "What is the room temperature, in °C?",
    "humidity": "What is the relative humidity of the air, in %?",
    "cleaning": "How and when was the beam cleaned?",
}
"""How the operator is asked what the study wants to know."""


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
    for question in study.session.operator_asks:
        context.operator.ask(_QUESTIONS[question])
        answers[question] = operator_answer(context)
    if answers:
        context.log.append(RigDescribed(answers=answers))
    mount(context, study.touch.beam)
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
