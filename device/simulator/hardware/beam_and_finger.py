"""The simulated beam under the board: it resonates, and a finger on it feels its friction.

Its friction follows a law and a rung of the friction model. Its resonance, damping and gain are its
own: the seed moves them away from the paper's values, so that a session has something true to find.
Sensor noise depends on channel and device time alone, so that looking more often changes nothing.
"""

import random
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from device.arrays import FloatArray
from device.beam.beam import Beam
from device.beam.fields import mode_field, peak_ratio
from device.beam.spectral import natural_frequency_hz
from device.errors import positive, within
from device.friction import scenes
from device.friction.changes import LAW, RUNG
from device.friction.coefficient import friction_coefficient
from device.friction.laws import law_by_name
from device.friction.surfaces import PAPERS, AnySurface, BeamSurface
from device.people.person import Fingers, World, felt_friction
from device.simulator.hardware.power_stage import Instrument

_GAIN_SD = 0.02


@dataclass(frozen=True, kw_only=True)
class Skin:
    """How a finger's friction differs from the law's: `mu0 · μ · (μ'/μ)^skin`; 1 is nominal."""

    mu0: float = 1.0
    skin: float = 1.0


@dataclass(frozen=True, kw_only=True)
class ForceSensor:
    """What a sample has besides the force: noise (SD), zero drift, gains, and the slide's jitter.

    Both forces drift to one side for 15 min and back again. The jitter, with its correlation time,
    is the SD of what stick-slip multiplies the tangential force by, as a logarithm.
    """

    tangential_noise_n: float = 0.01
    normal_noise_n: float = 0.005
    position_noise_m: float = 1e-4
    drift_n_per_min: float = 0.01
    tangential_gain: float = 1.0
    normal_gain: float = 1.0
    jitter: float = 0.05
    jitter_s: float = 0.02


SPREAD = {"resonance": 0.005, "damping": 0.1, "gain": 0.03}
"""Relative standard deviations of what the seed moves."""
SENSOR_NOISE = {
    "monitor_v": 0.05,
    "force_n": 0.005,
    "tangential_n": 0.01,
    "position_m": 1e-4,
    "vibration": 0.005,
}
"""Standard deviations of the sensors; that of the vibration is relative."""

_DIRECTIONS: dict[str, scenes.Direction] = {"right": "right", "left": "left"}


@dataclass(frozen=True, kw_only=True)
class Finger:
    """A finger on the beam; one without a speed slides to and fro about its place."""

    force_n: float
    position_m: float
    direction: scenes.Direction
    speed_m_s: float = 0.0
    at_s: float = 0.0


@dataclass
class SimulatedBeam:
    """A beam whose hidden properties follow from `seed`, and its friction from a law and a rung.

    Raise `OutOfRangeError` if there is no such law or rung, or the damping ratio is impossible.
    """

    seed: int
    law: str | None = None
    rung: str | None = None
    """None: those of the report."""
    damping: float | None = None
    """The beam's ratio; None: the seed moves it, too."""
    surface: AnySurface = PAPERS
    """What is touched: of a beam its mechanics, of another one the paper's."""
    nominal_hz: float | None = None
    """About where it resonates; None: where the paper's beam does."""
    finger: Finger | None = None
    skin: Skin = field(default_factory=Skin)
    has_bodies: bool = True
    monitor_gain: float = 1.0
    """What the monitor shows of the voltage: 1 unless it is broken."""
    is_saturated: bool = False
    """Whether the sensor of the tangential force is at its limit, whatever the force."""
    drift_factor: float = 1.0
    """How much faster than it should the force sensors' zero drifts: 1 unless it is broken."""
    sensor: ForceSensor = field(init=False)
    beam: Beam = field(init=False)
    gain: float = field(init=False)
    world: World = field(init=False)
    """What the friction obeys."""
    _model_hz_per_hz: float = field(init=False)
    _moment: random.Random = field(init=False, default_factory=random.Random)

    def __post_init__(self) -> None:
        hidden = random.Random(f"beam/{self.seed}")
        own = self.surface if isinstance(self.surface, BeamSurface) else PAPERS
        nominal = own.structure.beam
        scale = 1 + hidden.gauss(0, SPREAD["resonance"])
        if self.nominal_hz is not None:
            scale *= self.nominal_hz / natural_frequency_hz(
                nominal, own.mode, patched=False, shear=False
            )
        self.beam = replace(
            nominal,
            frequency_scale=scale,
            damping_ratio=nominal.damping_ratio * (1 + hidden.gauss(0, SPREAD["damping"])),
        )
        # Replaced after the draws, so that the other hidden properties of the seed stay the same.
        if self.damping is not None:
            self.beam = replace(self.beam, damping_ratio=self.damping)
        # A stream of its own: a property that is added elsewhere leaves this sensor as it was.
        of_sensor = random.Random(f"force sensor/{self.seed}")
        gains = [1 + of_sensor.gauss(0, _GAIN_SD) for _ in range(2)]
        self.sensor = ForceSensor(tangential_gain=gains[0], normal_gain=gains[1])
        self.gain = 1 + hidden.gauss(0, SPREAD["gain"])
        self.world = World(
            law=self.law or LAW,
            rung=self.rung or RUNG,
            damping_ratio=self.beam.damping_ratio,
            gain=self.gain,
            surface=self.surface,
        )
        # Called for its error: an unknown law is refused now and not at the first touch.
        law_by_name(self.world.law)
        # The rung's own resonance is where the sensor at the tip shows it.
        self._model_hz_per_hz = self.world.resonance_hz / self.resonance_hz

    @property
    def length_m(self) -> float:
        return self.surface.length_m

    @property
    def body_height_m(self) -> float:
        return self.world.structure.body_height_m if self.has_bodies else 0.0

    @cached_property
    def resonance_hz(self) -> float:
        """Where the sensor shows the beam's resonance: that of its bare mode."""
        return natural_frequency_hz(self.beam, self.world.mode, patched=False, shear=False)

    def touch(
        self,
        force_n: float,
        position_m: float,
        direction: str,
        speed_m_s: float = 0.0,
        at_s: float = 0.0,
    ) -> None:
        """Put the finger down at the device time `at_s`; it moves on at its speed.

        Raise `ValueError` for no force, a place off the beam, and no such direction or speed.
        """
        if direction not in _DIRECTIONS:
            raise ValueError(f"the direction must be right or left, got {direction!r}")
        if not 0 <= speed_m_s < float("inf"):
            raise ValueError(f"the speed must be 0 m/s or more, got {speed_m_s}")
        finger = Finger(
            force_n=force_n,
            position_m=position_m,
            direction=_DIRECTIONS[direction],
            speed_m_s=speed_m_s,
            at_s=at_s,
        )
        # A finger beside the surface is refused before it replaces the old one.
        within("x_m", position_m, 0.0, self.length_m)
        positive("finger_load_n", force_n)
        self.finger = finger

    def set_up(self) -> None:
        """Load and compute now what the first driven touch needs; no answer then waits for it."""
        finger = Finger(force_n=1.0, position_m=self.length_m / 2, direction="right")
        # At 1 V, because at rest no rung is set up.
        self._friction(finger, np.zeros(1), np.ones(1), self.resonance_hz)

    def change(self, name: str, value: float) -> None:
        """Change a number of skin or force sensor; raise `ValueError` if neither has that name."""
        for part in ("skin", "sensor"):
            if name in vars(getattr(self, part)):
                setattr(self, part, replace(getattr(self, part), **{name: value}))
                return
        known = ", ".join((*vars(self.skin), *vars(self.sensor)))
        raise ValueError(f"a sensor or skin has {known}, got {name!r}")

    def truth(self) -> dict[str, object]:
        """Return what this beam hides, for those who test whether it is found.

        The troughs of its friction are those that a block of 0.56 N feels, drawn to the right at
        100 V and at resonance (paper, section 5.1), by the block's right edge.
        """
        from scipy.signal import find_peaks

        resonance_hz = self.resonance_hz
        block = Finger(force_n=0.56, position_m=0.0, direction="right")
        places_m = np.linspace(0.0, self.beam.length_m, 4001)
        scene = self._scene(block, self.gain * 100.0, resonance_hz)
        law, rung = self.world.law, self.world.rung
        friction = friction_coefficient(scene, law=law, rung=rung, x_m=places_m)
        troughs_m = places_m[find_peaks(-friction)[0]]
        return {
            "law": law,
            "rung": rung,
            "resonance_hz": resonance_hz,
            "damping_ratio": self.beam.damping_ratio,
            "gain": self.gain,
            "troughs_m": [round(float(place_m), 6) for place_m in troughs_m],
        }

    def lift(self) -> None:
        self.finger = None

    def swap(self, body_spacing_m: float) -> None:
        """Mount a beam with this spacing of bodies, 0 for none; `ValueError` if it is negative."""
        # Written so that NaN is refused, too.
        if not body_spacing_m >= 0:
            raise ValueError(f"the spacing must be 0 m or more, got {body_spacing_m}")
        self.has_bodies = body_spacing_m > 0

    def friction_coefficient(self, instrument: Instrument) -> float | None:
        """Return what the finger feels, None without a finger."""
        if self.finger is None:
            return None
        return float(self._friction(self.finger, *_present(instrument))[0])

    def forces(
        self, times_s: FloatArray, voltage_v: FloatArray, frequency_hz: float
    ) -> list[FloatArray]:
        """Return both forces and the place at `times_s`, each (n,); `voltage_v` is the beam's."""
        if self.finger is None:
            return [np.zeros(times_s.size) for _ in range(3)]
        friction = self._friction(self.finger, times_s, voltage_v, frequency_hz)
        normal_n = np.full(times_s.size, self.finger.force_n)
        return [friction * normal_n, normal_n, self._places_m(self.finger, times_s)]

    def _friction(
        self, finger: Finger, times_s: FloatArray, voltage_v: FloatArray, frequency_hz: float
    ) -> FloatArray:
        """Return the friction coefficient of this finger's skin, as `forces`."""
        fingers = Fingers(
            place_m=self._places_m(finger, times_s),
            force_n=finger.force_n,
            speed_m_s=finger.speed_m_s or scenes.REFERENCE_SPEED_M_S,
            voltage_v=voltage_v,
            body_height_m=self.body_height_m,
            skin=self.skin.skin,
            mu0=self.skin.mu0,
        )
        # The rung has its own resonance: a drive at this beam's is one at the rung's.
        model_hz = frequency_hz * self._model_hz_per_hz
        return felt_friction(self.world, fingers, model_hz, finger.direction)

    def _places_m(self, finger: Finger, times_s: FloatArray) -> FloatArray:
        """Return where the finger is at device times; it stops at the ends of the beam."""
        way = 1.0 if finger.direction == "right" else -1.0
        moved_m = way * finger.speed_m_s * np.maximum(times_s - finger.at_s, 0.0)
        return np.clip(finger.position_m + moved_m, 0.0, self.length_m)

    def monitor_v(self, instrument: Instrument) -> float:
        return self.monitor_gain * instrument.output_v + self._noise("monitor_v", instrument)

    def measured_force_n(self, instrument: Instrument) -> float:
        force_n = self.finger.force_n if self.finger else 0.0
        return force_n + self._noise("force_n", instrument)

    def measured_tangential_n(self, instrument: Instrument) -> float:
        force_n, *_ = self.forces(*_present(instrument))
        return float(force_n[0]) + self._noise("tangential_n", instrument)

    def measured_position_m(self, instrument: Instrument) -> float:
        """Return the position sensor's reading; 0 m, the clamp, without a finger."""
        now_s = np.array([instrument.time_s])
        position_m = float(self._places_m(self.finger, now_s)[0]) if self.finger else 0.0
        return position_m + self._noise("position_m", instrument)

    def measured_vibration_m(self, instrument: Instrument) -> float:
        """Return the reading of the sensor where the beam moves most: an amplitude, m."""
        voltage_v = self.gain * instrument.output_v
        drive = np.array([instrument.frequency_hz]), np.array([self.beam.damping_ratio])
        mode = self.world.mode
        per_v = mode_field(self.beam, mode, *drive, built=False).displacement_m
        largest_m = voltage_v * float(per_v[0]) * peak_ratio(self.beam, mode)
        return largest_m * (1 + self._noise("vibration", instrument))

    def _scene(self, finger: Finger, voltage_v: float, frequency_hz: float) -> scenes.Scene:
        model_hz = frequency_hz * self._model_hz_per_hz
        return scenes.Scene(
            structure=replace(self.world.structure, body_height_m=self.body_height_m),
            drive=scenes.Drive(voltage_v=voltage_v, frequency_hz=model_hz, mode=self.world.mode),
            touch=scenes.FingerContact(
                x_m=finger.position_m,
                finger_load_n=finger.force_n,
                sliding_speed_m_s=finger.speed_m_s or scenes.REFERENCE_SPEED_M_S,
            ),
            direction=finger.direction,
        )

    def _noise(self, channel: str, instrument: Instrument) -> float:
        self._moment.seed(f"{self.seed}/{channel}/{instrument.time_s:.6f}")
        return self._moment.gauss(0, SENSOR_NOISE[channel])


def _present(instrument: Instrument) -> tuple[FloatArray, FloatArray, float]:
    """Return what `SimulatedBeam.forces` takes of the present moment."""
    time_s, voltage_v = np.array([[instrument.time_s], [instrument.output_v]])
    return time_s, voltage_v, instrument.frequency_hz
