"""The simulated device as a whole: dialect, beam, faults and control, without any I/O."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from device.drivers.discovery import defined_in
from device.errors import DeviceError
from device.friction.contrasts import LAW, RUNG
from device.link.codec import text
from device.simulator.control import Control
from device.simulator.faults import Broken
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.power_stage import DeviceClock, Instrument
from device.simulator.models.dialect import Dialect
from device.simulator.models.gauge_model import GaugeModel
from device.simulator.models.scpi import ScpiError

Model = Callable[[Instrument, SimulatedBeam], Dialect]
_ERROR_AFTER_SET = ScpiError(-310, "System error")


@dataclass(frozen=True, kw_only=True)
class SimulatedDevice:
    """What is inside the device."""

    instrument: Instrument
    beam: SimulatedBeam
    dialect: Dialect
    broken: Broken
    control: Control
    clock: DeviceClock
    gauge: GaugeModel

    def answer(self, line: str, wall_s: float) -> str | None:
        """Take one line from the wire; any line keeps the watchdog quiet."""
        self.instrument.watch(wall_s)
        self.instrument.heard_wall_s = wall_s
        self.pass_time()
        answer = self.dialect.answer(line)
        if "error-after-set" in self.broken.active and "?" not in line:
            self.dialect.status.complain(_ERROR_AFTER_SET)
        return answer

    def answer_bytes(self, line: bytes, wall_s: float) -> str | None:
        """Take one line as it came; one that is not ASCII goes into the error queue."""
        try:
            return self.answer(text(line), wall_s)
        except DeviceError:
            self.complain(ScpiError(-101, "Invalid character"))
            return None

    def complain(self, error: ScpiError) -> None:
        """Put an error of the wire's into the queue."""
        self.dialect.status.complain(error)

    def answer_control(self, line: str) -> str:
        """Take one line from the control socket."""
        self.pass_time()
        answer = self.control.answer(line)
        self.pass_time()
        return answer

    def pass_time(self) -> None:
        """Bring the device to the present moment of its clock."""
        now_s = self.clock.now_s()
        self.dialect.passes(now_s)
        if self.gauge.sampler.on:
            self.gauge.sampler.take_until(now_s, self.instrument)
        self.instrument.advance_to(now_s)
        self.dialect.follow()


@cache
def dialects() -> dict[str, Model]:
    """Return what models each dialect. A module in `models` that defines `MODELS` is found."""
    found = defined_in("device.simulator.models", "MODELS")
    return {dialect: model for models in found for dialect, model in models.items()}


def simulated_device(
    seed: int,
    wall_s: Callable[[], float] = time.monotonic,
    dialect: str = "board",
    *,
    law: str = LAW,
    rung: str = RUNG,
    damping_ratio: float | None = None,
) -> SimulatedDevice:
    """Return a device with a beam as in `SimulatedBeam`."""
    instrument, beam = Instrument(), SimulatedBeam(seed, law, rung, damping_ratio)
    clock = DeviceClock(wall_s)
    spoken = dialects()[dialect](instrument, beam)
    gauge = GaugeModel(instrument, beam)
    broken = Broken(instrument=instrument, beam=beam, dialect=spoken, gauge=gauge, wall_s=wall_s)
    return SimulatedDevice(
        instrument=instrument,
        beam=beam,
        dialect=spoken,
        broken=broken,
        control=Control(broken, clock),
        clock=clock,
        gauge=gauge,
    )
