"""Errors of a device and its link, and checks of values that raise `OutOfRangeError`."""

import math
from collections.abc import Collection

from protocol.errors import BadInput, WorkFailed

UNKNOWN = "output state UNKNOWN - cut the amplifier"
"""The message for an output that could not be read back as off."""


class LimitExceeded(BadInput):
    """A setpoint exceeds the device's limits; nothing was sent."""


class CannotRecord(BadInput):
    """The device has no force channel; nothing was sent."""


class DeviceError(WorkFailed):
    """The device, its port or its answers do not work as required."""


class ProtocolError(DeviceError):
    """The device's reply is not a valid answer to the query."""


class LinkTimeout(DeviceError):
    """An answer did not arrive in time; the link is out of step until it is synchronised."""


class ForeignDevice(DeviceError):
    """An unexpected device answered; no further command is sent."""


class EmergencyStop(DeviceError):
    """The emergency stop was triggered."""


class OutputUnknown(DeviceError):
    """The output could not be read back as off: only cutting the amplifier is safe."""

    def __init__(self, why: str) -> None:
        super().__init__(f"{UNKNOWN} ({why})")


class OutputLastOff(OutputUnknown):
    """The device does not confirm off, but did so before, and nothing was switched on since."""

    def __init__(self, why: str) -> None:
        DeviceError.__init__(
            self,
            f"{why}; the output was off when it was last read back, and was not switched on since",
        )


# Both at once: callers that leave a foreign device alone see it, and those that alarm the operator.
class ForeignOutput(ForeignDevice, OutputUnknown):
    """An unexpected device answered; no further command is sent, so its output is unknown."""


class OutOfRangeError(BadInput):
    """A value breaks its rule: `name rule, got value`; `row` is its place in an array of values."""

    def __init__(self, name: str, rule: str, value: object, row: int = 0) -> None:
        super().__init__(f"{name} {rule}, got {value}")
        self.name = name
        self.rule = rule
        self.value = value
        self.row = row


def positive(name: str, value: float) -> None:
    """Refuse a value that is not a finite number above 0."""
    if not (math.isfinite(value) and value > 0):
        raise OutOfRangeError(name, "must be a finite number above 0", value)


def not_negative(name: str, value: float) -> None:
    """Refuse a value that is not a finite number of at least 0."""
    if not (math.isfinite(value) and value >= 0):
        raise OutOfRangeError(name, "must be a finite number of at least 0", value)


def within(name: str, value: float, low: float, high: float) -> None:
    """Refuse a value outside the closed interval [low, high]."""
    if not low <= value <= high:
        raise OutOfRangeError(name, f"must lie in [{low:g}, {high:g}]", value)


def below(name: str, value: float, low: float, high: float) -> None:
    """Refuse a value outside the open interval (low, high)."""
    if not low < value < high:
        raise OutOfRangeError(name, f"must lie strictly between {low:g} and {high:g}", value)


def whole(name: str, value: float, low: int) -> None:
    """Refuse a value that is not a whole number of at least `low`."""
    if not (math.isfinite(value) and value == int(value) and value >= low):
        raise OutOfRangeError(name, f"must be a whole number of at least {low}", value)


def one_of(name: str, value: object, allowed: Collection[str]) -> None:
    """Refuse a value that is not one of the allowed names."""
    if value not in allowed:
        raise OutOfRangeError(name, f"must be one of {', '.join(allowed)}", repr(value))
