"""The drivers, one dialect a file. A module here that defines `DRIVER` is found by being here."""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from device.drivers.driver import Driver
from device.errors import ForeignDevice
from protocol.address import AddressError


def defined_in(package: str, name: str) -> list[Any]:
    """Return what the modules of `package` define as `name`; not every one does."""
    folder = import_module(package).__path__
    # A new dialect is a new file and nothing else: no list of drivers has to be kept.
    modules = [import_module(f"{package}.{entry.name}") for entry in iter_modules(folder)]
    return [getattr(module, name) for module in modules if hasattr(module, name)]


@cache
def drivers() -> dict[str, type[Driver]]:
    """Return the drivers by dialect."""
    return {driver.dialect: driver for driver in defined_in("device.drivers", "DRIVER")}


def driver_of(dialect: str) -> type[Driver]:
    """Return the driver of `dialect`.

    Raises:
        AddressError: there is none.
    """
    if dialect not in drivers():
        known = ", ".join(drivers())
        raise AddressError(f"the dialect must be one of {known}, got {dialect!r}")
    return drivers()[dialect]


def driver_for(idn: str) -> type[Driver]:
    """Return the driver for a device that answers `*IDN?` with `idn`.

    Raises:
        ForeignDevice: there is none.
    """
    for driver in drivers().values():
        if driver.idn.match(idn):
            return driver
    known = "; ".join(driver.expected for driver in drivers().values())
    raise ForeignDevice(f"expected one of: {known}; got {idn!r}; nothing else was sent")
