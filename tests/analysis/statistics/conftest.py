"""The paper's Table 4, and tables drawn at random."""

import numpy as np
import pytest

from analysis.scores import ScoreTable

TABLE_4 = """
10  8 10 10 5
10 10 10  8 7
 8  8  8  7 4
10 10 10 10 8
 8  8 10  8 5
 8 10 10 10 7
 7 10  9  8 7
 7  8 10  7 8
 8  8 10  7 5
"""


@pytest.fixture
def published() -> ScoreTable:
    rows = [line.split() for line in TABLE_4.strip().splitlines()]
    return ScoreTable(
        subjects=tuple(f"S{number}" for number in range(1, 10)),
        conditions=("frequency", "structure", "voltage", "direction", "pressure"),
        scores=np.array(rows, dtype=np.float64),
    )
