"""What can go wrong between us and the device."""

from protocol.errors import BadInput, WorkFailed

UNKNOWN = "output state UNKNOWN - cut the amplifier"
"""What a person is told of an output that was not read back as off."""


class AddressError(BadInput):
    """The address of a device, or its dialect, is not one that exists: the user's mistake."""


class LimitExceeded(BadInput):
    """More was asked of the device than its limits allow; nothing was sent."""


class DeviceError(WorkFailed):
    """The device, its port or its answers do not work as they must."""


class ProtocolError(DeviceError):
    """What came is no answer to what was asked."""


class LinkTimeout(DeviceError):
    """An answer did not come in time; the link is out of step until it is synchronised."""


class ForeignDevice(DeviceError):
    """Who answered is not who was expected: nothing is asked of it, nor told."""


class EmergencyStop(DeviceError):
    """Somebody pressed stop."""


class OutputUnknown(DeviceError):
    """The output could not be read back as off: only cutting the amplifier is safe."""

    def __init__(self, why: str) -> None:
        super().__init__(f"{UNKNOWN} ({why})")


class ForeignOutput(ForeignDevice, OutputUnknown):
    """Another device is where ours was to be driven; its output is not ours to ask for."""
