"""The interfaces of a session: device, participant, operator; each real or simulated."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, Protocol

if TYPE_CHECKING:
    from device.drivers.limits import Setpoint
    from device.force_channel.samples import Forces, Samples
    from device.resonance import Resonance
    from protocol.journal.records import Identity, ReadBack
    from runner.screens import Note, OperatorView, Order, OwnFinger, Response, Screen


AnswerSource = Literal["window", "console", "virtual"]
"""Where the participant answers, if it is one."""


class Device(Protocol):
    """The device under the finger. Every method raises `DeviceError` if it cannot be trusted."""

    def arm(self) -> Identity:
        """Turn the output off, identify the device, set limits and watchdog."""
        ...

    @property
    def has_watchdog(self) -> bool:
        """Whether the device turns its output off by itself when it hears nothing."""
        ...

    def watchdog_trips(self, meanwhile: Callable[[], None]) -> bool:
        """Return whether it does so, tried with the output on at 0 V; leave the output off.

        `meanwhile` is called again and again; an error that it raises stops the test.
        """
        ...

    @property
    def measures_resonance(self) -> bool:
        """Whether `resonance` drives the beam; else it is the one kept as the rig's calibration."""
        ...

    def resonance(self, near_hz: float, sleep: Callable[[float], None]) -> Resonance:
        """Find the resonance of the untouched beam near `near_hz`; leave the output off."""
        ...

    def drive(self, setpoint: Setpoint) -> ReadBack:
        """Apply `setpoint`, switch the output on, and read it back."""
        ...

    def read_back(self) -> ReadBack:
        """Read the drive and the sensors."""
        ...

    def record(self, rate_hz: int, clock_s: Callable[[], float] | None = None) -> None:
        """Record the force channel from now on; raises `CannotRecord` if the device has none.

        `clock_s` is the session's clock, to which that of the samples is related.
        """
        ...

    def recorded(self) -> Samples:
        """Stop recording, and return everything since `record`."""
        ...

    @property
    def forces(self) -> Forces | None:
        """The newest forces; None while nothing is recorded."""
        ...

    def off(self) -> None:
        """Turn the output off and read it back; raises `OutputUnknown` if that fails."""
        ...

    def emergency_stop(self) -> None:
        """Turn the output off at once, even if the port is busy; refuse every later drive."""
        ...

    def beat(self) -> None:
        """Keep the watchdog fed; raise the device's failure, if there was one."""
        ...


class Participant(Protocol):
    """The person who touches the beam and answers, or a simulation. No method blocks."""

    def show(self, screen: Screen) -> None:
        """Show `screen` to the participant."""
        ...

    def progress(self, number: int, total: int) -> None:
        """Tell the participant that the `number`-th of `total` trials comes next."""
        ...

    def saved(self) -> None:
        """Tell the participant that the journal has the answer to the current screen."""
        ...

    def felt(self, finger: OwnFinger) -> None:
        """Show the participant their own finger during a touch."""
        ...

    def poll(self) -> Response | None:
        """Return the answer to the current screen, None before it is given."""
        ...


class Operator(Protocol):
    """The person who supervises the rig and the session. No method blocks."""

    def ask(self, text: str) -> None:
        """Ask a question, such as the state of the skin."""
        ...

    def answered(self) -> str | None:
        """Return the answer, which may be empty; None before it is given."""
        ...

    def withdraw_question(self) -> None:
        """Withdraw the open question, if there is one."""
        ...

    def mount(self, beam: str) -> None:
        """Ask the operator to mount `beam`; the answer confirms it."""
        ...

    def confirm(self, text: str) -> None:
        """Ask the operator to do what `text` says; the answer confirms it."""
        ...

    def order(self) -> Order | Note | None:
        """Return the operator's next order, None if there is none."""
        ...

    def show(self, view: OperatorView) -> None:
        """Show the session's progress."""
        ...

    def notify(self, text: str) -> None:
        """Show the result of an order."""
        ...

    def pausing(self, wanted: bool) -> None:
        """Show whether the session pauses before the next trial."""
        ...
