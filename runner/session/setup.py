"""Before the first touch: what the operator notes, the armed device, its beam and its resonance."""

from dataclasses import asdict

from protocol.errors import BadInput
from protocol.study_file.limits import problems_at
from runner.screens import Notice, Welcome
from runner.session.session import Room
from runner.session.tick import operator_answer, response, show_where_we_are, tick


def prepare(room: Room) -> None:
    """Arm the device and find the beam's resonance before anybody touches it; then greet."""
    room.participant.show(Notice(text="wait"))
    show_where_we_are(room)
    study = room.session.study
    identity = room.device.arm()
    room.log.append("device-armed", **asdict(identity))
    show_where_we_are(room, warning="; ".join(identity.remarks))
    if study.session.operator_asks:
        answers = {question: _told(room, question) for question in study.session.operator_asks}
        room.log.append("rig-described", answers=answers)
    mount(room, study.touch.beam)
    show_where_we_are(room, warning="measuring the resonance: hands off the beam", searching=True)
    found = room.device.resonance(
        study.rig.nominal_resonance_hz, lambda seconds: tick(room, seconds)
    )
    room.log.append("resonance-measured", **asdict(found))
    _require_within_limits(room, found.frequency_hz)
    room.resonance_hz = found.frequency_hz
    show_where_we_are(room)
    room.participant.show(Welcome(consent=room.session.consent))
    response(room)


def _require_within_limits(room: Room, resonance_hz: float) -> None:
    """See before the first touch that no touch will break a limit on this very beam.

    Raises:
        BadInput: one would.
    """
    for problem in problems_at(room.session.study, resonance_hz):
        raise BadInput(f"the resonance of this beam is {resonance_hz:.0f} Hz: {problem}")


def mount(room: Room, beam: str | None) -> None:
    """Have the operator swap beams, with the output off, unless the beam is there already."""
    if beam is None or (beam == room.log.state.beam and not room.beam_in_doubt):
        return
    room.beam_in_doubt = True
    room.operator.mount(beam)
    operator_answer(room)
    room.beam_in_doubt = False
    room.log.append("beam-mounted", beam=beam)


def _told(room: Room, question: str) -> str:
    room.operator.ask(f"{question}?")
    return operator_answer(room)
