"""The rig of a session, at an address or simulated, and the work behind `touchbeam device`."""

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Unpack

from device.drivers.driver import Driver, driver_for, driver_of
from device.errors import LinkTimeout
from device.gauges.owner import gauges, open_gauge
from device.link.link import HANDSHAKE_S, Link, open_link
from device.link.port import described_ports
from device.resonance import Resonance
from device.rig import Rig, open_rig
from device.simulator.client import (
    BeamControl,
    ControlClient,
    Friction,
    SimulatedSurface,
    simulator_process,
)
from device.study_limits import device_limits
from protocol.address import BAUD, SIMULATED, AddressError
from protocol.errors import BadInput
from protocol.study.rig_settings import ForceChannel
from protocol.study.rig_settings import Rig as RigSettings
from runner.clock import Clock, SteppedClock, WallClock
from runner.launch.locks import real_address, rig_lock
from runner.signals import stops_deferred
from runner.study.folder import StudyFolder

_SIMULATED_SERIAL = "SIM"
"""The serial number in the answer to `*IDN?` of each simulated device, and of no real one."""
BLUETOOTH = ("rfcomm", "bluetooth")


@dataclass(frozen=True, kw_only=True)
class SessionRig:
    """An open device, the hand on it if it is simulated (else None), and the clock it runs by."""

    device: Rig
    control: BeamControl | None
    clock: Clock = field(default_factory=WallClock)


@contextmanager
def rig_locks(url: str, force_channel: ForceChannel) -> Iterator[None]:
    """Lock device and gauge while the body runs: as `rig_lock`, and not both on one port."""
    gauge = gauge_address(force_channel, url) if url != SIMULATED else None
    if gauge and real_address(gauge) == real_address(url):
        raise AddressError(
            f"force_channel.gauge must have a port of its own, got {gauge}, the device's"
        )
    with ExitStack() as stack:
        for each in filter(None, (url, gauge)):
            stack.enter_context(rig_lock(each))
        yield


@contextmanager
def stepped_rig(
    settings: RigSettings,
    seed: int,
    calibration: Resonance | None = None,
    force_channel: ForceChannel | None = None,
    folder: Path | None = None,
    **friction: Unpack[Friction],
) -> Iterator[SessionRig]:
    """Open a simulated device as `session_rig`, in this process; time passes by `control` alone."""
    from device.simulator.in_process import InProcessDevice, InProcessHand, in_process_rig

    channel = force_channel or ForceChannel()
    touched = simulated_surface(folder)
    device = InProcessDevice(seed, settings.dialect, delay_s=lambda: 0.0, **touched, **friction)
    device.unbroken = stops_deferred
    gauge = gauges()[channel.gauge_dialect] if gauge_address(channel, SIMULATED) else None
    rig = in_process_rig(device, device_limits(settings), settings.dialect, calibration, gauge)
    try:
        hand = InProcessHand(device, rig)
        clock = SteppedClock(WallClock().utc(), hand.pass_time, hand.now_s)
        yield SessionRig(device=rig, control=hand, clock=clock)
    finally:
        rig.close()


@contextmanager
def session_rig(
    url: str,
    settings: RigSettings,
    seed: int,
    calibration: Resonance | None = None,
    force_channel: ForceChannel | None = None,
    folder: Path | None = None,
    **friction: Unpack[Friction],
) -> Iterator[SessionRig]:
    """Open the device at `url`, or a simulated one for `sim`, and close it after the body.

    The driver enforces the limits in `settings`. A simulated device is a process of its own, whose
    hidden properties follow from `seed` and `friction`, and its surface is that of the study in the
    `folder`, by default the paper's beam. The gauge of `force_channel` is opened,
    too; a device that cannot measure its resonance has that of the `calibration`. Raise
    `AddressError` for no address of device or gauge, `DeviceError` if no working device answers.
    """
    with ExitStack() as stack:
        control, channel = None, force_channel or ForceChannel()
        gauge_url = gauge_address(channel, url)
        if url == SIMULATED:
            endpoints = stack.enter_context(
                simulator_process(
                    touchbeam_command(), seed, dialect=settings.dialect, study=folder, **friction
                )
            )
            control = stack.enter_context(ControlClient(endpoints.control))
            url, gauge_url = endpoints.url, gauge_url and endpoints.gauge
        gauge = open_gauge(gauge_url, channel.gauge_dialect) if gauge_url else None
        device = open_rig(url, device_limits(settings), settings.dialect, calibration, gauge)
        stack.callback(device.close)
        yield SessionRig(device=device, control=control)


def simulated_surface(folder: Path | None) -> SimulatedSurface:
    """Return what a simulated device is told of the surface of a study in a folder."""
    if folder is None or not (place := StudyFolder(path=folder)).study_file.is_file():
        return {}
    study = place.study()
    if "surface" not in study.model_fields_set:
        return {}
    from runner.study.surface import surface_of

    return {"surface": surface_of(folder, study), "nominal_hz": study.rig.nominal_resonance_hz}


def require_real(idn: str, url: str) -> None:
    """Refuse a device that says of itself that it is simulated: nobody can feel it."""
    if idn.split(",")[2:3] == [_SIMULATED_SERIAL]:
        raise BadInput(
            f"the device at {url} is simulated ({idn}): what a person does there is a rehearsal, "
            "which no report counts; add --rehearsal, or give a real device with --device"
        )


def gauge_address(force_channel: ForceChannel, url: str) -> str | None:
    """Return the address of the gauge beside `url`, if any; refuse one that is simulated alone."""
    gauge = force_channel.gauge if force_channel.rate_hz else None
    if gauge == SIMULATED and url != SIMULATED:
        raise AddressError(
            f"force_channel.gauge = {SIMULATED!r} is for a simulated device, got {url}"
        )
    return gauge


def touchbeam_command() -> tuple[str, ...]:
    """Return the command of this installation: its script, or where there is none its module."""
    script = Path(sys.executable).with_name("touchbeam")
    return (str(script),) if script.exists() else (sys.executable, "-P", "-m", "touchbeam")


def ports() -> list[dict[str, str]]:
    """Return the serial ports of this machine, each with a hint on how to use it."""
    known = []
    for port in described_ports():
        name = f"{port['name']} {port['description']}".lower()
        is_bluetooth = any(word in name for word in BLUETOOTH)
        known.append({**port, "hint": "Bluetooth: pair the device first" if is_bluetooth else ""})
    return known


def probed(url: str) -> dict[str, Any]:
    """Return the identity and status that the device at `url` reports; change nothing in it.

    `answer_ms` is how long it took to answer.
    Raises as `link.open_link`; `ForeignDevice` without a driver, `DeviceError` for wrong answers.
    """
    with ExitStack() as stack:
        if url == SIMULATED:
            url = stack.enter_context(simulator_process(touchbeam_command(), seed=1)).url
        link = stack.enter_context(closing(open_link(url)))
        idn, driver = _identified(link, url)
        if not driver.register.is_a_setting:
            link.synchronise(HANDSHAKE_S)
            link.keep_pace()
        health = {name: answered(link, query) for name, query in driver.health.items()}
        answer_ms = round(1e3 * link.answer_s, 1)
    return {"url": url, "idn": idn, "dialect": driver.dialect, "answer_ms": answer_ms, **health}


def _identified(link: Link, url: str) -> tuple[str, type[Driver]]:
    """Return who answers, and its driver; nothing else is asked, and nothing is changed."""
    try:
        idn = link.identify()
    except LinkTimeout as error:
        raise LinkTimeout(
            f"{url}: no device answered *IDN? within {HANDSHAKE_S:g} s ({error}); "
            f"check that it is on, and set to {BAUD:,} baud on a serial line"
        ) from error
    return idn, driver_for(idn)


def answered(link: Link, query: str) -> str | None:
    """Return the answer to `query`; None if a working device has none, as of temperature."""
    try:
        return link.ask(query)
    except LinkTimeout:
        if link.register.is_a_setting:
            raise
        link.synchronise()
        return None


def swept(url: str, near_hz: float, dialect: str) -> tuple[Resonance, str]:
    """Return the resonance of the beam at `url` and the device's identity; leave the output off.

    Raise `AddressError` for a wrong address or dialect; `BadInput` for a device that measures no
    vibration and `ForeignDevice` for an unknown one, their outputs as they were; and `DeviceError`.
    """
    driver = driver_of(dialect)
    if driver.measures_vibration and url != SIMULATED:
        with closing(open_link(url)) as link:
            _, driver = _identified(link, url)
    if not driver.measures_vibration:
        raise BadInput(f"{driver.measures_none()}; nothing was set, the output is as it was")
    settings = RigSettings.model_validate({"dialect": dialect})
    with session_rig(url, settings, seed=1) as rig:
        sleep = rig.control.advance if rig.control is not None else time.sleep
        identity = rig.device.arm()
        return rig.device.resonance(near_hz, sleep), identity.idn
