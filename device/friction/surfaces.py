"""Where friction comes from: a beam's model, a table that was measured, or what touches state."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, cast, get_args

import numpy as np

from device.arrays import FloatArray
from device.beam.beam import Beam, Patch
from device.beam.spectral import natural_frequency_hz
from device.friction.scenes import Drive, Structure
from protocol.errors import BadInput
from protocol.study.surface import Surface
from protocol.study.touch import Direction

COLUMNS = ("voltage_v", "frequency", "place_m", "direction", "force_n", "speed_m_s", "beam")
"""What a table of friction may depend on; `frequency` is relative to the resonance."""
WORDS = ("direction", "beam")
FRICTION = "friction"
RESONANCE = "resonance_hz"
"""A column that names the resonance at which `frequency` is 1: one value, on which nothing
depends."""


@dataclass(frozen=True, kw_only=True)
class BeamSurface:
    """A beam whose friction is predicted, and the mode that is driven."""

    structure: Structure = field(default_factory=Structure)
    mode: int = Drive().mode

    @property
    def length_m(self) -> float:
        return self.structure.beam.length_m

    @property
    def half_wave_m(self) -> float:
        """Half of the bare beam's wave length, without shear, at the frequency of the mode."""
        beam = self.structure.beam
        own_hz = natural_frequency_hz(beam, self.mode, patched=False, shear=False)
        bare = beam.bare
        return math.pi / bare.wave_number_per_m(own_hz / beam.frequency_scale, shear=False)


PAPERS = BeamSurface()
"""The paper's beam, which a study without a surface touches."""


@dataclass(frozen=True, kw_only=True)
class GivenSurface:
    """A surface without a model: friction is what a touch states, or not known."""

    length_m: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionTable:
    """Measured friction on a full grid, interpolated in its logarithm; see `friction_table`.

    Attributes:
        axes: the knots of each column that is there, rising; numbers, or words in their order.
        logs: ln friction, an axis for each column.
        digest: SHA-256 of the file.
    """

    axes: Mapping[str, tuple[float, ...] | tuple[str, ...]]
    logs: FloatArray
    digest: str
    resonance_hz: float | None = None

    def friction(self, at: Mapping[str, FloatArray | str], *, nearest: bool = False) -> FloatArray:
        """Return friction at places of the grid, multilinear in ln friction.

        Beyond the grid it is NaN, or that of the `nearest` place. `at` has a number or an array,
        which broadcast, for each column, or a word.
        """
        from scipy.interpolate import interpn

        if not self.axes:
            return np.exp(self.logs.reshape(1))
        positions = [self._position(name, at[name], nearest=nearest) for name in self.axes]
        places = np.stack(np.broadcast_arrays(np.zeros(1), *positions)[1:], axis=-1)
        # Beyond the last knot there is nothing to go to: an axis of one knot counts twice.
        knots = [np.arange(max(size, 2)) for size in self.logs.shape]
        logs = np.pad(self.logs, [(0, size == 1) for size in self.logs.shape], mode="edge")
        return np.exp(interpn(knots, logs, places, bounds_error=False, fill_value=np.nan))

    def at_knots(self, name: str, value: float) -> float:
        """Return where a number lies among the knots of a column, NaN beyond them."""
        return float(self._position(name, np.array(value), nearest=False)[0])

    def _position(self, name: str, value: FloatArray | str, *, nearest: bool) -> FloatArray:
        """Return where a value lies among the knots, as a fractional number; else see above."""
        knots = self.axes[name]
        if name in WORDS:
            beyond = 0.0 if nearest else math.nan
            return np.array([float(knots.index(value)) if value in knots else beyond])
        places = np.atleast_1d(np.asarray(value, dtype=np.float64))
        edges = np.asarray(knots, dtype=np.float64)
        slack = 1e-9 * max(abs(edges[0]), abs(edges[-1]))
        inside = (places >= edges[0] - slack) & (places <= edges[-1] + slack)
        return np.where(inside | nearest, np.interp(places, edges, np.arange(edges.size)), np.nan)

    def left_out_error(self) -> dict[str, float]:
        """Return by column the largest error in ln friction if every second knot is left out."""
        errors = {}
        for axis, (name, knots) in enumerate(self.axes.items()):
            if name in WORDS or len(knots) < 3:
                continue
            along = np.moveaxis(self.logs, axis, 0)
            edges = np.asarray(knots, dtype=np.float64)
            middle = np.arange(1, edges.size - 1, 2)
            part = (edges[middle] - edges[middle - 1]) / (edges[middle + 1] - edges[middle - 1])
            part = part.reshape(-1, *[1] * (along.ndim - 1))
            between = along[middle - 1] * (1 - part) + along[middle + 1] * part
            errors[name] = float(np.abs(between - along[middle]).max())
        return errors


@dataclass(frozen=True, kw_only=True)
class MeasuredSurface:
    """A surface whose friction was measured."""

    length_m: float
    table: FrictionTable


AnySurface = BeamSurface | MeasuredSurface | GivenSurface


def length_of(surface: Surface) -> float:
    """Return the length of what a study touches, m."""
    return surface.length_m or PAPERS.length_m


def beam_surface(surface: Surface) -> BeamSurface:
    """Return the beam that a study describes, or the paper's."""
    own = Structure()
    beam = own.beam
    if surface.is_own_beam:
        names = (
            *("length_m", "thickness_m", "width_m", "youngs_modulus_pa", "density_kg_m3"),
            *("poisson_ratio", "damping_ratio", "supports"),
        )
        patches = tuple(Patch(**patch.model_dump()) for patch in surface.patch)
        beam = Beam(**{name: getattr(surface, name) for name in names}, patches=patches)
    return BeamSurface(
        structure=Structure(
            beam=beam,
            body_count=surface.bodies.count,
            body_mass_kg=surface.bodies.mass_kg_per_m,
            body_height_m=surface.bodies.height_m,
            friction_coefficient=surface.friction or own.friction_coefficient,
        ),
        mode=surface.mode or PAPERS.mode,
    )


# The table's file.


MOST_ROWS = 1_000_000
_MOST_SHOWN = 60
"""Letters of a table that a message repeats."""


def friction_table(rows: Sequence[Sequence[str]], source: str, digest: str) -> FrictionTable:
    """Return the table of a file's rows, of which the first names the columns.

    Raises:
        BadInput: a column or a cell is wrong, a cell of the grid is missing or there twice, or
            friction is not above 0; names file, line and column.
    """
    header = [name.strip() for name in rows[0]] if rows else []
    _require_columns(header, source)
    names = [name for name in header if name in COLUMNS]
    cells: dict[Knot, float] = {}
    resonances: set[float] = set()
    for line, row in enumerate(rows[1:], start=2):
        if any(cell.strip() for cell in row):
            values = _values(header, row, source, line)
            knot = tuple(values[name] for name in names)
            if knot in cells:
                raise BadInput(f"{source}, line {line}: {_said(names, knot)} stands twice")
            cells[knot] = math.log(cast(float, values[FRICTION]))
            resonances |= {cast(float, values[name]) for name in header if name == RESONANCE}
    if not 0 < len(cells) <= MOST_ROWS:
        raise BadInput(f"{source}: must have 1 to {MOST_ROWS:,} rows of friction, got {len(cells)}")
    if len(resonances) > 1:
        raise BadInput(f"{source}, column {RESONANCE}: must hold one value, got {len(resonances)}")
    axes = {name: tuple(sorted({knot[at] for knot in cells})) for at, name in enumerate(names)}
    return FrictionTable(
        axes=axes,
        logs=_on_grid(axes, cells, source),
        digest=digest,
        resonance_hz=next(iter(resonances), None),
    )


Knot = tuple[Any, ...]
"""Numbers and words of one cell of the grid."""


def _values(
    header: Sequence[str], row: Sequence[str], source: str, line: int
) -> dict[str, float | str]:
    if len(row) != len(header):
        raise BadInput(f"{source}, line {line}: {len(header)} cells are due, got {len(row)}")
    return {
        name: _word(cell.strip(), name, source, line)
        if name in WORDS
        else _number(cell.strip(), name, source, line)
        for name, cell in zip(header, row, strict=True)
    }


def _on_grid(
    axes: Mapping[str, tuple[Any, ...]], cells: Mapping[Knot, float], source: str
) -> FloatArray:
    sizes = [len(knots) for knots in axes.values()]
    if math.prod(sizes) > len(cells):
        missing = next(knot for knot in product(*axes.values()) if knot not in cells)
        said = _said([*axes], missing)
        raise BadInput(f"{source}: {said} is missing; every combination of values is due")
    logs = np.empty(sizes)
    for index, knot in zip(np.ndindex(logs.shape), product(*axes.values()), strict=True):
        logs[index] = cells[knot]
    return logs


def _require_columns(header: Sequence[str], source: str) -> None:
    known = (FRICTION, *COLUMNS, RESONANCE)
    if FRICTION not in header:
        given = ", ".join(header)[:_MOST_SHOWN] or "none"
        hint = "; separate cells by commas" * any(it in given for it in ";\t")
        raise BadInput(f"{source}, line 1: a column {FRICTION} is due, got {given}{hint}")
    for name in header:
        if name not in known:
            shown = repr(name[:_MOST_SHOWN])
            raise BadInput(f"{source}, line 1: unknown column {shown}; known: {', '.join(known)}")
        if list(header).count(name) > 1:
            raise BadInput(f"{source}, line 1: column {name!r} stands twice")


_LIMITS = {
    FRICTION: (0.001, 10.0),
    RESONANCE: (20.0, 1e5),
    "voltage_v": (0.0, 200.0),
    "frequency": (0.1, 10.0),
    "place_m": (0.0, 1.0),
    "force_n": (0.0, 100.0),
    "speed_m_s": (0.0, 10.0),
}
"""Of the numbers of a table; friction as what touches state."""


def _word(cell: str, name: str, source: str, line: int) -> str:
    if name == "direction" and cell not in get_args(Direction):
        where = f"{source}, line {line}, column {name}"
        raise BadInput(f"{where}: must be {' or '.join(get_args(Direction))}, got {cell!r}")
    return cell


def _number(cell: str, name: str, source: str, line: int) -> float:
    try:
        value = float(cell) if cell.isascii() and "_" not in cell else math.nan
    except ValueError:
        value = math.nan
    where = f"{source}, line {line}, column {name}"
    if not math.isfinite(value):
        hint = "; write a point, not a comma" * ("," in cell)
        raise BadInput(f"{where}: a number is due, got {cell!r}{hint}")
    low, high = _LIMITS[name]
    if not low <= value <= high:
        raise BadInput(f"{where}: must lie in [{low:g}, {high:g}], got {value:g}")
    return value


def _said(names: Sequence[str], knot: Knot) -> str:
    pairs = zip(names, knot, strict=True)
    parts = (
        f"{name} {part:.15g}" if isinstance(part, float) else f"{name} {part}"
        for name, part in pairs
    )
    return ", ".join(parts) or "friction"
