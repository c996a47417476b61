"""Before the first touch: what the operator notes, the armed device, its beam and its resonance."""

from protocol.errors import BadInput
from protocol.journal.events import BeamMounted, DeviceArmed, ResonanceMeasured, RigDescribed
from protocol.study_file.limits import problems_at
from runner.screens import Notice, Welcome
from runner.session.session import SessionContext
from runner.session.tick import operator_answer, response, tick, update_view


def prepare(context: SessionContext) -> None:
    """Arm the device and find the beam's resonance before anybody touches it; then greet."""
    context.participant.show(Notice(text="wait"))
    update_view(context)
    study = context.session.study
    identity = context.device.arm()
    context.log.append(DeviceArmed(**vars(identity)))
    update_view(context, warning="; ".join(identity.remarks))
    if study.session.operator_asks:
        asked = study.session.operator_asks
        context.log.append(
            RigDescribed(answers={question: _told(context, question) for question in asked})
        )
    mount(context, study.touch.beam)
    update_view(context, warning="measuring the resonance: hands off the beam", searching=True)
    found = context.device.resonance(
        study.rig.nominal_resonance_hz, lambda seconds: tick(context, seconds)
    )
    context.log.append(
        ResonanceMeasured(frequency_hz=found.frequency_hz, tip_m_per_v=found.tip_m_per_v)
    )
    _require_within_limits(context, found.frequency_hz)
    context.resonance_hz = found.frequency_hz
    update_view(context)
    context.participant.show(Welcome(consent=context.session.consent))
    response(context)


def _require_within_limits(context: SessionContext, resonance_hz: float) -> None:
    """See before the first touch that no touch will break a limit on this very beam.

    Raises:
        BadInput: one would.
    """
    for problem in problems_at(context.session.study, resonance_hz):
        raise BadInput(f"the resonance of this beam is {resonance_hz:.0f} Hz: {problem}")


def mount(context: SessionContext, beam: str | None) -> None:
    """Have the operator swap beams, with the output off, unless the beam is there already."""
    if beam is None or (beam == context.log.state.beam and not context.beam_in_doubt):
        return
    context.beam_in_doubt = True
    context.operator.mount(beam)
    operator_answer(context)
    context.beam_in_doubt = False
    context.log.append(BeamMounted(beam=beam))


def _told(context: SessionContext, question: str) -> str:
    context.operator.ask(f"{question}?")
    return operator_answer(context)
