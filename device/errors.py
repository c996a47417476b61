"""What can go wrong between us and the device."""

from protocol.errors import BadInput, WorkFailed


class AddressError(BadInput):
    """The address of a device is not one that can be opened: the user's mistake."""


class DeviceError(WorkFailed):
    """The device, its port or its answers do not work as they must."""


class LinkTimeout(DeviceError):
    """An answer did not come in time; the link is out of step from here on."""


class OutputUnknown(DeviceError):
    """The output could not be read back as off: only cutting the amplifier is safe."""

    def __init__(self, why: str) -> None:
        super().__init__(f"output state UNKNOWN - cut the amplifier ({why})")
