"""A change that a trial makes: what the finger feels before, and after. Plain records."""

from dataclasses import dataclass
from typing import Literal

Effect = Literal["friction", "depth", "places"]


@dataclass(frozen=True, kw_only=True)
class Moment:
    """What the finger meets: amplitude, drive relative to the resonance, and how it touches.

    `has_bodies` says whether the beam carries ciliary bodies: no law here knows their spacing.
    """

    voltage_v: float
    frequency: float
    direction: Literal["right", "left"]
    coverage: Literal["local", "full"]
    force_n: float
    contact_m: float
    sliding_speed_m_s: float
    has_bodies: bool


@dataclass(frozen=True, kw_only=True)
class Change:
    """From one moment to another, felt at `places_m` (right edges of the finger, m).

    - `friction`: mean of `ln(mu_before / mu_after)`;
    - `depth`: growth of the modulation depth `rms ln(mu(x) / mu)`;
    - `places`: `rms ln(mu_after(x) / mu_before(x))`.

    `contrary` turns the sign: the opposite change is the expected one.
    """

    effect: Effect
    contrary: bool
    before: Moment
    after: Moment
    places_m: tuple[float, ...]
