"""What stands between the law and a sample: the finger's own skin, and the force sensor."""

import random
from dataclasses import dataclass

_GAIN_SD = 0.02


@dataclass(frozen=True, kw_only=True)
class Skin:
    """How a finger's friction differs from the law's: `mu0 · μ · (μ'/μ)^skin`; 1 is nominal."""

    mu0: float = 1.0
    skin: float = 1.0


@dataclass(frozen=True, kw_only=True)
class ForceSensor:
    """What a sample has besides the force: noise (SD), zero drift, gains, and the slide's jitter.

    Attributes:
        drift_n_per_min: of both forces, to one side for 15 min and back again.
        jitter: SD of what stick-slip multiplies the tangential force by, as a logarithm.
        jitter_s: its correlation time.
    """

    tangential_noise_n: float = 0.01
    normal_noise_n: float = 0.005
    position_noise_m: float = 1e-4
    drift_n_per_min: float = 0.01
    tangential_gain: float = 1.0
    normal_gain: float = 1.0
    jitter: float = 0.05
    jitter_s: float = 0.02

    @classmethod
    def of(cls, seed: int) -> "ForceSensor":
        """Return the sensor of the board of that seed, which its gains follow from."""
        # A stream of its own: a property that is added elsewhere leaves this sensor as it was.
        hidden = random.Random(f"force sensor/{seed}")
        gains = [1 + hidden.gauss(0, _GAIN_SD) for _ in range(2)]
        return cls(tangential_gain=gains[0], normal_gain=gains[1])
