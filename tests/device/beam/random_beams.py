"""Beams at random, for comparisons with exact waves."""

import numpy as np

from device.beam.beam import Beam, Patch
from device.beam.spectral import spectrum
from device.friction.coefficient import friction_coefficient
from device.friction.rungs import rung_field
from device.friction.scenes import Drive, FingerContact, Scene, Structure
from protocol.study.surface import Faces, Support
from tests.device.beam import exact_waves

_SUPPORTS: tuple[Support, ...] = ("clamped", "pinned", "free")
_FACES: tuple[Faces, ...] = ("both", "upper", "lower")


def _patches(draw: np.random.Generator, length_m: float, thickness_m: float) -> tuple[Patch, ...]:
    """Return 1 to 3 patches, each in a part of the beam of its own."""
    count = int(draw.integers(1, 4))
    joints_m = np.sort(draw.uniform(0.0, length_m, 2 * count)).reshape(count, 2)
    return tuple(
        Patch(
            centre_m=float(ends_m.mean()),
            length_m=float(max(np.ptp(ends_m), 1e-3 * length_m) * 0.999),
            thickness_m=float(thickness_m * draw.uniform(0.03, 0.3)),
            faces=_FACES[draw.integers(3)],
        )
        for ends_m in joints_m
        if 1e-3 * length_m < ends_m.mean() < (1 - 1e-3) * length_m
    )


def random_beam(draw: np.random.Generator) -> Beam:
    """Return a beam with any supports, thickness over length from 3e-4 to .13."""
    length_m = float(draw.uniform(0.02, 0.4))
    thickness_m = length_m * float(np.exp(draw.uniform(np.log(3e-4), np.log(0.13))))
    return Beam(
        length_m=length_m,
        thickness_m=thickness_m,
        youngs_modulus_pa=float(np.exp(draw.uniform(np.log(3e9), np.log(2e11)))),
        density_kg_m3=float(draw.uniform(1000, 9000)),
        poisson_ratio=float(draw.uniform(0.1, 0.45)),
        damping_ratio=float(np.exp(draw.uniform(np.log(1e-4), np.log(0.1)))),
        frequency_scale=float(draw.uniform(0.9, 1.1)),
        supports=(_SUPPORTS[draw.integers(3)], _SUPPORTS[draw.integers(3)]),
        patches=_patches(draw, length_m, thickness_m),
    )


def random_drive_hz(beam: Beam, draw: np.random.Generator) -> float:
    """Return a drive of up to 12 half waves, half of them within a width or so of a resonance."""
    highest_hz = beam.bare.frequency_hz(12 * np.pi / beam.length_m)
    frequency_hz = float(np.exp(draw.uniform(np.log(highest_hz / 500), np.log(highest_hz))))
    own_hz = spectrum(beam, highest_hz).frequencies_hz[beam.rigid_modes :]
    if draw.random() < 0.5:
        nearest_hz = own_hz[np.abs(np.log(own_hz / frequency_hz)).argmin()]
        frequency_hz = float(nearest_hz * (1 + beam.damping_ratio * draw.normal()))
    return beam.frequency_scale * min(frequency_hz, 0.999 * beam.cut_off_hz)


def compared(seed: int) -> dict[str, float]:
    """Return errors of a random scene against exact waves: rms |W|, relative, and μ' of each law.

    η and inertia are such that they matter; fingers cover a thousandth of the beam to all of it.
    """
    draw = np.random.default_rng(seed)
    beam = random_beam(draw)
    frequency_hz = random_drive_hz(beam, draw)
    waves = exact_waves.Waves(beam, frequency_hz, beam.damping_ratio).solve()
    rms, turn = waves.rms()
    lever_m, omega = beam.thickness_m / 2 + 1e-3, 2 * np.pi * frequency_hz
    volts = draw.uniform(0.2, 3) / (np.sqrt(2) * omega * lever_m * turn)
    contact_m = float(beam.length_m * 10 ** draw.uniform(-3, 0))
    inertia = omega**2 * rms * volts * contact_m
    scene = Scene(
        structure=Structure(beam=beam, body_mass_kg=np.pi),
        drive=Drive(voltage_v=float(volts), frequency_hz=frequency_hz),
        touch=FingerContact(
            x_m=0.0,
            contact_m=contact_m,
            finger_load_n=float(inertia / np.exp(draw.uniform(np.log(0.03), np.log(3)))),
            sliding_speed_m_s=1.0,
        ),
        direction="left" if seed % 2 else "right",
    )
    x_m = beam.length_m * draw.uniform(1e-3, 1.0, 40)
    exact = exact_waves.friction(scene, waves, x_m)
    errors = {
        law: float(np.abs(friction_coefficient(scene, law=law, rung="beam", x_m=x_m) - mu).max())
        for law, mu in exact.items()
    }
    field = rung_field("beam", beam, scene.drive)
    return {"rms": abs(float(field.displacement_m[0] / (volts * rms)) - 1), **errors}
