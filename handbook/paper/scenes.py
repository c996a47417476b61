"""The paper's scenes, and what is computed in them: μ' along the beam and under a whole hand."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

import touchbeam
from analysis.estimates import FloatArray
from device.beam.beam import Beam
from device.beam.spectral import spectrum_with_mode
from device.friction.rungs import TOP_RUNG, rung_resonance_hz
from protocol.study.touch import TouchDefaults

MODE, WHOLE_BEAM = "mode", TOP_RUNG
"""The rungs: one mode of the bare beam, as in the paper; and the beam as built."""
MU, CONTACT_M, DRIVE_HZ = 0.4, 0.01, 24221.0
"""The paper's friction of the resting beam, its finger, and its drive (Section 3, Table 3)."""
SLIDING: Mapping[str, Any] = {"frequency_hz": 23200.0, "finger_load_n": 0.56}
"""Drive and block of the sliding experiment (Section 5.1)."""
SHEETS_M = 0.081
"""Where the sheets begin: they lie about the fifth peak of mode 6, which is assumed."""
TROUGHS_M = np.array([0.0137, 0.0275, 0.0422])
"""The first three troughs of Fig 12, as printed there and in Section 6."""
PERIODIC_M = 0.0231
"""Eq 15 is periodic from here on; the first rise lies before."""
PLACES_M = np.linspace(0.0, 0.1, 2001)
PATH_M = np.linspace(*TouchDefaults().path_m, 711)
"""The path of a study's conditions, every 0.1 mm."""
BEAM = Beam()
RESONANCE_HZ = rung_resonance_hz(MODE, BEAM, 6)


_EVEN_M = np.linspace(0.0, 0.1, 4001)[1:] - 1.25e-5


def mode_shape(x_m: FloatArray) -> FloatArray:
    """Return mode 6 of the bare beam at places, over its rms."""
    modes = spectrum_with_mode(BEAM, 6, patched=False, shear=False)
    places = (np.asarray(x_m, dtype=np.float64), _EVEN_M)
    shape, even = (modes.elements.deflection_at(modes.shapes[:, 5], at) for at in places)
    return np.asarray(shape / np.sqrt(np.mean(even**2)))


def _turns_m() -> tuple[FloatArray, FloatArray]:
    """Return the peaks and the nodes of mode 6 between the clamp and the tip."""
    shape = CubicSpline(_EVEN_M, mode_shape(_EVEN_M))
    peaks_m, nodes_m = shape.derivative().roots(), shape.roots()
    peaks_m, nodes_m = (at[(at > 1e-3) & (at < 0.0999)] for at in (peaks_m, nodes_m))
    return np.asarray(peaks_m), np.asarray(nodes_m)


PEAKS_M, _NODES_M = _turns_m()
EDGES_M = np.sort(np.concatenate([PEAKS_M, _NODES_M]))
"""Of mode 6: the peaks of the vibration, and all places where the bodies' direction changes."""


def mu(law: str, rung: str = MODE, **scene: Any) -> FloatArray:
    """Return μ' in the paper's scene, but for what `scene` changes."""
    return touchbeam.friction(law=law, rung=rung, **scene)


@lru_cache(maxsize=256)
def along(law: str, rung: str = MODE, **scene: Any) -> FloatArray:
    """Return μ' at `PLACES_M`."""
    return mu(law, rung, x_m=PLACES_M, **scene)


def periodic(law: str, rung: str = MODE, **scene: Any) -> FloatArray:
    """Return μ' where Eq 15 is periodic."""
    return along(law, rung, **scene)[PLACES_M >= PERIODIC_M]


def whole_hand(law: str, *, a: ArrayLike = 10.0, u: ArrayLike = 20.0, **scene: Any) -> FloatArray:
    """Return μ' of a hand on the whole beam, `a` of whose `u` bodies help."""
    share = np.divide(a, u)
    return mu(law, coverage="full", same_direction_fraction=share, body_count=u, **scene)


@lru_cache(maxsize=8)
def fig8(law: str) -> FloatArray:
    """Return μ' of a hand on the whole beam for a = 0 to 20 of 20 bodies."""
    return whole_hand(law, a=np.arange(21))


def term(name: str, law: str = "consistent", rung: str = MODE, **scene: Any) -> FloatArray:
    """Return another column of `touchbeam predict` in the paper's scene."""
    columns = {"x_m": 0.0414, **scene}
    cells = np.broadcast_arrays(*map(np.atleast_1d, columns.values()))
    table = pd.DataFrame(dict(zip(columns, cells, strict=True)))
    return touchbeam.predict(table, law=law, rung=rung)[name].to_numpy()


def trough_places_m(curve: FloatArray) -> FloatArray:
    """Return the middles of minima, plateaus included, that are 0.01 below both adjacent peaks."""
    from scipy.signal import find_peaks

    # Rounded, so that a plateau is one minimum: its values differ in the last digits.
    places, _ = find_peaks(-np.round(curve, 9), prominence=0.01)
    return np.asarray(PLACES_M[places])


def left_troughs_m(law: str) -> FloatArray:
    """Return the troughs of μ' left of the sheets in the paper's scene."""
    troughs = trough_places_m(along(law))
    return troughs[troughs < SHEETS_M]
