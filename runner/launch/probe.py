"""The work behind `touchbeam device`: list ports, identify a device, measure the resonance."""

import time
from collections.abc import Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from device.drivers.discovery import driver_for, driver_of
from device.drivers.driver import Driver
from device.errors import LinkTimeout
from device.link.link import HANDSHAKE_S, Link, open_link
from device.link.port import described_ports
from device.resonance import Resonance
from device.simulator.client import simulator_process
from protocol.address import SIMULATED
from protocol.errors import BadInput
from protocol.study.rig_settings import Rig as RigSettings
from runner.clock import WallClock
from runner.launch.device_access import session_rig
from runner.study.calibration import keep_calibration

BLUETOOTH = ("rfcomm", "bluetooth")


def ports() -> list[dict[str, str]]:
    """Return the serial ports of this machine, each with a hint on how to use it."""
    return [{**port, "hint": _hint(port)} for port in described_ports()]


def _hint(port: dict[str, str]) -> str:
    name = f"{port['name']} {port['description']}".lower()
    return "Bluetooth: pair the device first" if any(word in name for word in BLUETOOTH) else ""


def probed(url: str, touchbeam: Sequence[str]) -> dict[str, Any]:
    """Return the identity and status that the device at `url` reports; change nothing in it.

    Raises:
        AddressError: `url` is not the address of a device.
        ForeignDevice: there is no driver for the device.
        DeviceError: the device does not answer, or answers wrongly.
    """
    with ExitStack() as stack:
        if url == SIMULATED:
            url = stack.enter_context(simulator_process(touchbeam, seed=1)).url
        link = stack.enter_context(closing(open_link(url)))
        idn, driver = _identified(link, url)
        if not driver.register.is_a_setting:
            link.synchronise()
        health = {name: answered(link, query) for name, query in driver.health.items()}
    return {"url": url, "idn": idn, "dialect": driver.dialect, **health}


def _identified(link: Link, url: str) -> tuple[str, type[Driver]]:
    """Return who answers, and its driver; nothing else is asked, and nothing is changed."""
    try:
        idn = link.identify()
    except LinkTimeout as error:
        raise LinkTimeout(
            f"{url}: no device answered *IDN? within {HANDSHAKE_S:g} s ({error}); "
            "check that it is on and set to this speed"
        ) from error
    return idn, driver_for(idn)


def answered(link: Link, query: str) -> str | None:
    """Return the answer to `query`, None of a device that has nothing to say to it.

    A board without a thermometer, for example, answers nothing when asked for its temperature.

    Raises:
        DeviceError: the device answers nothing at all.
    """
    try:
        return link.ask(query)
    except LinkTimeout:
        if link.register.is_a_setting:
            raise
        link.synchronise()
        return None


def swept(
    url: str, near_hz: float, dialect: str, touchbeam: Sequence[str], seed: int = 1
) -> tuple[Resonance, str]:
    """Return the resonance of the beam at `url` and the device's identity; leave the output off.

    The time of the simulated device is stepped, so that the sweep takes no real time.

    Raises:
        AddressError: `url` is not the address of a device, or the dialect is unknown.
        BadInput: the device measures no vibration; its output was left as it is.
        ForeignDevice: there is no driver for the device; its output was left as it is.
        DeviceError: the device does not work, or there is no resonance near `near_hz`.
        OutputUnknown: the output could not be read back as off.
    """
    driver = driver_of(dialect)
    if driver.measures_vibration and url != SIMULATED:
        with closing(open_link(url)) as link:
            _, driver = _identified(link, url)
    if not driver.measures_vibration:
        raise BadInput(f"{driver.measures_none()}; nothing was set, the output is as it was")
    settings = RigSettings.model_validate({"dialect": dialect})
    with session_rig(url, settings, touchbeam, seed) as rig:
        sleep = rig.control.advance if rig.control is not None else time.sleep
        identity = rig.device.arm()
        return rig.device.resonance(near_hz, sleep), identity.idn


def kept(folder: Path, found: Resonance, idn: str) -> Path:
    """Store a resonance as the calibration of the study in `folder`; return the file."""
    return keep_calibration(folder, found, idn, WallClock().utc().isoformat(timespec="seconds"))
