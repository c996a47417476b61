"""What a session needs of the world: small interfaces, each with a real and a simulated side."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from device.drivers.setpoints import Setpoint
    from device.resonance import Resonance
    from protocol.journal.records import Identity, ReadBack
    from runner.screens import Note, OperatorView, Order, Response, Screen


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

    def emergency_stop(self) -> None:
        """Send off at once, whatever the port is busy with; nothing is driven afterwards."""
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
    """Whoever serves the rig and watches over the session. No method waits."""

    def ask(self, text: str) -> None:
        """Ask for something: a beam to be mounted, the state of the skin."""
        ...

    def answered(self) -> str | None:
        """Return what was typed in answer, maybe nothing; None while it was not answered."""
        ...

    def unask(self) -> None:
        """Take back what was asked and not answered."""
        ...

    def mount(self, beam: str) -> None:
        """Ask for `beam` to be mounted; confirmed by an answer."""
        ...

    def order(self) -> Order | Note | None:
        """Return what the operator ordered since the last call, one thing at a time."""
        ...

    def see(self, view: OperatorView) -> None:
        """Show where the session stands."""
        ...

    def tell(self, text: str) -> None:
        """Show what became of an order."""
        ...
