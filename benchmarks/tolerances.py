"""How far μ' errs at each fineness of the beam's computation, and what a drive costs then.

`python -m benchmarks.tolerances` prints the table from which `device/friction/fineness.py` is made:
the largest error in μ' (with the drive off .4) under each law over beams of different supports,
sizes and patches, at random drives, under fingers at random places and at zone edges, from a
thousandth of the beam to all of it. The reference is the same computation several times as fine,
which `tests/device/beam` compares with exact waves.
"""

import argparse
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import process_time_ns
from typing import Any

import numpy as np

from device.arrays import FloatArray
from device.beam.beam import Beam, Patch
from device.beam.driven import Fineness, driven
from device.beam.fields import driven_fields
from device.beam.pattern import Patterns
from device.beam.spectral import Mesh, spectrum_with_mode
from device.errors import OutOfRangeError
from device.friction.contact import contact_of
from device.friction.fineness import TOLERANCES, fineness_for
from device.friction.laws import LAWS
from device.friction.prediction import Batch, drive_terms
from device.friction.rungs import REFERENCE_RATIO
from device.friction.scenes import FingerContact, Scene, Structure
from protocol.study.surface import Faces

FINE = Fineness(Mesh(16, 3.5), 60, 0.07)
PLACES = 20
_MODES = 24


def _patch(centre_m: float, length_m: float, thickness_m: float, faces: Faces) -> Patch:
    return replace(
        Patch(), centre_m=centre_m, length_m=length_m, thickness_m=thickness_m, faces=faces
    )


_ALUMINIUM: dict[str, Any] = {
    "youngs_modulus_pa": 70e9,
    "density_kg_m3": 2700.0,
    "poisson_ratio": 0.33,
}
_GLASS: dict[str, Any] = {
    "youngs_modulus_pa": 72e9,
    "density_kg_m3": 2500.0,
    "poisson_ratio": 0.22,
}
_STEEL: dict[str, Any] = {
    "youngs_modulus_pa": 200e9,
    "density_kg_m3": 7850.0,
    "poisson_ratio": 0.3,
}
_PLASTIC: dict[str, Any] = {
    "youngs_modulus_pa": 3e9,
    "density_kg_m3": 1190.0,
    "poisson_ratio": 0.37,
}
BEAMS = {
    "the paper's": Beam(),
    "clamped twice, slender, one face": Beam(
        length_m=0.2,
        thickness_m=1e-3,
        supports=("clamped", "clamped"),
        patches=(_patch(0.03, 0.02, 2e-4, "upper"), _patch(0.15, 0.03, 2e-4, "lower")),
        **_ALUMINIUM,
    ),
    "pinned twice, thick": Beam(
        length_m=0.06,
        thickness_m=6e-3,
        supports=("pinned", "pinned"),
        patches=(_patch(0.02, 0.012, 1e-3, "both"),),
        **_STEEL,
    ),
    "free, three patches": Beam(
        length_m=0.15,
        thickness_m=2e-3,
        supports=("free", "free"),
        patches=tuple(_patch(0.02 + 0.05 * k, 0.02, 5e-4, "both") for k in range(3)),
        **_GLASS,
    ),
    "clamped and pinned, soft, a patch over half": Beam(
        length_m=0.08,
        thickness_m=4e-3,
        supports=("clamped", "pinned"),
        patches=(_patch(0.04, 0.04, 1e-3, "lower"),),
        **_PLASTIC,
    ),
    "pinned and free, very slender": Beam(
        length_m=0.3,
        thickness_m=3e-4,
        supports=("pinned", "free"),
        patches=(_patch(0.1, 0.05, 1e-4, "upper"), _patch(0.21, 0.02, 1e-4, "both")),
        **_STEEL,
    ),
    "free and clamped, as thick as beams are": Beam(
        length_m=0.04,
        thickness_m=5.2e-3,
        supports=("free", "clamped"),
        patches=(_patch(0.025, 0.01, 5e-4, "both"),),
        **_ALUMINIUM,
    ),
    "clamped and free, patches over all": Beam(
        length_m=0.1,
        thickness_m=2e-3,
        patches=(_patch(0.05, 0.1, 5e-4, "both"),),
        **_GLASS,
    ),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Case:
    """A beam at drives, with `PLACES` fingers each, as a batch of scenes."""

    beam: Beam
    frequency_hz: FloatArray
    damping_ratio: FloatArray
    batch: Batch

    def friction(self, fineness: Fineness) -> dict[str, FloatArray]:
        """Return μ' of each drive and place under each law, shape (drives x PLACES,)."""
        drive = np.repeat(np.arange(self.frequency_hz.size), PLACES)
        drives = self.frequency_hz, self.damping_ratio
        terms = drive_terms(self.batch, drives, drive, fineness)
        return {name: law(terms) for name, law in LAWS.items()}


def _frequencies(beam: Beam, draw: np.random.Generator, damping: FloatArray) -> FloatArray:
    """Return drives, half of them within some widths of a resonance, the others anywhere."""
    for modes in range(_MODES, 0, -1):
        try:
            own_hz = spectrum_with_mode(beam, modes).frequencies_hz[beam.rigid_modes :][:modes]
            break
        except OutOfRangeError:
            continue
    near = draw.choice(own_hz, damping.size) * (1 + damping * draw.normal(0, 2, damping.size))
    far = np.exp(draw.uniform(np.log(own_hz[0] / 3), np.log(own_hz[-1]), damping.size))
    # A narrower resonance asks for more digits of the frequency than any computation has.
    drives = np.where((draw.random(damping.size) < 0.5) & (damping >= 1e-6), near, far)
    return np.asarray(np.minimum(drives, beam.cut_off_hz))


def _edges_m(pattern: Patterns, drive: int) -> FloatArray:
    """Return the zone edges of a drive, m."""
    own = pattern.pieces[np.floor(pattern.keys / pattern.stride_m) == drive]
    return np.asarray(own[1:, 0][np.diff(own[:, 1]) != 0])


def case(beam: Beam, drives: int, seed: int) -> Case:
    """Return random drives of a beam with fingers whose η and inertia matter."""
    draw = np.random.default_rng(seed)
    damping = np.exp(draw.uniform(np.log(1e-4), np.log(0.05), drives))
    extreme = draw.random(drives) < 0.05
    damping[extreme] = draw.choice([1e-9, 1e-6, 0.2], extreme.sum())
    frequency_hz = _frequencies(beam, draw, damping)
    contact_m = beam.length_m * 10 ** draw.uniform(-3, 0, (drives, PLACES))
    x_m = beam.length_m * draw.random((drives, PLACES))
    volts, load = np.empty((2, drives))
    for which, field in driven_fields(beam, frequency_hz, damping):
        assert isinstance(field.pattern, Patterns)
        for number, drive in enumerate(which.tolist()):
            edges_m = _edges_m(field.pattern, number)
            if edges_m.size:
                over_m = draw.choice(edges_m, PLACES) + draw.random(PLACES) * contact_m[drive]
                over = draw.random(PLACES) < 1 / 3
                x_m[drive] = np.where(over, np.minimum(over_m, beam.length_m), x_m[drive])
        lever_m = beam.thickness_m / 2 + 1e-3
        volts[which] = draw.uniform(0.2, 3, which.size) / field.tip_speed_m_s(lever_m)
        acceleration = field.angular_frequency_rad_s**2 * field.displacement_m * volts[which]
        load[which] = acceleration / np.exp(draw.uniform(np.log(0.03), np.log(3), which.size))
    scene = Scene(structure=Structure(beam=beam), touch=FingerContact(x_m=0.0))
    contact = replace(
        contact_of(scene, x_m.ravel()),
        contact_m=contact_m.ravel(),
        sliding_speed_m_s=1 / REFERENCE_RATIO,
        body_mass_kg=np.pi,
        body_count=1,
        body_load_n=np.repeat(load * beam.length_m, PLACES),
        direction="left" if seed % 2 else "right",
    )
    batch = Batch(
        contact=contact,
        mode=1,
        voltage_v=np.repeat(volts, PLACES),
        frequency_hz=np.repeat(frequency_hz, PLACES),
        damping_ratio=np.repeat(damping, PLACES),
    )
    return Case(beam=beam, frequency_hz=frequency_hz, damping_ratio=damping, batch=batch)


def cases(drives: int) -> Iterator[Case]:
    """Yield a case of each beam."""
    for seed, beam in enumerate(BEAMS.values()):
        yield case(beam, drives, seed)


def _least_ns(work: Callable[[], object], repeats: int) -> int:
    times = []
    for _ in range(repeats):
        start = process_time_ns()
        work()
        times.append(process_time_ns() - start)
    return min(times)


def _per_drive_u(beam: Beam, fineness: Fineness) -> float:
    """Return the time of a drive of many, in those of `np.sin` of 1,000 places."""
    places = np.linspace(0.0, beam.length_m, 1000)
    own_hz = spectrum_with_mode(beam, 6).frequencies_hz[beam.rigid_modes + 5]
    drives = own_hz * np.linspace(0.98, 1.0, 128), np.full(128, 0.005)

    def work() -> object:
        return list(driven(beam, *drives, fineness))

    work()
    sines_ns = _least_ns(lambda: [np.sin(places) for _ in range(50)], 100) / 50
    return _least_ns(work, 12) / 128 / sines_ns


GRID = [
    Fineness(Mesh(degree, radians), cells, theta)
    for (degree, radians), (cells, theta) in itertools.product(
        [(8, 3.5), (10, 4.0), (12, 4.0), (14, 4.0)],
        zip(
            (2, 3, 4, 5, 6, 8, 10, 12, 12, 16, 20),
            (1.0, 1.0, 0.8, 0.7, 0.6, 0.5, 0.4, 0.35, 0.3, 0.25, 0.2),
            strict=True,
        ),
    )
]


def errors(one: Case, grid: list[Fineness]) -> FloatArray:
    """Return the largest error in μ' of each fineness under each law, shape (grid, laws)."""
    due = one.friction(FINE)
    return np.array(
        [
            [np.abs(mu - due[law]).max() for law, mu in one.friction(fineness).items()]
            for fineness in grid
        ]
    )


def rows(drives: int, grid: list[Fineness]) -> Iterator[str]:
    """Yield the table's lines."""
    worst = np.array([errors(one, grid) for one in cases(drives)])
    yield f"{'degree':>6} {'rad':>4} {'cells':>5} {'theta':>5} {'u':>5}  " + "  ".join(LAWS)
    for place, ((degree, radians), cells, theta) in enumerate(grid):
        numbers = "  ".join(f"{error:.1e}" for error in worst[:, place].max(axis=0))
        cost = _per_drive_u(Beam(), grid[place])
        name = list(BEAMS)[int(worst[:, place].max(axis=1).argmax())]
        yield f"{degree:6} {radians:4} {cells:5} {theta:5} {cost:5.0f}  {numbers}  ({name})"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=600, help="of each beam")
    parser.add_argument("--ladder", action="store_true", help="the tolerances alone")
    options = parser.parse_args()
    grid = [fineness_for(tolerance) for tolerance in TOLERANCES] if options.ladder else GRID
    for line in rows(options.drives, grid):
        print(line, flush=True)


if __name__ == "__main__":
    main()
