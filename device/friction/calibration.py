"""What predictions take of the rig: its surface, and what a sliding experiment determined of it."""

from dataclasses import dataclass, replace
from typing import Any

from device.errors import below, not_negative, positive
from device.friction.scenes import Structure
from device.friction.surfaces import PAPERS, AnySurface, BeamSurface


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What predictions take of the rig; by default the paper's values and the model's resonance.

    The gain is volts at the beam per volt of the drive. Drives are relative to the resonance
    wherever a session measured it; `resonance_hz` is for drives in Hz, None for the rung's.
    `origin` is session and digest of the calibration, empty where nothing was fitted. `of` makes
    that of another surface, of which damping ratio and body height are the ones of its model.
    """

    surface: AnySurface = PAPERS
    damping_ratio: float = PAPERS.structure.beam.damping_ratio
    gain: float = 1.0
    body_height_m: float = PAPERS.structure.body_height_m
    resonance_hz: float | None = None
    origin: str = ""

    def __post_init__(self) -> None:
        below("damping_ratio", self.damping_ratio, 0.0, 1.0)
        positive("gain", self.gain)
        not_negative("body_height_m", self.body_height_m)
        if self.resonance_hz is not None:
            positive("resonance_hz", self.resonance_hz)

    @classmethod
    def of(cls, surface: AnySurface, **fitted: Any) -> "Calibration":
        """Return the calibration of a surface, with what was fitted in place of its own values."""
        own = surface.structure if isinstance(surface, BeamSurface) else PAPERS.structure
        values = {"damping_ratio": own.beam.damping_ratio, "body_height_m": own.body_height_m}
        return cls(surface=surface, **(values | fitted))

    def on(self, surface: AnySurface) -> "Calibration":
        """Return the same fit on another surface; what was assumed is that surface's own."""
        if self.origin:
            return replace(self, surface=surface)
        return Calibration.of(surface, gain=self.gain, resonance_hz=self.resonance_hz)

    @property
    def values(self) -> dict[str, Any]:
        """What was fitted or assumed, without the surface."""
        return {name: value for name, value in vars(self).items() if name != "surface"}

    @property
    def beam_surface(self) -> BeamSurface:
        """The beam that is touched; the paper's where friction does not come from a model."""
        return self.surface if isinstance(self.surface, BeamSurface) else PAPERS

    @property
    def structure(self) -> Structure:
        """The beam as calibrated."""
        own = self.beam_surface.structure
        return replace(
            own,
            beam=replace(own.beam, damping_ratio=self.damping_ratio),
            body_height_m=self.body_height_m,
        )

    @property
    def mode(self) -> int:
        return self.beam_surface.mode

    def __str__(self) -> str:
        """Return the values that predictions take, and where they come from."""
        resonance = "" if self.resonance_hz is None else f", resonance {self.resonance_hz:.0f} Hz"
        return (
            f"damping ratio {self.damping_ratio:.3g}, gain {self.gain:.3g}, bodies "
            f"{1e3 * self.body_height_m:.3g} mm high{resonance} ({self.origin or 'assumed'})"
        )


NOMINAL = Calibration()
