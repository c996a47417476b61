"""The control side-channel: one line in, one JSON line out. It moves what a wire cannot."""

import json
from collections.abc import Callable

from device.simulator.beam import SimulatedBeam
from device.simulator.clock import DeviceClock
from device.simulator.instrument import Instrument


class Control:
    """Moves the finger, swaps the beam, lets time pass, and tells the device's true state."""

    def __init__(self, instrument: Instrument, beam: SimulatedBeam, clock: DeviceClock) -> None:
        self._instrument = instrument
        self._beam = beam
        self._clock = clock
        self._commands: dict[str, Callable[..., dict[str, object]]] = {
            "state": self._state,
            "touch": self._touch,
            "lift": self._lift,
            "beam": self._swap_beam,
            "advance": self._advance,
            "reset": self._reset,
        }

    def answer(self, line: str) -> str:
        """Return the JSON line that answers `line`; a bad one answers with `error`."""
        name, *arguments = line.split() or [""]
        if name not in self._commands:
            known = ", ".join(self._commands)
            return json.dumps({"error": f"unknown command {name!r}; known: {known}"})
        try:
            return json.dumps(self._commands[name](*arguments))
        except (TypeError, ValueError) as error:
            return json.dumps({"error": str(error)})

    def _state(self) -> dict[str, object]:
        instrument = self._instrument
        return {
            "output": instrument.output,
            "voltage_v": instrument.voltage_v,
            "monitor_v": self._beam.monitor_v(instrument),
            "frequency_hz": instrument.frequency_hz,
            "boot": instrument.boot,
            "watchdog_s": instrument.watchdog_s,
            "fault": None,
            "tripped": instrument.tripped,
            "time_s": instrument.time_s,
        }

    def _touch(self, force_n: str, position_m: str, direction: str = "right") -> dict[str, object]:
        """Put the finger down; answers with the friction coefficient that it feels there."""
        self._beam.touch(float(force_n), float(position_m), direction)
        return {"friction_coefficient": self._beam.friction_coefficient(self._instrument)}

    def _lift(self) -> dict[str, object]:
        self._beam.lift()
        return {"ok": True}

    def _swap_beam(self, body_spacing_m: str) -> dict[str, object]:
        self._beam.swap(float(body_spacing_m))
        return {"ok": True}

    def _advance(self, seconds: str) -> dict[str, object]:
        self._clock.step(float(seconds))
        self._instrument.advance_to(self._clock.now_s())
        return {"time_s": self._instrument.time_s}

    def _reset(self) -> dict[str, object]:
        self._instrument.reset()
        self._instrument.tripped = False
        self._beam.lift()
        return {"ok": True}
