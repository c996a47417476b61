"""What a session needs of the world: small interfaces, each with a real and a simulated side."""

from collections.abc import Callable
from datetime import datetime
from typing import Protocol

from device.records import Identity, ReadBack, Setpoint
from device.sweep import Resonance
from runner.screens import Response, Screen


class Device(Protocol):
    """The device under the finger. Every method raises `DeviceError` if it cannot be trusted."""

    def arm(self) -> Identity:
        """Turn the output off, see who answers, set limits and watchdog."""
        ...

    def resonance(self, near_hz: float, sleep: Callable[[float], None]) -> Resonance:
        """Find the resonance near `near_hz`, untouched; off afterwards."""
        ...

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Set, switch on, read back."""
        ...

    def read_back(self) -> ReadBack:
        """Get drive and sensors."""
        ...

    def off(self) -> None:
        """Turn the output off and read it back; raises `OutputUnknown` if that fails."""
        ...

    def beat(self) -> None:
        """Say that the session is alive; raises if the device has failed meanwhile."""
        ...


class Participant(Protocol):
    """Whoever touches and answers. Neither method waits."""

    def show(self, screen: Screen) -> None:
        """Put `screen` before the participant."""
        ...

    def poll(self) -> Response | None:
        """Return the answer to the last screen, None while there is none."""
        ...


class Operator(Protocol):
    """Whoever serves the rig."""

    def mount(self, beam: str) -> None:
        """Ask for `beam` to be mounted; never waits."""
        ...

    def mounted(self) -> bool:
        """Return whether the beam asked for is in place."""
        ...


class Clock(Protocol):
    """Time as the session sees it."""

    def utc(self) -> datetime:
        """Return the date and time, UTC."""
        ...

    def monotonic_s(self) -> float:
        """Return seconds that never run backwards."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        ...


class Journal(Protocol):
    """Where a session's events go: `append` returns once the event is safe."""

    def append(self, tag: str, **payload: object) -> None:
        """Add an event; raises `NotAllowed` if the session's state does not permit it."""
        ...
