"""The rig's own properties, where a sliding experiment has determined them."""

from dataclasses import dataclass

from device.beam.beam import Beam
from device.errors import below, not_negative, positive
from device.friction.scenes import Structure


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What predictions take of the rig; by default the paper's values and the model's resonance.

    Drives are relative to the resonance wherever a session measured it; `resonance_hz` is for
    drives in Hz.

    Attributes:
        damping_ratio: ζ.
        gain: volts at the beam per volt of the drive.
        body_height_m: height of the ciliary bodies.
        resonance_hz: of the rig; None is that of the rung in use.
        origin: session and digest of the calibration, empty for the paper's values.
    """

    damping_ratio: float = Beam().damping_ratio
    gain: float = 1.0
    body_height_m: float = Structure().body_height_m
    resonance_hz: float | None = None
    origin: str = ""

    def __post_init__(self) -> None:
        below("damping_ratio", self.damping_ratio, 0.0, 1.0)
        positive("gain", self.gain)
        not_negative("body_height_m", self.body_height_m)
        if self.resonance_hz is not None:
            positive("resonance_hz", self.resonance_hz)

    def __str__(self) -> str:
        """Return the values that predictions take, and where they come from."""
        resonance = "" if self.resonance_hz is None else f", resonance {self.resonance_hz:.0f} Hz"
        return (
            f"damping ratio {self.damping_ratio:.3g}, gain {self.gain:.3g}, bodies "
            f"{1e3 * self.body_height_m:.3g} mm high{resonance} ({self.origin or 'assumed'})"
        )


NOMINAL = Calibration()
