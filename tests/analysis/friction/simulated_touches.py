"""Recordings of touches by fingers, on rigs and with sensors that the analysis does not know."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.signal import lfilter

from analysis.estimates import FloatArray
from analysis.friction.recorded import TouchForces, reduced
from device.friction.calibration import Calibration
from device.friction.changes import Moment, friction_at, trial_change
from device.friction.scenes import Structure
from protocol.journal.records import Recording
from protocol.plan.trials import Trial
from protocol.study.rig_settings import TARE_S
from protocol.study.study import Study
from protocol.study.touch import Touch, touch_s

PLACES_M = tuple(np.linspace(0.004, 0.086, 165).tolist())
LEAD_IN_S, BETWEEN_S = 3.0, 4.0
IDEAL_STEP = 4
"""An ideal sensor need not sample as often."""
SCALE = (6e-5, 6e-5, 4e-6)
RESTING = Structure().friction_coefficient


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """What a force channel adds to the truth; SDs per sample, gains as factors."""

    rate_hz: float = 1000.0
    tangential_noise_n: float = 0.010
    normal_noise_n: float = 0.005
    drift_n_per_min: float = 0.010
    gain_sd: float = 0.02
    jitter_sd: float = 0.05
    jitter_s: float = 0.020


@dataclass(frozen=True, kw_only=True, eq=False)
class Finger:
    """A finger and the rig that it touches: friction at rest, skin, damping and gain.

    Fingers on the same rig share `friction_of`, its friction with a nominal finger.
    """

    resting: float
    skin: float
    damping_ratio: float
    drive_gain: float
    friction_of: dict[tuple[Moment, float, float], FloatArray] = field(default_factory=dict)

    def friction(self, moment: Moment, voltage_v: float, frequency: float) -> FloatArray:
        """Return ln μ at `PLACES_M`."""
        driven = replace(moment, voltage_v=voltage_v, frequency=frequency)
        key = (moment, voltage_v, frequency)
        if key not in self.friction_of:
            rig = Calibration(damping_ratio=self.damping_ratio, gain=self.drive_gain)
            nominal = friction_at(driven, PLACES_M, rung="mode", rig=rig)
            self.friction_of[key] = np.asarray(np.log(nominal / RESTING))
        return np.asarray(np.log(self.resting) + self.skin * self.friction_of[key])


def drawn_rig(rng: np.random.Generator) -> Finger:
    """Return a nominal finger on a rig whose damping and gain are its own."""
    return Finger(
        resting=RESTING,
        skin=1.0,
        damping_ratio=float(0.01 * np.exp(rng.normal(0, 0.1))),
        drive_gain=float(np.exp(rng.normal(0, 0.03))),
    )


def drawn_finger(rig: Finger, rng: np.random.Generator, *, skin_sd: float = 0.35) -> Finger:
    """Return another person's finger on the rig."""
    resting = float(RESTING * np.exp(rng.normal(0, 0.2)))
    return replace(rig, resting=resting, skin=float(np.exp(rng.normal(0, skin_sd))))


@dataclass(kw_only=True, eq=False)
class Channel:
    """One session's sensor: its clock runs on, its zeros drift, and its gains stay."""

    sensor: Sensor
    finger: Finger
    study: Study
    rng: np.random.Generator
    now_s: float = 0.0

    @cached_property
    def gains(self) -> FloatArray:
        """Factors of tangential and normal force."""
        return self.rng.normal(1.0, self.sensor.gain_sd, 2)

    @cached_property
    def drifts(self) -> FloatArray:
        """Drift of both zeros, N/s."""
        return self.rng.choice([-1.0, 1.0], 2) * self.sensor.drift_n_per_min / 60

    def touched(self, trial: Trial, number: int) -> tuple[Recording, Recording]:
        """Return the recording of a touch of a trial, and what an ideal sensor would record."""
        planned = Touch.model_validate(dict(trial.touches[number]))
        change = trial_change(self.study, "roughness", None, [planned])
        lasts_s, lead_s, sensor = touch_s(planned, self.study.touch), LEAD_IN_S, self.sensor
        self.now_s += BETWEEN_S
        tare_s = self.now_s - TARE_S / 2
        t_s = np.arange(round((lead_s + lasts_s + 0.1) * sensor.rate_hz)) / sensor.rate_hz
        moved = np.clip((t_s - lead_s) / lasts_s, 0, 1)
        place_m = self._places_m(planned, moved, t_s)
        sway = (
            1
            + 0.05 * self.rng.normal()
            + 0.02 * np.sin(2 * np.pi * (0.7 * t_s + self.rng.random()))
        )
        normal_n = change.after.force_n * sway
        tangential_n = normal_n * np.exp(self._friction(planned, change.after, moved, place_m))
        forces, session_s = np.stack([tangential_n, normal_n]), self.now_s + t_s
        noise_n = np.array([sensor.tangential_noise_n, sensor.normal_noise_n])
        jitter = np.stack([1 + self._jitter(len(t_s)), np.ones(len(t_s))])
        zeros = self.drifts[:, None] * session_s
        noise = self.rng.normal(size=forces.shape) * noise_n[:, None]
        felt = self.gains[:, None] * forces * jitter + zeros + noise
        tare_noise = self.rng.normal(size=2) * noise_n / np.sqrt(TARE_S * sensor.rate_hz)
        tare = self.drifts * tare_s + tare_noise
        seen_m = place_m + self.rng.normal(0, 1e-4, len(t_s)) * (sensor.gain_sd > 0)
        times = (self.now_s, (self.now_s + lead_s, self.now_s + lead_s + lasts_s))
        self.now_s += lead_s + lasts_s
        return (
            self._packed(felt, seen_m, tare, times),
            self._packed(forces[:, ::IDEAL_STEP], place_m[::IDEAL_STEP], None, times),
        )

    def _packed(
        self,
        forces: FloatArray,
        place_m: FloatArray,
        tare: FloatArray | None,
        times: tuple[float, tuple[float, float]],
    ) -> Recording:
        values = np.vstack([forces, place_m]) / np.array(SCALE)[:, None]
        counts = np.clip(np.round(values), -32_767, 32_767).astype("<i2")
        return Recording.packed(
            counts.tobytes(),
            source="board",
            rate_hz=self.sensor.rate_hz / (IDEAL_STEP if tare is None else 1),
            first_s=0.0,
            scale=SCALE,
            clock_offset_s=times[0],
            clock_error_s=0.001,
            moved_s=times[1],
            tare_n=(0.0, 0.0) if tare is None else tuple(tare.tolist()),
            saturated=0,
        )

    def _places_m(self, planned: Touch, moved: FloatArray, t_s: FloatArray) -> FloatArray:
        finger = self.study.touch
        if planned.place == "smooth":
            away = 3e-4 * self.rng.normal() + 2e-4 * np.sin(2 * np.pi * 0.5 * t_s)
            return np.asarray(finger.smooth_place_m + away)
        left, right = finger.path_m
        pace = np.clip(moved * self.rng.normal(1.0, 0.05), 0, 1)
        uneven = pace + 0.02 * self.rng.normal() * np.sin(2 * np.pi * pace)
        along = left + (right - left) * (uneven if planned.direction == "right" else 1 - uneven)
        return np.asarray(np.clip(along + 5e-4 * self.rng.normal(), PLACES_M[0], PLACES_M[-1]))

    def _friction(
        self, planned: Touch, moment: Moment, moved: FloatArray, place_m: FloatArray
    ) -> FloatArray:
        """Return ln μ at each moment: between profiles along the programme, by place."""
        stops = np.linspace(0, 1, 1 if planned.programme == "hold" else 17)
        profiles = np.array(
            [
                np.interp(
                    place_m,
                    PLACES_M,
                    self.finger.friction(
                        moment,
                        planned.voltage_v + stop * (planned.end_voltage_v - planned.voltage_v),
                        planned.frequency + stop * (planned.end_frequency - planned.frequency),
                    ),
                )
                for stop in stops
            ]
        )
        if len(stops) == 1:
            return np.asarray(profiles[0])
        at = moved * (len(stops) - 1)
        low = np.minimum(at.astype(np.int64), len(stops) - 2)
        each = np.arange(len(at))
        return np.asarray(
            profiles[low, each] * (low + 1 - at) + profiles[low + 1, each] * (at - low)
        )

    def _jitter(self, count: int) -> FloatArray:
        kept = np.exp(-1 / (self.sensor.jitter_s * self.sensor.rate_hz))
        steps = self.rng.normal(size=count) * np.sqrt(1 - kept**2)
        steps[0] = self.rng.normal()
        return np.asarray(self.sensor.jitter_sd * lfilter([1.0], [1.0, -kept], steps))


def forces_of(recording: Recording) -> TouchForces:
    """Return the forces of a recording that has some."""
    found = reduced(recording)
    assert isinstance(found, TouchForces), found
    return found
