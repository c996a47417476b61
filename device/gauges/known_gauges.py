"""The gauges, one dialect a file. A module here that defines `GAUGE` is found by being here."""

from functools import cache

from device.drivers.discovery import defined_in
from device.gauges.owner import GaugeDriver, GaugeOwner
from device.link.link import open_link
from protocol.address import AddressError


@cache
def gauges() -> dict[str, type[GaugeDriver]]:
    """Return the drivers of gauges by dialect."""
    return {driver.dialect: driver for driver in defined_in("device.gauges", "GAUGE")}


def open_gauge(url: str, dialect: str) -> GaugeOwner:
    """Return the gauge at `url`; a rig that is armed asks who it is.

    Raises:
        AddressError: `url` is no address of a gauge, or there is no such dialect.
        DeviceError: nothing can be opened there.
    """
    if dialect not in gauges():
        known = ", ".join(gauges())
        raise AddressError(f"the dialect of a gauge must be one of {known}, got {dialect!r}")
    return GaugeOwner(gauges()[dialect](open_link(url)))
