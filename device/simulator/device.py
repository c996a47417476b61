"""The simulated device as a whole: dialect, beam, faults and control, without any I/O."""

import json
import time
from collections.abc import Callable
from functools import cache, partial
from typing import Unpack

from device.drivers.driver import defined_in
from device.errors import DeviceError
from device.link.codec import text
from device.simulator.client import Touched
from device.simulator.faults import ERROR, NAMES, Broken
from device.simulator.hardware.beam_and_finger import SimulatedBeam
from device.simulator.hardware.power_stage import DeviceClock, Instrument
from device.simulator.models.dialect import Dialect
from device.simulator.models.gauge_model import GaugeModel
from device.simulator.models.generator_model import GeneratorDialect
from device.simulator.models.scpi import ScpiError


class Control:
    """Moves what no wire can, such as the finger, the beam and time: by lines, answered in JSON."""

    def __init__(self, broken: Broken, clock: DeviceClock) -> None:
        self._broken = broken
        self._instrument = broken.instrument
        self._beam = broken.beam
        self._clock = clock
        self._commands: dict[str, Callable[..., object]] = {
            "state": self._state,
            "truth": self._beam.truth,
            "touch": self._touch,
            "lift": self._beam.lift,
            "sensor": lambda name, value: self._beam.change(name, float(value)),
            "beam": lambda body_spacing_m: self._beam.swap(float(body_spacing_m)),
            "advance": self._advance,
            "reset": self._reset,
            "fault": self._fault,
            "faults": lambda: list(NAMES),
        }

    def answer(self, line: str) -> str:
        """Return the JSON line that answers `line`; a bad one answers with `error`."""
        name, *arguments = line.split() or [""]
        if name not in self._commands:
            known = ", ".join(self._commands)
            return json.dumps({"error": f"unknown command {name!r}; known: {known}"})
        try:
            told = self._commands[name](*arguments)
        except (TypeError, ValueError) as error:
            return json.dumps({"error": str(error)})
        return json.dumps({"ok": True} if told is None else told)

    def _state(self) -> dict[str, object]:
        instrument = self._instrument
        return {
            "output": instrument.output,
            "voltage_v": instrument.output_v,
            "monitor_v": self._beam.monitor_v(instrument),
            "frequency_hz": instrument.frequency_hz,
            "boot": instrument.boot,
            "watchdog_s": instrument.watchdog_s,
            "fault": ",".join(sorted(self._broken.active)) or None,
            "tripped": instrument.tripped,
            "cause": instrument.cause,
            "heard_wall_s": instrument.heard_wall_s,
            "tripped_wall_s": instrument.tripped_wall_s,
            "time_s": instrument.time_s,
        }

    def _touch(
        self, force_n: str, position_m: str, direction: str = "right", speed_m_s: str = "0"
    ) -> dict[str, object]:
        """Put the finger down; answers with the friction coefficient that it feels there."""
        self._beam.touch(
            float(force_n), float(position_m), direction, float(speed_m_s), self._instrument.time_s
        )
        return {"friction_coefficient": self._beam.friction_coefficient(self._instrument)}

    def _advance(self, seconds: str) -> dict[str, object]:
        self._clock.step(float(seconds))
        return {"time_s": self._clock.now_s()}

    def _fault(self, name: str, state: str) -> dict[str, object]:
        if state not in {"on", "off"}:
            raise ValueError(f"a fault is switched on or off, got {state!r}")
        self._broken.switch(name, on=state == "on")
        return {"fault": name, "on": name in self._broken.active}

    def _reset(self) -> None:
        """Without faults, as after power has come, with nobody touching; the boot counter stays."""
        self._broken.clear()
        self._broken.dialect.restart()
        self._instrument.boot -= 1
        self._beam.lift()


@cache
def dialects() -> dict[str, Callable[[Instrument, SimulatedBeam], Dialect]]:
    """Return what models each dialect.

    A driver's module has what a manual says, as `MODELS`; a dialect with a grammar of its own is a
    module in `models` that defines `MODELS`. Both are found by being there.
    """
    found: dict[str, Callable[[Instrument, SimulatedBeam], Dialect]] = {
        name: partial(GeneratorDialect, model)
        for models in defined_in("device.drivers", "MODELS")
        for name, model in models.items()
    }
    for models in defined_in("device.simulator.models", "MODELS"):
        found |= models
    return dict(sorted(found.items()))


class SimulatedDevice:
    """A device of a dialect, with a beam as in `SimulatedBeam`, beside a gauge."""

    def __init__(
        self,
        seed: int,
        wall_s: Callable[[], float] = time.monotonic,
        dialect: str = "board",
        **friction: Unpack[Touched],
    ) -> None:
        self.instrument, self.beam = Instrument(), SimulatedBeam(seed, **friction)
        self.clock = DeviceClock(wall_s)
        self.dialect = dialects()[dialect](self.instrument, self.beam)
        self.gauge = GaugeModel(self.instrument, self.beam)
        self.broken = Broken(self.instrument, self.beam, self.dialect, self.gauge, wall_s)
        self.control = Control(self.broken, self.clock)

    def answer(self, line: str, wall_s: float) -> str | None:
        """Take one line from the wire; any line keeps the watchdog quiet."""
        self.instrument.watch(wall_s)
        self.instrument.heard_wall_s = wall_s
        self.pass_time()
        answer = self.dialect.answer(line)
        if "error-after-set" in self.broken.active and "?" not in line:
            self.dialect.status.complain(ERROR)
        return answer

    def answer_bytes(self, line: bytes, wall_s: float) -> str | None:
        """Take one line as it came; one that is not ASCII goes into the error queue."""
        try:
            return self.answer(text(line), wall_s)
        except DeviceError:
            self.dialect.status.complain(ScpiError(-101, "Invalid character"))
            return None

    def answer_control(self, line: str) -> str:
        self.pass_time()
        answer = self.control.answer(line)
        self.pass_time()
        return answer

    def pass_time(self) -> None:
        now_s = self.clock.now_s()
        self.dialect.passes(now_s)
        if self.gauge.sampler.on:
            self.gauge.sampler.take_until(now_s, self.instrument)
        self.instrument.advance_to(now_s)
        self.dialect.follow()
