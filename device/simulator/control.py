"""The control side-channel: one line in, one JSON line out. It moves what a wire cannot."""

import json
from collections.abc import Callable

from device.simulator.faults import NAMES, Broken
from device.simulator.hardware.power_stage import DeviceClock


class Control:
    """Moves the finger, swaps the beam, lets time pass, breaks things, tells the true state."""

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
            "beam": self._swap_beam,
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
            float(force_n),
            float(position_m),
            direction,
            float(speed_m_s),
            self._instrument.time_s,
        )
        return {"friction_coefficient": self._beam.friction_coefficient(self._instrument)}

    def _swap_beam(self, body_spacing_m: str) -> None:
        self._beam.swap(float(body_spacing_m))

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
