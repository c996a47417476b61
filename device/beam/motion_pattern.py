"""The pattern of a complex motion, set up once and then evaluated at any number of places.

|W| has no closed integral. It is stored as polynomials on cells that are halved towards its
minima, where it is almost a corner if the damping is small; sums of their integrals give the mean
over a window.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from device.beam.modes import FloatArray
from device.beam.motion import Motion, direction, sample_places, zone_edges_m
from device.beam.windows import Pattern, Window, window_width

BoolArray = NDArray[np.bool_]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_CELLS_PER_RADIAN = 4
_ROUGH, _FLOOR, _HALVINGS = 3e-8, 1e-11, 26
_NARROW = 1e-5  # part of the length below which a window is summed on its own
_MONOMIALS = np.linalg.inv(np.vander(_NODES, increasing=True))


_POWERS = np.arange(1, _NODES.size + 1)
_OF_POWERS = _MONOMIALS / _POWERS[:, None]
_ANTIDERIVATIVE = np.vstack([-((-1.0) ** _POWERS) @ _OF_POWERS, _OF_POWERS])
"""From values at the nodes to the antiderivative's coefficients of t⁰ … t⁶; it is 0 at t = -1."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pieces:
    """Pieces of the beam, each in one zone and in one cell, which keeps its middle and polynomial.

    Attributes:
        edges_m: the pieces' inner edges; all else is per piece, shape (pieces,).
        zone_start_m: where its zone begins; `moves_right` is 1 or 0.
        right_before_m: the right-moving length before its zone.
        middle_m: its cell's middle; `per_m` is 2 over its cell's width.
        coefficients: shape (7, pieces), ∫|W|dx/rms from the clamp in t on [-1, 1] of its cell.
    """

    edges_m: FloatArray
    zone_start_m: FloatArray
    moves_right: FloatArray
    right_before_m: FloatArray
    middle_m: FloatArray
    per_m: FloatArray
    coefficients: FloatArray

    def before(self, place_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the right-moving length and ∫|W|dx/rms between the clamp and each place."""
        piece = np.searchsorted(self.edges_m, place_m, side="right")
        right = place_m - self.zone_start_m.take(piece)
        right *= self.moves_right.take(piece)
        right += self.right_before_m.take(piece)
        t = place_m - self.middle_m.take(piece)
        t *= self.per_m.take(piece)
        area = self.coefficients[-1].take(piece)
        for row in self.coefficients[-2::-1]:
            area *= t
            area += row.take(piece)
        return right, area


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionPattern(Pattern):
    """Direction and magnitude of a motion along the beam; |W| is relative to its rms.

    Attributes:
        motion: the motion itself, for windows narrower than any cell.
        rms_m_per_v: the rms of |W| over the beam.
        edges_m: zone edges, from 0 to the length; `moves_right` is 1 or 0 for each zone.
        pieces: the cells, cut at the zone edges too, so that one search finds cell and zone.
    """

    motion: Motion
    rms_m_per_v: float
    edges_m: FloatArray
    moves_right: FloatArray
    pieces: _Pieces

    def window(self, x_m: FloatArray, contact_m: FloatArray | float) -> Window:
        """See `Pattern`."""
        width_m = window_width(x_m, contact_m)
        narrow = np.flatnonzero((width_m > 0) & (width_m < _NARROW * self.length_m))
        places = np.concatenate([x_m - width_m, x_m])
        count = x_m.size
        right, area = self.pieces.before(places)
        width = np.where(width_m > 0, width_m, 1.0)
        share = np.clip((right[count:] - right[:count]) / width, 0.0, 1.0)
        mean = (area[count:] - area[:count]) / width
        if narrow.size:
            mean[narrow] = self._narrow_mean(x_m[narrow], width_m[narrow])
        return Window(right=share, left=1.0 - share, mean=mean)

    def _narrow_mean(self, x_m: FloatArray, width_m: FloatArray) -> FloatArray:
        """Return the mean over narrow windows from the motion itself."""
        places = x_m[:, None] + np.multiply.outer(width_m, (_NODES - 1) / 2)
        order = np.argsort(places, axis=None)
        magnitude = np.empty(places.size)
        magnitude[order] = np.abs(self.motion.state(places.ravel()[order]).deflection)
        means = magnitude.reshape(places.shape) @ _WEIGHTS / (2 * self.rms_m_per_v)
        return np.asarray(means)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cells:
    """Cells with the motion's magnitudes at each cell's nodes, shape (cells, 6)."""

    low_m: FloatArray
    high_m: FloatArray
    deflection: FloatArray
    rotation: FloatArray

    @property
    def half_m(self) -> FloatArray:
        """Half of each cell's width, shape (cells, 1)."""
        return np.asarray((self.high_m - self.low_m)[:, None] / 2)

    def rough(self, floor_m_per_v: float) -> BoolArray:
        """Return whether |W|'s highest coefficient is still large beside |W| in the cell."""
        highest = np.abs(self.deflection @ _MONOMIALS[-1])
        limit = np.maximum(_ROUGH * self.deflection.max(axis=1), floor_m_per_v)
        return np.asarray(highest > limit)


def _measured(motion: Motion, low_m: FloatArray, high_m: FloatArray) -> _Cells:
    """Return cells from `low_m` to `high_m`, in rising order, with the motion at their nodes."""
    half = (high_m - low_m)[:, None] / 2
    nodes = (high_m + low_m)[:, None] / 2 + half * _NODES
    state = motion.state(nodes.ravel())
    return _Cells(
        low_m=low_m,
        high_m=high_m,
        deflection=np.abs(state.deflection).reshape(nodes.shape),
        rotation=np.abs(state.rotation).reshape(nodes.shape),
    )


def _cells(motion: Motion) -> _Cells:
    """Return even cells, split at the joints and halved until |W| is smooth in each."""
    length_m = motion.length_m
    count = int(motion.wave_number_per_m * length_m * _CELLS_PER_RADIAN) + 16
    edges = np.union1d(np.linspace(0.0, length_m, count + 1), motion.joints_m)
    open_cells = _measured(motion, edges[:-1], edges[1:])
    done, smooth = [open_cells], []
    floor = max(motion.rounding_m_per_v, _FLOOR * float(open_cells.deflection.max()))
    for _ in range(_HALVINGS):
        rough = open_cells.rough(floor)
        smooth.append(~rough)
        if not rough.any():
            break
        low, high = open_cells.low_m[rough], open_cells.high_m[rough]
        middle = (low + high) / 2
        ends = np.stack([low, middle, middle, high], axis=-1).reshape(-1, 2)
        open_cells = _measured(motion, ends[:, 0], ends[:, 1])
        done.append(open_cells)
    else:
        smooth.append(np.ones(open_cells.low_m.size, dtype=np.bool_))
    kept = np.flatnonzero(np.concatenate(smooth))
    columns = {
        name: np.concatenate([getattr(cells, name) for cells in done]) for name in vars(open_cells)
    }
    order = kept[np.argsort(columns["low_m"][kept])]
    return _Cells(**{name: values[order] for name, values in columns.items()})


def _pieces(
    cells: _Cells, rms_m_per_v: float, edges_m: FloatArray, moves_right: FloatArray
) -> _Pieces:
    """Return the pieces of cells and zones, each with its zone's and its cell's numbers."""
    area = cells.half_m * cells.deflection / rms_m_per_v
    coefficients = _ANTIDERIVATIVE @ area.T
    coefficients[0, 1:] += np.cumsum(area @ _WEIGHTS)[:-1]
    right_m = np.concatenate([[0.0], np.cumsum(np.diff(edges_m) * moves_right)])
    start_m = np.union1d(cells.low_m, edges_m[:-1])
    cell = np.searchsorted(cells.low_m[1:], start_m, side="right")
    zone = np.searchsorted(edges_m[1:-1], start_m, side="right")
    return _Pieces(
        edges_m=start_m[1:],
        zone_start_m=edges_m[zone],
        moves_right=moves_right[zone],
        right_before_m=right_m[zone],
        middle_m=((cells.low_m + cells.high_m) / 2)[cell],
        per_m=(2 / (cells.high_m - cells.low_m))[cell],
        coefficients=np.take(coefficients, cell, axis=1),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionSummary:
    """A motion's pattern with its rms deflection, m/V, and rms rotation, rad/V."""

    pattern: MotionPattern
    displacement_m_per_v: float
    rotation_per_v: float


def motion_summary(motion: Motion) -> MotionSummary:
    """Return the pattern of a motion; this is the work that all places share."""
    places = sample_places(motion)
    inner = zone_edges_m(motion, places)
    edges = np.concatenate([[0.0], inner, [motion.length_m]])
    moves_right = (direction(motion.state((edges[1:] + edges[:-1]) / 2))[0] > 0).astype(np.float64)
    cells = _cells(motion)
    length_m = motion.length_m
    rms = float(np.sqrt(np.sum(cells.half_m * cells.deflection**2 * _WEIGHTS) / length_m))
    pattern = MotionPattern(
        length_m=length_m,
        motion=motion,
        rms_m_per_v=rms,
        edges_m=edges,
        moves_right=moves_right,
        pieces=_pieces(cells, rms, edges, moves_right),
    )
    return MotionSummary(
        pattern=pattern,
        displacement_m_per_v=rms,
        rotation_per_v=float(
            np.sqrt(np.sum(cells.half_m * cells.rotation**2 * _WEIGHTS) / length_m)
        ),
    )
