"""The rig of a session: a device at an address, or the simulated one with a hand on its beam."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from device.amplifier import Amplifier
from device.records import Limits
from device.rig import Rig, open_rig
from device.simulator.hand import Hand
from device.simulator.process import simulator_process
from device.sweep import Resonance
from protocol.study import Rig as RigSettings

SIMULATED = "sim"


@dataclass(frozen=True, kw_only=True)
class Rigged:
    """An open device, and the hand that moves what a wire cannot if it is a simulated one."""

    device: Rig
    hand: Hand | None


@contextmanager
def rigged(
    url: str,
    settings: RigSettings,
    touchbeam: Sequence[str],
    seed: int,
    calibration: Resonance | None = None,
) -> Iterator[Rigged]:
    """Open the device at `url`, or a simulated one for `sim`; close it on the way out.

    Args:
        url: `sim` or the address of a device.
        settings: the study's rig, whose limits the driver keeps.
        touchbeam: the command that starts touchbeam, for the simulated device.
        seed: what the simulated device's hidden properties follow from.
        calibration: the rig's resonance, for a device that cannot measure it.

    Raises:
        AddressError: `url` is no address of a device.
        DeviceError: there is no device that works.
    """
    with ExitStack() as stack:
        hand = None
        if url == SIMULATED:
            endpoints = stack.enter_context(
                simulator_process(touchbeam, seed, dialect=settings.dialect)
            )
            hand = stack.enter_context(Hand(endpoints.control))
            url = endpoints.url
        device = open_rig(url, limits(settings), settings.dialect, calibration)
        stack.callback(device.close)
        yield Rigged(device=device, hand=hand)


def limits(settings: RigSettings) -> Limits:
    """Return what the driver must never exceed on this rig."""
    return Limits(
        max_voltage_v=settings.max_voltage_v,
        max_frequency_hz=settings.max_frequency_hz,
        ramp_v_per_s=settings.ramp_v_per_s,
        watchdog_s=settings.watchdog_s,
        amplifier=_amplifier(settings),
    )


def _amplifier(settings: RigSettings) -> Amplifier:
    current_ma, load_nf = settings.max_current_ma, settings.capacitance_nf
    return Amplifier(
        gain=settings.amplifier_gain,
        max_vpp=settings.generator_max_vpp,
        max_slew_v_per_us=settings.max_slew_v_per_us,
        max_current_a=None if current_ma is None else 1e-3 * current_ma,
        load_f=1e-9 * (load_nf or 0.0),
    )
