"""The surface that is touched, whose friction is predicted, measured, or stated by each touch."""

import re
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from protocol.study.fields import Count, Line, NotNegative, Positive, Record, required, setting

SurfaceKind = Literal["beam", "measured", "given"]
Support = Literal["clamped", "pinned", "free"]
Faces = Literal["both", "upper", "lower"]

# From a razor blade to a plank; steel has 210 GPa, diamond 1,050.
_Length = Annotated[Positive, Field(ge=0.005, le=1)]
_Thickness = Annotated[Positive, Field(ge=1e-5, le=0.1)]
_Modulus = Annotated[Positive, Field(ge=1e6, le=2e12)]
_Density = Annotated[Positive, Field(ge=10, le=30_000)]
_Poisson = Annotated[float, Field(gt=-1, lt=0.5, allow_inf_nan=False, strict=True)]
Friction = Annotated[Positive, Field(ge=0.001, le=10)]
"""A coefficient: ice on ice has 0.02, rubber on rubber 1.2."""
_InPicture = Annotated[NotNegative, Field(le=1)]


_TABLE = re.compile(r"\w[\w. -]*(/\w[\w. -]*)*\.csv", re.IGNORECASE)
# No part begins with a point, so that no name leads out of the folder.


def is_table_name(name: str) -> bool:
    """Return whether `name` may name a table: a path that does not leave the study's folder."""
    return _TABLE.fullmatch(name) is not None


TableName = Annotated[
    Line,
    required(is_table_name, "must name a .csv file in the study's folder, such as friction.csv"),
]


class SurfacePatch(Record):
    """A piezoelectric sheet on one face, or two that lie opposite each other."""

    centre_m: Annotated[Positive, Field(le=1, description="its middle, from the beam's left end")]
    length_m: Annotated[Positive, Field(le=1, description="along the beam")]
    width_m: Annotated[Positive, Field(le=1, description="across the beam")]
    thickness_m: Annotated[_Thickness, Field(description="of one sheet")]
    faces: Faces = setting("both", "which faces of the beam have a sheet there")
    youngs_modulus_pa: Annotated[_Modulus, Field(description="of its material, Pa: 63e9 of PZT")]
    density_kg_m3: Annotated[_Density, Field(description="likewise, kg/m³: 7500 of PZT")]
    poisson_ratio: Annotated[_Poisson, Field(description="likewise: 0.31 of PZT")]
    # 0 drives nothing.
    stress_constant_c_m2: Annotated[Positive, Field(le=100)]
    """e31, C/m², as a magnitude: 2 to 20 of PZT"""


class Bodies(Record):
    """The ciliary bodies on the surface; their spacing is in `[beams]`."""

    count: Count = setting(20, "how many a hand covers; only for full coverage", le=10_000)
    height_m: NotNegative = setting(0.001, "over the surface", le=0.05)
    mass_kg_per_m: NotNegative = setting(0.01, "their mass per metre of beam", le=100)


GEOMETRY = (
    "length_m",
    "thickness_m",
    "width_m",
    "youngs_modulus_pa",
    "density_kg_m3",
    "poisson_ratio",
    "damping_ratio",
    "supports",
    "mode",
    "patch",
)
"""The keys of a beam of one's own: one of them makes all of them necessary."""
_KEYS: dict[SurfaceKind, frozenset[str]] = {
    "beam": frozenset({*GEOMETRY, "friction", "bodies"}),
    "measured": frozenset({"length_m", "table", "picture", "path_in_picture"}),
    "given": frozenset({"length_m", "picture", "path_in_picture"}),
}
_NECESSARY: dict[SurfaceKind, tuple[str, ...]] = {
    "beam": (),
    "measured": ("length_m", "table"),
    "given": ("length_m",),
}
NO_PICTURE = "none"


class Surface(Record):
    """What is touched, and where its friction comes from; without this table the paper's beam."""

    kind: SurfaceKind = "beam"
    """`beam`: friction is predicted; `measured`: it comes from a table; `given`: each touch says
    its own, or none"""
    length_m: _Length | None = setting(None, "of what is touched, between its two ends")
    thickness_m: _Thickness | None = setting(None, "of a `beam`, in the direction of its motion")
    width_m: _Length | None = setting(None, "of a `beam`")
    youngs_modulus_pa: _Modulus | None = setting(None, "of its material, Pa: 70e9 of aluminium")
    density_kg_m3: _Density | None = setting(None, "likewise, kg/m³: 2700 of aluminium")
    poisson_ratio: _Poisson | None = setting(None, "likewise: 0.33 of aluminium")
    damping_ratio: Annotated[Positive, Field(ge=1e-6, lt=1)] | None = None
    """of the vibration; what a sliding experiment fits replaces it"""
    supports: tuple[Support, Support] | None = setting(None, "its left and right end")
    mode: Annotated[Count, Field(le=40)] | None = None
    """which of its modes is driven, counted from the lowest that bends it"""
    friction: Friction | None = setting(None, "its coefficient with the drive off; by default 0.4")
    bodies: Bodies = setting(Bodies(), "its ciliary bodies")
    patch: tuple[SurfacePatch, ...] = setting((), "its piezoelectric sheets", max_length=50)
    table: TableName | None = None
    """file of a `measured` surface in the study's folder, such as `friction.csv`"""
    picture: Line | None = None
    """file that participants see in place of a beam, not of a `beam`; `none`: words alone"""
    path_in_picture: tuple[tuple[_InPicture, _InPicture], tuple[_InPicture, _InPicture]] | None = (
        None
    )
    """where the path begins and ends in the picture, as parts of its width and height from its
    upper left corner; without it the picture has no marks"""

    @model_validator(mode="after")
    def _fits_kind(self) -> Self:
        # A key at its default, as in a study that was dumped, says nothing.
        fields = type(self).model_fields
        own = {name: getattr(self, name) for name in self.model_fields_set - {"kind"}}
        given = {name for name, value in own.items() if value != fields[name].default}
        if foreign := sorted(given - _KEYS[self.kind]):
            raise ValueError(f"kind {self.kind} has no such key, got {foreign[0]}")
        necessary = _NECESSARY[self.kind]
        if self.kind == "beam" and not given.isdisjoint(GEOMETRY):
            # A beam that is half described would silently keep the brass of the paper's.
            necessary = GEOMETRY
        if missing := [key for key in necessary if key not in given]:
            of_own = " that a study describes" if necessary is GEOMETRY else ""
            wanted = ", ".join(necessary)
            raise ValueError(f"kind {self.kind}{of_own} needs {wanted}, got no {missing[0]}")
        if self.path_in_picture and self.picture in {None, NO_PICTURE}:
            raise ValueError("path_in_picture must stand beside a picture, got none")
        if self.path_in_picture and self.path_in_picture[0] == self.path_in_picture[1]:
            raise ValueError("path_in_picture must have two ends, got the same place twice")
        return self

    @property
    def is_own_beam(self) -> bool:
        """Whether it is a beam that the study describes, and not the paper's."""
        return self.kind == "beam" and self.length_m is not None
