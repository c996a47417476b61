"""The paper's Table 4, and a table made of any scores."""

from collections.abc import Callable

import numpy as np
import pytest

from analysis.scores import FloatArray, ScoreTable

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


@pytest.fixture(scope="session")
def table_of() -> Callable[[FloatArray], ScoreTable]:
    def build(scores: FloatArray) -> ScoreTable:
        subjects, conditions = np.shape(scores)
        return ScoreTable(
            subjects=tuple(f"s{row}" for row in range(subjects)),
            conditions=tuple(f"c{column}" for column in range(conditions)),
            scores=np.asarray(scores, dtype=np.float64),
        )

    return build
