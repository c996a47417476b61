"""Random numbers of a virtual person, each at a known place of a stream that its name determines.

SHAKE-128 defines them, so that they are the same on every machine, and a session, which draws them
one row at a time, gets those that a simulated cohort draws at once.
"""

from collections.abc import Sequence
from hashlib import shake_128

import numpy as np

from device.beam.modes import FloatArray


def uniforms(stream: str, rows: int, columns: int) -> FloatArray:
    """Return the first rows of a stream: numbers between 0 and 1, shape (rows, columns).

    >>> bool((uniforms("a", 3, 2)[:2] == uniforms("a", 2, 2)).all())
    True
    """
    return np.asarray(uniforms_of([stream], rows, columns)[0])


def uniforms_of(streams: Sequence[str], rows: int, columns: int) -> FloatArray:
    """Return the first rows of each stream, shape (streams, rows, columns)."""
    size = 8 * rows * columns
    digests = b"".join([shake_128(name.encode()).digest(size) for name in streams])
    words = np.frombuffer(digests, dtype="<u8").reshape(len(streams), rows, columns)
    return np.asarray(((words >> 11) + 0.5) * 2.0**-53)
