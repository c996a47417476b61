"""A real beam that nobody touches, in a dry run: its friction is predicted from what is read back.

A virtual participant on a real device cannot feel it. It gets the friction that the model predicts
for what the device has said last about its drive, so that its answers follow what was driven.
"""

from collections.abc import Callable

from device.drivers.driver import Reading
from device.friction.changes import Moment
from device.friction.contrasts import friction_at
from protocol.study.study import Study

_FREQUENCY_DIGITS = 4
"""Of the drive relative to the resonance: each new frequency takes the model about 50 ms."""


class UntouchedBeam:
    """The finger of a virtual participant on a beam that is driven, and that nobody touches.

    Args:
        study: gives the beams, and how the finger touches.
        reading: returns what the device has said last.
        resonance_hz: returns the resonance of the mounted beam, 0 before it is known.
    """

    def __init__(
        self,
        study: Study,
        reading: Callable[[], Reading | None],
        resonance_hz: Callable[[], float],
    ) -> None:
        self._study = study
        self._reading = reading
        self._resonance_hz = resonance_hz
        self._beam = study.touch.beam
        # Loads the model, which takes longer than a touch may wait for.
        self._friction(study.touch.force_n, study.touch.smooth_place_m, "right", 0.0, 1.0)

    def mount(self, beam: str) -> None:
        """Note that the operator is to mount the study's beam `beam`."""
        self._beam = beam

    def touch(
        self,
        force_n: float,
        position_m: float,
        direction: str,
        speed_m_s: float = 0.0,  # noqa: ARG002 - it slides as fast as the study says
    ) -> float:
        """Return the friction coefficient that a finger would feel there now."""
        said, resonance_hz = self._reading(), self._resonance_hz()
        if said is None or not said.output or not resonance_hz:
            return self._friction(force_n, position_m, direction, 0.0, 1.0)
        frequency = round(said.frequency_hz / resonance_hz, _FREQUENCY_DIGITS)
        return self._friction(force_n, position_m, direction, said.amplitude_v, frequency)

    def lift(self) -> None:
        """Do nothing: no finger is there."""

    def _friction(
        self, force_n: float, position_m: float, direction: str, voltage_v: float, frequency: float
    ) -> float:
        finger = self._study.touch
        moment = Moment(
            voltage_v=voltage_v,
            frequency=frequency,
            direction="left" if direction == "left" else "right",
            coverage="local",
            force_n=force_n,
            contact_m=finger.contact_m,
            sliding_speed_m_s=finger.sliding_speed_m_s,
            has_bodies=self._beam is None or self._study.beams[self._beam] > 0,
        )
        return float(friction_at(moment, (position_m,))[0])
