"""How finely the beam is computed for a tolerance in μ'; measured by `benchmarks/tolerances.py`."""

from device.beam.driven import FINENESS, Fineness
from device.beam.spectral import Mesh
from device.errors import OutOfRangeError

_LADDER = (
    (1e-3, Fineness(Mesh(8, 3.5), 4, 0.8)),
    (1e-4, Fineness(Mesh(12, 4.0), 6, 0.6)),
    (1e-5, Fineness(Mesh(12, 4.0), 12, 0.35)),
    (1e-6, FINENESS),
    (1e-7, Fineness(Mesh(14, 4.0), 32, 0.15)),
    (1e-8, Fineness(Mesh(16, 4.0), 48, 0.1)),
)
TOLERANCES = tuple(tolerance for tolerance, _ in _LADDER)
TOLERANCE = 1e-6
"""The tolerance where none is asked for."""


def fineness_for(tolerance: float) -> Fineness:
    """Return the coarsest that keeps μ' within the tolerance, or raise `OutOfRangeError`."""
    for kept, fineness in _LADDER:
        if kept <= tolerance:
            return fineness
    rule = f"must be at least {TOLERANCES[-1]:g}"
    raise OutOfRangeError("tolerance", rule, tolerance)


DEFAULT = fineness_for(TOLERANCE)
