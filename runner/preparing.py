"""Before the first touch: what the operator notes, the armed device, its beam and its resonance."""

from dataclasses import asdict

from runner.room import Room
from runner.screens import Notice
from runner.waiting import awaited, tick
from runner.watching import show_where_we_are


def prepare(room: Room) -> None:
    """Arm the device and find the beam's resonance, before anybody touches it."""
    room.participant.show(Notice(text="welcome"))
    study = room.session.study
    room.log.append("device-armed", **asdict(room.device.arm()))
    if study.session.operator_asks:
        answers = {question: _told(room, question) for question in study.session.operator_asks}
        room.log.append("rig-described", answers=answers)
    mount(room, study.touch.beam)
    show_where_we_are(room, warning="measuring the resonance: hands off the beam")
    found = room.device.resonance(
        study.rig.nominal_resonance_hz, lambda seconds: tick(room, seconds)
    )
    room.log.append("resonance-measured", **asdict(found))
    room.resonance_hz = found.frequency_hz


def mount(room: Room, beam: str | None) -> None:
    """Have the operator swap beams, with the output off, unless the beam is there already."""
    if beam is None or beam == room.log.state.beam:
        return
    room.operator.mount(beam)
    awaited(room, room.operator.answered)
    room.log.append("beam-mounted", beam=beam)


def _told(room: Room, question: str) -> str:
    room.operator.ask(f"{question}?")
    return awaited(room, room.operator.answered)
