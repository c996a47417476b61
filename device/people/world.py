"""The world that virtual people touch: a beam's law, rung and hidden properties, and their skin."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from device.beam.beam import Beam
from device.beam.modes import FloatArray
from device.friction.contact import contact_of
from device.friction.contrasts import LAW, RUNG
from device.friction.prediction import LawChoice, law_state
from device.friction.rungs import rung_field, rung_resonance_hz
from device.friction.scenes import Direction, Drive, Scene, Structure

MODE = 6
BODY_HEIGHT_M = 1e-3


@dataclass(frozen=True, kw_only=True)
class World:
    """What a simulated beam obeys, which need not be what the analysis assumes.

    `gain` is how much of the amplitude reaches the beam. The beam's resonance is not among it:
    drives are relative to it.
    """

    law: str = LAW
    rung: str = RUNG
    damping_ratio: float = field(default_factory=lambda: Beam().damping_ratio)
    gain: float = 1.0

    @cached_property
    def beam(self) -> Beam:
        """The paper's beam with this damping."""
        return Beam(damping_ratio=self.damping_ratio)

    @property
    def resonance_hz(self) -> float:
        """The resonance of the paper's beam on this rung."""
        return rung_resonance_hz(self.rung, Beam(), MODE)


Number = FloatArray | float


@dataclass(frozen=True, kw_only=True, eq=False)
class Fingers:
    """Fingers on the beam; arrays of shape (n,), or numbers that are those of all of them.

    `voltage_v` is the amplitude that was asked for.
    """

    place_m: FloatArray
    force_n: Number
    speed_m_s: Number
    voltage_v: FloatArray
    body_height_m: Number
    skin: Number
    mu0: Number


def felt_friction(
    world: World, fingers: Fingers, model_hz: float, direction: Direction
) -> FloatArray:
    """Return the friction coefficient `mu0 · μ · (μ'/μ)^skin` that each finger feels, shape (n,).

    `model_hz` is the frequency of the drive where `world.resonance_hz` is that of the beam.
    """
    choice, structure = LawChoice(name=world.law), Structure(beam=world.beam)
    resting = structure.friction_coefficient
    if not (fingers.voltage_v.any() or choice.law.as_printed):  # at rest no rung need be set up
        return np.asarray(fingers.mu0 * resting * np.ones(fingers.place_m.shape))
    drive = Drive(voltage_v=world.gain, frequency_hz=model_hz, mode=MODE)
    contact = replace(
        contact_of(Scene(structure=structure, direction=direction), fingers.place_m),
        finger_load_n=fingers.force_n,
        body_height_m=fingers.body_height_m,
        sliding_speed_m_s=fingers.speed_m_s,
    )
    field = rung_field(world.rung, world.beam, drive).scaled(fingers.voltage_v)
    driven = choice.law(law_state(contact, field, world.rung, choice).terms)
    size = np.abs(driven / resting) ** fingers.skin
    return np.asarray(fingers.mu0 * resting * np.copysign(size, driven))
