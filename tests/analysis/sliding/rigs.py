"""Simulated rigs with properties of their own, and passes of a block over them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from analysis.estimates import FloatArray
from analysis.sliding.rig_model import Pass, RigProperties
from device.beam.beam import Beam
from device.beam.spectral import natural_frequency_hz
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import TOP_RUNG, rung_resonance_hz
from device.friction.scenes import Direction, Drive, FingerContact, Scene
from device.simulator.hardware.beam_and_finger import SPREAD

MODE = 6
RELATIVE = (0.98, 0.99, 0.995, 1.0, 1.005, 1.01, 1.02)
PAPER_HZ = 23_200.0
PATH_M = (0.010, 0.081)
LOAD_N, CONTACT_M = 0.56, 0.010
RATE_HZ = 1000.0
SPEED_M_S = 0.005
JITTER, CORRELATION_S = 0.05, 0.02
TANGENTIAL_NOISE_N, NORMAL_NOISE_N, PLACE_NOISE_M = 10e-3, 5e-3, 1e-4
DRIFT_N_PER_S, TARE_SAMPLES, GAIN_ERROR = 10e-3 / 60, 500, 0.02
SWEEP_ERROR = 2e-4
"""Relative error of a measured resonance."""


@dataclass(frozen=True, kw_only=True)
class Rig:
    """A rig's true properties and the resonance that its sweep found."""

    true: RigProperties
    measured_hz: float

    def friction(self, setting: "Setting", x_m: FloatArray) -> FloatArray:
        """Return true friction at places."""
        beam, mode = self.true.beam(), self.true.surface.mode
        drive_hz = setting.frequency_hz / self.true.resonance_hz
        scene = Scene(
            structure=replace(
                self.true.surface.structure,
                beam=beam,
                friction_coefficient=self.true.friction_coefficient,
                body_height_m=self.true.body_height_m,
            ),
            drive=Drive(
                voltage_v=setting.voltage_v * self.true.gain,
                frequency_hz=drive_hz * rung_resonance_hz(TOP_RUNG, beam, mode),
                mode=mode,
            ),
            touch=FingerContact(
                contact_m=CONTACT_M, finger_load_n=LOAD_N, sliding_speed_m_s=setting.speed_m_s
            ),
            direction=setting.direction,
        )
        return friction_coefficient(scene, law="consistent", rung=TOP_RUNG, x_m=x_m)


@dataclass(frozen=True, kw_only=True)
class Setting:
    """Drive, direction and speed of a pass."""

    voltage_v: float = 100.0
    frequency_hz: float
    direction: Direction = "right"
    speed_m_s: float = SPEED_M_S


def rig(seed: int) -> Rig:
    """Return a rig as a simulated device has it: resonance, damping and gain are its own."""
    draw = np.random.default_rng([seed, 1])
    plain = Beam()
    own_hz = natural_frequency_hz(plain, MODE, patched=False, shear=False)
    true = RigProperties(
        friction_coefficient=0.4 * (1 + draw.normal(0, 0.1)),
        resonance_hz=own_hz * (1 + draw.normal(0, SPREAD["resonance"])),
        damping_ratio=plain.damping_ratio * (1 + draw.normal(0, SPREAD["damping"])),
        gain=1 + draw.normal(0, SPREAD["gain"]),
    )
    return Rig(true=true, measured_hz=true.resonance_hz * (1 + draw.normal(0, SWEEP_ERROR)))


def default_plan(
    measured_hz: float, references: int = 3, speed_m_s: float = SPEED_M_S
) -> tuple[Setting, ...]:
    """Return the default plan: around the measured resonance, the paper's drive, references."""
    drives_hz = [*(part * measured_hz for part in RELATIVE), PAPER_HZ]
    driven = [Setting(frequency_hz=drive_hz, speed_m_s=speed_m_s) for drive_hz in drives_hz]
    rest = Setting(voltage_v=0.0, frequency_hz=measured_hz, speed_m_s=speed_m_s)
    return (*driven, *[rest] * references)


def passes(own: Rig, plan: Sequence[Setting], seed: int, jitter: float = JITTER) -> list[Pass]:
    """Return the passes of a plan as a noisy force channel records them."""
    draw = np.random.default_rng([seed, 2])
    gain = 1 + draw.normal(0, GAIN_ERROR)
    return [_pass(own, setting, draw, gain, jitter) for setting in plan]


def _pass(
    own: Rig, setting: Setting, draw: np.random.Generator, gain: float, jitter: float
) -> Pass:
    count = int((PATH_M[1] - PATH_M[0]) / setting.speed_m_s * RATE_HZ)
    t_s = np.arange(count) / RATE_HZ
    way_m = setting.speed_m_s * t_s
    x_m = PATH_M[0] + way_m if setting.direction == "right" else PATH_M[1] - way_m
    grid = np.arange(PATH_M[0], PATH_M[1] + 1e-5, 1e-5).astype(np.float64)
    mu = np.interp(x_m, grid, own.friction(setting, grid))
    decay = np.exp(-1 / (RATE_HZ * CORRELATION_S))
    start = [decay * jitter * draw.normal()]
    steps = draw.normal(0, jitter * np.sqrt(1 - decay**2), count)
    stuck = lfilter([1.0], [1.0, -decay], steps, zi=start)[0]
    zero_n = draw.normal(0, TANGENTIAL_NOISE_N / np.sqrt(TARE_SAMPLES))
    zero_n += draw.normal(0, DRIFT_N_PER_S) * (2.0 + t_s)
    tangential_n = gain * LOAD_N * mu * (1 + stuck) + zero_n
    tangential_n += draw.normal(0, TANGENTIAL_NOISE_N, count)
    normal_n = LOAD_N + draw.normal(0, NORMAL_NOISE_N, count)
    return Pass(
        voltage_v=setting.voltage_v,
        frequency_hz=setting.frequency_hz,
        direction=setting.direction,
        load_n=LOAD_N,
        contact_m=CONTACT_M,
        t_s=t_s,
        x_m=x_m + draw.normal(0, PLACE_NOISE_M, count),
        mu=tangential_n / normal_n,
    )


def quiet(own: Rig, plan: Sequence[Setting]) -> list[Pass]:
    """Return passes without noise, two samples to a bin."""
    made = []
    for setting in plan:
        x_m = (np.arange(PATH_M[0], PATH_M[1], 0.25e-3) + 0.125e-3).astype(np.float64)
        if setting.direction == "left":
            x_m = x_m[::-1]
        made.append(
            Pass(
                voltage_v=setting.voltage_v,
                frequency_hz=setting.frequency_hz,
                direction=setting.direction,
                load_n=LOAD_N,
                contact_m=CONTACT_M,
                t_s=np.arange(x_m.size, dtype=np.float64) * (0.25e-3 / setting.speed_m_s),
                x_m=x_m,
                mu=own.friction(setting, x_m),
            )
        )
    return made


def paper_rig() -> Rig:
    """Return the paper's rig, its resonance measured without error."""
    true = RigProperties(friction_coefficient=0.4, resonance_hz=24_221.0)
    return Rig(true=true, measured_hz=true.resonance_hz)


def with_patches_at(own: Rig, centre_m: float) -> Rig:
    """Return the rig with its patches elsewhere."""
    return replace(own, true=replace(own.true, patch_centre_m=centre_m))
