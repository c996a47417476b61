"""The cantilever touch beam and its piezoelectric patches (paper, Tables 1 and 2)."""

import math
from dataclasses import dataclass, field

from device.errors import below, not_negative, positive, whole, within


@dataclass(frozen=True, kw_only=True)
class Patches:
    """The piezoelectric sheets, which lie opposite each other on the beam's two faces.

    Lengths, modulus, density and stress constant are Table 2's. Assumed, not in the paper: two
    sheets, their centre at the fifth antinode of mode 6 (86 mm), Poisson's ratio of a PZT ceramic.
    """

    count: int = 2
    length_m: float = 0.010
    thickness_m: float = 0.3e-3
    width_m: float = 5e-3
    youngs_modulus_pa: float = 76.5e9
    density_kg_m3: float = 7500.0
    stress_constant_c_m2: float = 2.0
    poisson_ratio: float = 0.31
    centre_m: float = 0.086

    def __post_init__(self) -> None:
        whole("patch count", self.count, 1)
        for name in ("length_m", "thickness_m", "width_m", "density_kg_m3", "centre_m"):
            positive(f"patch {name}", getattr(self, name))
        positive("patch youngs_modulus_pa", self.youngs_modulus_pa)
        not_negative("patch stress_constant_c_m2", self.stress_constant_c_m2)
        below("patch poisson_ratio", self.poisson_ratio, -1.0, 0.5)

    @property
    def start_m(self) -> float:
        """Where the sheets begin, seen from the clamp."""
        return self.centre_m - self.length_m / 2

    @property
    def end_m(self) -> float:
        return self.centre_m + self.length_m / 2


@dataclass(frozen=True, kw_only=True)
class Beam:
    """A clamped-free beam of rectangular section with its patches (Table 1).

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
    patches: Patches = field(default_factory=Patches)

    def __post_init__(self) -> None:
        for name in ("length_m", "thickness_m", "width_m", "youngs_modulus_pa", "density_kg_m3"):
            positive(f"beam {name}", getattr(self, name))
        positive("frequency_scale", self.frequency_scale)
        below("beam poisson_ratio", self.poisson_ratio, -1.0, 0.5)
        below("damping_ratio", self.damping_ratio, 0.0, 1.0)
        within("patch start_m", self.patches.start_m, 0.0, self.length_m)
        within("patch end_m", self.patches.end_m, 0.0, self.length_m)

    @property
    def area_m2(self) -> float:
        return self.width_m * self.thickness_m

    @property
    def second_moment_m4(self) -> float:
        """The section's second moment of area about its neutral axis."""
        return self.width_m * self.thickness_m**3 / 12

    @property
    def mass_kg(self) -> float:
        """The bare beam's mass ρWhL."""
        return self.density_kg_m3 * self.area_m2 * self.length_m

    @property
    def wave_constant_m2_s(self) -> float:
        """√(EI/ρA), which turns a squared wave number into an angular frequency."""
        flexural_rigidity = self.youngs_modulus_pa * self.second_moment_m4
        return self.frequency_scale * math.sqrt(
            flexural_rigidity / (self.density_kg_m3 * self.area_m2)
        )

    @property
    def patch_moment_n_m_per_v(self) -> float:
        """The moment M0/V that the sheets put on the beam at their two ends.

        M0 = n e31 Wp (h + hp)/2 · V: each sheet's stress acts at half the distance between the
        sheets' middles. The paper prints no expression for it.
        """
        sheet = self.patches
        lever_m = (self.thickness_m + sheet.thickness_m) / 2
        return sheet.count * sheet.stress_constant_c_m2 * sheet.width_m * lever_m
