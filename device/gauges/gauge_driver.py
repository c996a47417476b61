"""What a gauge's driver is: a source of samples behind a link of its own."""

import re
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import ClassVar

from device.errors import DeviceError
from device.force_channel.blocks import Block
from device.force_channel.samples import Scale
from device.link.link import Link, Register


class GaugeDriver(ABC):
    """Samples forces over `link`. Not thread-safe: one owner."""

    dialect: ClassVar[str]
    idn: ClassVar["re.Pattern[str]"]
    """What the answer to `*IDN?` of these gauges looks like."""
    expected: ClassVar[str]
    """The same for a person."""
    register: ClassVar[Register]
    """What the link gets into step by."""

    def __init__(self, link: Link) -> None:
        link.register = self.register
        self.link = link

    def meet(self) -> str:
        """See that the expected gauge is there, in the expected unit; return its identity.

        Raises:
            DeviceError: it is not; nothing was set.
        """
        idn = self.link.identify()
        if self.idn.match(idn) is None:
            raise DeviceError(f"expected {self.expected}, got {idn!r}")
        self.link.synchronise()
        self._require_unit()
        return idn

    @abstractmethod
    def _require_unit(self) -> None:
        """See that forces are in newtons.

        Raises:
            DeviceError: they are in something else.
        """

    @abstractmethod
    def start_sampling(self, rate_hz: float) -> Scale:
        """Set the rate and start; samples are numbered from 0. Return the size of one count."""

    @abstractmethod
    def sampled(self, first: int, checked: Callable[[Block], Block]) -> Block:
        """Ask for the samples from number `first` on; ask once more if `checked` refuses them."""

    @abstractmethod
    def stop_sampling(self) -> None:
        """Stop; what was sampled can still be asked for."""

    @abstractmethod
    def device_time_s(self) -> float:
        """Get the gauge's own time, s."""

    def close(self) -> None:
        """Give the port back."""
        self.link.close()
