"""What is journalled of a virtual person and of the world that it touches."""

from device.people.person import PARAMETERS, Person
from device.people.world import World
from protocol.journal.records import VirtualTruth


def truth_of(person: Person, world: World) -> VirtualTruth:
    """Return the true parameters of a person and of a simulated beam."""
    return VirtualTruth(
        **vars(person),
        law=world.law,
        rung=world.rung,
        damping_ratio=world.damping_ratio,
        beam_gain=world.gain,
    )


def person_of(truth: VirtualTruth) -> Person:
    """Return the person with these true parameters."""
    known = {name: getattr(truth, name) for name in PARAMETERS}
    return Person(**{name: value for name, value in known.items() if value is not None})
