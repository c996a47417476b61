"""A scene: the structure, its drive, and the finger that touches it.

Defaults are the paper's (Tables 1 to 3). Assumed, not in the paper: the body height (1 mm), the
place (the second trough left of the patches), and the sliding speed, which the paper does not give;
`REFERENCE_SPEED_M_S` makes the anisotropy ½ in the paper's own scene.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from device.beam.beam import Beam
from device.errors import not_negative, one_of, positive, whole, within

Coverage = Literal["local", "full"]
Direction = Literal["right", "left"]
AtResonance = Literal["resonance"]

REFERENCE_TIP_SPEED_M_S = 0.0564616714013556
REFERENCE_SPEED_M_S = REFERENCE_TIP_SPEED_M_S / math.sqrt(2.0)


@dataclass(frozen=True, kw_only=True)
class Structure:
    """The touch beam, its ciliary bodies and the friction coefficient μ with the drive off."""

    beam: Beam = field(default_factory=Beam)
    body_count: int = 20
    body_mass_kg: float = 0.01
    body_height_m: float = 1e-3
    friction_coefficient: float = 0.4

    def __post_init__(self) -> None:
        whole("body_count", self.body_count, 1)
        not_negative("body_mass_kg", self.body_mass_kg)
        not_negative("body_height_m", self.body_height_m)
        positive("friction_coefficient", self.friction_coefficient)


@dataclass(frozen=True, kw_only=True)
class Drive:
    """The signal's amplitude and frequency, by default the rung's resonance of the `mode`."""

    voltage_v: float = 100.0
    frequency_hz: float | AtResonance = "resonance"
    mode: int = 6

    def __post_init__(self) -> None:
        not_negative("voltage_v", self.voltage_v)
        whole("mode", self.mode, 1)
        if isinstance(self.frequency_hz, str):
            one_of("frequency_hz", self.frequency_hz, ("resonance",))
        else:
            positive("frequency_hz", self.frequency_hz)


@dataclass(frozen=True, kw_only=True)
class FingerContact:
    """The finger: its right edge, covered length, load and speed.

    `body_load_n` is the paper's static load on each body. A `finger_load_n`, where given, replaces
    it in the repaired laws: the load per metre is then load over contact.
    """

    x_m: float = 0.0414
    contact_m: float = 0.01
    body_load_n: float = 20.0
    finger_load_n: float | None = None
    sliding_speed_m_s: float = REFERENCE_SPEED_M_S

    def __post_init__(self) -> None:
        not_negative("x_m", self.x_m)
        positive("contact_m", self.contact_m)
        positive("body_load_n", self.body_load_n)
        if self.finger_load_n is not None:
            positive("finger_load_n", self.finger_load_n)
        positive("sliding_speed_m_s", self.sliding_speed_m_s)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """A whole scene. `same_direction_fraction`, if given, is a/u under full coverage."""

    structure: Structure = field(default_factory=Structure)
    drive: Drive = field(default_factory=Drive)
    touch: FingerContact = field(default_factory=FingerContact)
    coverage: Coverage = "local"
    direction: Direction = "right"
    same_direction_fraction: float | None = None

    def __post_init__(self) -> None:
        one_of("coverage", self.coverage, get_args(Coverage))
        one_of("direction", self.direction, get_args(Direction))
        within("x_m", self.touch.x_m, 0.0, self.structure.beam.length_m)
        if self.same_direction_fraction is not None:
            within("same_direction_fraction", self.same_direction_fraction, 0.0, 1.0)
