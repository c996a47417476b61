"""The simulated beam under the board: it resonates, and a finger on it feels its friction.

Its friction follows a law and a rung of the friction model. Its resonance, damping and gain are its
own: the seed moves them away from the paper's values, so that a session has something true to find.
Sensor noise depends on channel and device time alone, so that looking more often changes nothing.
"""

import random
from dataclasses import dataclass, field, replace

from device.beam.beam import Beam
from device.beam.modes import modal_displacement_m, natural_frequency_hz
from device.friction.coefficient import friction_coefficient
from device.friction.contrasts import LAW, RUNG
from device.friction.laws import law_by_name
from device.friction.rungs import rung_resonance_hz
from device.friction.scenes import Direction, Drive, FingerContact, Scene, Structure
from device.simulator.models.power_stage import Instrument

MODE = 6
BODY_HEIGHT_M = 1e-3
SPREAD = {"resonance": 0.005, "damping": 0.1, "gain": 0.03}
"""Relative standard deviations of what the seed moves."""
SENSOR_NOISE = {"monitor_v": 0.05, "force_n": 0.005, "position_m": 1e-4, "vibration": 0.005}
"""Standard deviations of the sensors; that of the vibration is relative."""

_DIRECTIONS: dict[str, Direction] = {"right": "right", "left": "left"}


@dataclass(frozen=True, kw_only=True)
class Finger:
    """A finger on the beam: its load, its right edge, and the way it moves."""

    force_n: float
    position_m: float
    direction: Direction


@dataclass
class SimulatedBeam:
    """A beam whose hidden properties follow from `seed`, and its friction from a law and a rung.

    Raises:
        OutOfRangeError: the law or the rung does not exist.
    """

    seed: int
    law: str = LAW
    rung: str = RUNG
    finger: Finger | None = None
    body_height_m: float = BODY_HEIGHT_M
    monitor_gain: float = 1.0
    """What the monitor shows of the voltage: 1 unless it is broken."""
    beam: Beam = field(init=False)
    gain: float = field(init=False)
    _model_hz_per_hz: float = field(init=False)

    def __post_init__(self) -> None:
        hidden = random.Random(f"beam/{self.seed}")
        self.beam = Beam(
            frequency_scale=1 + hidden.gauss(0, SPREAD["resonance"]),
            damping_ratio=Beam().damping_ratio * (1 + hidden.gauss(0, SPREAD["damping"])),
        )
        law_by_name(self.law)
        # The rung's own resonance is where the sensor at the tip shows it.
        resonance_hz = rung_resonance_hz(self.rung, Beam(), MODE)
        self._model_hz_per_hz = resonance_hz / natural_frequency_hz(self.beam, MODE)
        self.gain = 1 + hidden.gauss(0, SPREAD["gain"])

    def touch(self, force_n: float, position_m: float, direction: str) -> None:
        """Put the finger down.

        Raises:
            ValueError: no force, a place that is not on the beam, or no such direction.
        """
        if direction not in _DIRECTIONS:
            raise ValueError(f"the direction must be right or left, got {direction!r}")
        finger = Finger(force_n=force_n, position_m=position_m, direction=_DIRECTIONS[direction])
        self._scene(finger, voltage_v=0.0, frequency_hz=1.0)
        self.finger = finger

    def lift(self) -> None:
        """Take the finger off."""
        self.finger = None

    def swap(self, body_spacing_m: float) -> None:
        """Mount a beam with this spacing of its ciliary bodies; 0 for one without.

        No friction law here depends on the spacing: bodies are dense in all of them.

        Raises:
            ValueError: the spacing is negative.
        """
        if not body_spacing_m >= 0:
            raise ValueError(f"the spacing must be 0 m or more, got {body_spacing_m}")
        self.body_height_m = BODY_HEIGHT_M if body_spacing_m > 0 else 0.0

    def friction_coefficient(self, instrument: Instrument) -> float | None:
        """Return what the finger feels, None without a finger."""
        if self.finger is None:
            return None
        voltage_v = self.gain * instrument.output_v
        scene = self._scene(self.finger, voltage_v, instrument.frequency_hz)
        # At rest all rungs agree, and the cheapest need not be set up for a frequency.
        rung = self.rung if voltage_v else "mode"
        return float(friction_coefficient(scene, law=self.law, rung=rung)[0])

    def monitor_v(self, instrument: Instrument) -> float:
        """Return the voltage monitor's reading."""
        return self.monitor_gain * instrument.output_v + self._noise("monitor_v", instrument)

    def measured_force_n(self, instrument: Instrument) -> float:
        """Return the force sensor's reading."""
        force_n = self.finger.force_n if self.finger else 0.0
        return force_n + self._noise("force_n", instrument)

    def measured_position_m(self, instrument: Instrument) -> float:
        """Return the position sensor's reading; 0 m, the clamp, without a finger."""
        position_m = self.finger.position_m if self.finger else 0.0
        return position_m + self._noise("position_m", instrument)

    def measured_vibration_m(self, instrument: Instrument) -> float:
        """Return the reading of the sensor at the tip: an amplitude, m."""
        voltage_v = self.gain * instrument.output_v
        tip_m = 2 * modal_displacement_m(self.beam, MODE, voltage_v, instrument.frequency_hz)
        return float(tip_m) * (1 + self._noise("vibration", instrument))

    def _scene(self, finger: Finger, voltage_v: float, frequency_hz: float) -> Scene:
        beam = replace(self.beam, frequency_scale=1.0)
        model_hz = frequency_hz * self._model_hz_per_hz
        return Scene(
            structure=Structure(beam=beam, body_height_m=self.body_height_m),
            drive=Drive(voltage_v=voltage_v, frequency_hz=model_hz, mode=MODE),
            touch=FingerContact(x_m=finger.position_m, finger_load_n=finger.force_n),
            direction=finger.direction,
        )

    def _noise(self, channel: str, instrument: Instrument) -> float:
        moment = random.Random(f"{self.seed}/{channel}/{instrument.time_s:.6f}")
        return moment.gauss(0, SENSOR_NOISE[channel])
