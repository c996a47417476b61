"""A touch beam: its section, material, supports and the piezoelectric patches on its faces.

Defaults are the paper's beam (Tables 1 and 2).
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, get_args

from device.errors import OutOfRangeError, below, not_negative, one_of, positive
from protocol.study.surface import Faces, Support

_SIDES: tuple[tuple[Faces, float], ...] = (("upper", 1.0), ("lower", -1.0))
_SAME = 1e-7
"""Part of the length below which two joints are one: .09 + .01 is not .1 in binary."""
_LEAST_PATCH = 1e-5
"""Part of the length below which a patch is refused."""


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A piezoelectric sheet on one face, or one on `both`, opposite each other.

    Lengths, modulus, density and stress constant are Table 2's. Assumed, not in the paper: sheets
    on both faces, their centre at the fifth antinode of mode 6 (86 mm), Poisson's ratio of a PZT
    ceramic.
    """

    centre_m: float = 0.086
    length_m: float = 0.010
    width_m: float = 5e-3
    thickness_m: float = 0.3e-3
    faces: Faces = "both"
    youngs_modulus_pa: float = 76.5e9
    density_kg_m3: float = 7500.0
    poisson_ratio: float = 0.31
    stress_constant_c_m2: float = 2.0

    def __post_init__(self) -> None:
        one_of("patch faces", self.faces, get_args(Faces))
        for name in ("length_m", "thickness_m", "width_m", "density_kg_m3", "centre_m"):
            positive(f"patch {name}", getattr(self, name))
        positive("patch youngs_modulus_pa", self.youngs_modulus_pa)
        not_negative("patch stress_constant_c_m2", self.stress_constant_c_m2)
        below("patch poisson_ratio", self.poisson_ratio, -1.0, 0.5)

    @property
    def start_m(self) -> float:
        """Where it begins, from the beam's left end."""
        return self.centre_m - self.length_m / 2

    @property
    def end_m(self) -> float:
        return self.centre_m + self.length_m / 2

    def on(self, face: Faces) -> bool:
        """Whether there is a sheet on that face."""
        return self.faces in {"both", face}


class Section(NamedTuple):
    """A uniform stretch of the beam, without damping: stiffness, inertia, moment of its patches."""

    start_m: float
    end_m: float
    bending_n_m2: float
    shear_n: float
    mass_kg_per_m: float
    rotary_kg_m: float
    moment_n_m_per_v: float

    @property
    def cut_off_hz(self) -> float:
        """√(κGA/ρI)/2π, above which both waves travel."""
        return math.sqrt(self.shear_n / self.rotary_kg_m) / (2 * math.pi)

    def wave_number_per_m(self, frequency_hz: float, *, shear: bool = True) -> float:
        """Return the larger |λ| of the waves e^{λx} that the section carries; (7)."""
        omega2 = (2 * math.pi * frequency_hz) ** 2
        beta, rotary = self.mass_kg_per_m / self.shear_n, self.rotary_kg_m / self.bending_n_m2
        half = shear * (beta + rotary) * omega2 / 2
        slower = 1 - shear * self.rotary_kg_m / self.shear_n * omega2
        product = self.mass_kg_per_m / self.bending_n_m2 * omega2 * slower
        return math.sqrt(half + math.sqrt(half**2 + product))

    def frequency_hz(self, wave_number_per_m: float, *, shear: bool = True) -> float:
        """Return the lowest frequency of a wave of that wave number; (9)."""
        k2 = wave_number_per_m**2
        mass, flexibility = self.mass_kg_per_m, shear / self.shear_n
        rotary, constant = shear * self.rotary_kg_m, self.bending_n_m2 * k2**2 / mass
        linear = 1 + k2 * (rotary / mass + self.bending_n_m2 * flexibility)
        root = math.sqrt(linear**2 - 4 * rotary * flexibility * constant)
        return math.sqrt(2 * constant / (linear + root)) / (2 * math.pi)


@dataclass(frozen=True, kw_only=True)
class Beam:
    """A beam of rectangular section with any number of patches.

    Assumed, not in the paper: the damping ratio and brass's Poisson ratio. `frequency_scale`
    multiplies every natural frequency of the beam, as a stiffness scaled by its square would; a
    measured resonance enters here.
    """

    length_m: float = 0.1
    thickness_m: float = 5e-3
    width_m: float = 5e-3
    youngs_modulus_pa: float = 105e9
    density_kg_m3: float = 8500.0
    poisson_ratio: float = 0.34
    damping_ratio: float = 0.005
    frequency_scale: float = 1.0
    supports: tuple[Support, Support] = ("clamped", "free")
    patches: tuple[Patch, ...] = (Patch(),)

    def __post_init__(self) -> None:
        for name in ("length_m", "thickness_m", "width_m", "youngs_modulus_pa", "density_kg_m3"):
            positive(f"beam {name}", getattr(self, name))
        positive("frequency_scale", self.frequency_scale)
        below("beam poisson_ratio", self.poisson_ratio, -1.0, 0.5)
        below("damping_ratio", self.damping_ratio, 0.0, 1.0)
        for support in self.supports:
            one_of("support", support, get_args(Support))
        for patch in self.patches:
            self._require_on_beam(patch)
        faces: tuple[Faces, ...] = ("upper", "lower")
        for face in faces:
            on_face = sorted((p for p in self.patches if p.on(face)), key=lambda p: p.start_m)
            for left, right in pairwise(on_face):
                if right.start_m < left.end_m - _SAME * self.length_m:
                    rule = f"must not overlap the one to its left, which ends at {left.end_m:g} m"
                    raise OutOfRangeError("patch centre_m", rule, right.centre_m)

    def _require_on_beam(self, patch: Patch) -> None:
        slack_m = _SAME * self.length_m
        if patch.start_m < -slack_m or patch.end_m > self.length_m + slack_m:
            rule = (
                f"must be such that the patch, {patch.length_m:g} m long, lies on the beam, "
                f"from 0 to {self.length_m:g} m"
            )
            raise OutOfRangeError("patch centre_m", rule, patch.centre_m)
        if patch.length_m < _LEAST_PATCH * self.length_m:
            rule = f"must be at least {_LEAST_PATCH:g} of the beam's length"
            raise OutOfRangeError("patch length_m", rule, patch.length_m)
        if patch.width_m > self.width_m * (1 + _SAME):
            rule = f"must be at most the beam's, {self.width_m:g}"
            raise OutOfRangeError("patch width_m", rule, patch.width_m)

    @property
    def area_m2(self) -> float:
        return self.width_m * self.thickness_m

    @property
    def second_moment_m4(self) -> float:
        """The bare section's second moment of area about its middle."""
        return self.width_m * self.thickness_m**3 / 12

    @property
    def mass_kg(self) -> float:
        """The bare beam's mass ρWhL."""
        return self.density_kg_m3 * self.area_m2 * self.length_m

    @property
    def cut_off_hz(self) -> float:
        """The bare section's, above which modes have no clear number."""
        return self.bare.cut_off_hz

    @cached_property
    def bare(self) -> Section:
        """The first section without its patches, which all sections are without theirs."""
        return self.sections(patched=False)[0]

    @cached_property
    def undamped(self) -> "Beam":
        """The beam without damping and scale, which its modes do not depend on."""
        return replace(self, damping_ratio=0.1, frequency_scale=1.0)

    @property
    def rigid_modes(self) -> int:
        """How many motions bend nothing: 2 of a free beam, 1 of one with a single pin."""
        held = {"clamped": 2, "pinned": 1, "free": 0}
        return max(0, 2 - sum(held[support] for support in self.supports))

    def sections(self, *, patched: bool = True) -> tuple[Section, ...]:
        """Return its uniform stretches from left to right; unless `patched` all are as bare ones.

        The patches' moments count in either case.
        """
        joints = [0.0]
        ends = (end for patch in self.patches for end in (patch.start_m, patch.end_m))
        for place_m in sorted((*ends, self.length_m)):
            if place_m - joints[-1] > _SAME * self.length_m:
                joints.append(place_m)
        joints[-1] = self.length_m
        return tuple(self._section(*pair, patched=patched) for pair in pairwise(joints))

    def _section(self, start_m: float, end_m: float, *, patched: bool) -> Section:
        middle_m, half_m = (start_m + end_m) / 2, self.thickness_m / 2
        here = [p for p in self.patches if p.start_m < middle_m < p.end_m]
        sheets = [
            (patch, sign * (half_m + patch.thickness_m / 2))
            for patch in here
            for face, sign in _SIDES
            if patch.on(face)
        ]
        layers = [_Layer(self, self.width_m, self.thickness_m, 0.0)]
        layers += [_Layer(p, p.width_m, p.thickness_m, z) for p, z in sheets if patched]
        # (1): the neutral axis, about which the layers bend and turn
        axis_m = sum(layer.stretching_n * layer.middle_m for layer in layers)
        axis_m /= sum(layer.stretching_n for layer in layers)
        return Section(
            start_m,
            end_m,
            bending_n_m2=sum(layer.bending_n_m2(axis_m) for layer in layers),
            shear_n=sum(layer.shear_n for layer in layers),
            mass_kg_per_m=sum(layer.density_kg_m3 * layer.area_m2 for layer in layers),
            rotary_kg_m=sum(layer.rotary_kg_m(axis_m) for layer in layers),
            # (4): a sheet's stress acts at its middle
            moment_n_m_per_v=sum(
                patch.stress_constant_c_m2 * patch.width_m * abs(z_m - axis_m)
                for patch, z_m in sheets
            ),
        )


@dataclass(frozen=True)
class _Layer:
    """A rectangle of one material in a section, with its middle at a height over the beam's."""

    material: Beam | Patch
    width_m: float
    thickness_m: float
    middle_m: float

    @property
    def area_m2(self) -> float:
        return self.width_m * self.thickness_m

    @property
    def density_kg_m3(self) -> float:
        return self.material.density_kg_m3

    @property
    def stretching_n(self) -> float:
        return self.material.youngs_modulus_pa * self.area_m2

    @property
    def shear_n(self) -> float:
        """κGA with Cowper's κ = 10(1+ν)/(12+11ν) and G = E/2(1+ν)."""
        factor = 5.0 / (12 + 11 * self.material.poisson_ratio)
        return factor * self.stretching_n

    def _second_moment_m4(self, axis_m: float) -> float:
        return self.area_m2 * (self.thickness_m**2 / 12 + (self.middle_m - axis_m) ** 2)

    def bending_n_m2(self, axis_m: float) -> float:
        return self.material.youngs_modulus_pa * self._second_moment_m4(axis_m)

    def rotary_kg_m(self, axis_m: float) -> float:
        return self.density_kg_m3 * self._second_moment_m4(axis_m)
