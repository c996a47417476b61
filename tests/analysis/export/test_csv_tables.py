"""Columns of CSV, which are written at once, against the writer that takes row by row."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.cells import csv_text
from analysis.export.csv_tables import lists_of, texts_of
from analysis.loading.records import TEXT, values
from tests.analysis.hostile_study import NOTES

TYPED = st.text() | st.sampled_from([*NOTES, "", " ", "n/a", ";", '"', "1.0", "a,b"])
NUMBERS = st.floats(allow_nan=False) | st.sampled_from([0.0, -0.0, 1.0, 1e16, 1e-5])
WHOLE = st.integers(-(2**63), 2**63 - 1)
SCALARS = st.none() | st.booleans() | st.integers() | NUMBERS | TYPED
KINDS: dict[Any, st.SearchStrategy[Any]] = {
    "float64": st.none() | NUMBERS,
    "int64": WHOLE,
    "Int64": st.none() | WHOLE,
    "bool": st.booleans(),
    "boolean": st.none() | st.booleans(),
    "object": SCALARS | st.tuples(SCALARS, SCALARS),
    TEXT: st.none() | TYPED,
}


def column(kind: Any, cells: list[Any]) -> "pd.Series[Any]":
    made: pd.Series[Any] = pd.Series(cells, dtype=kind)
    return made


@pytest.mark.parametrize("kind", KINDS)
@settings(deadline=None)
@given(data=st.data())
def test_cells_are_those_of_rows(kind: Any, data: st.DataObject) -> None:
    told = column(kind, data.draw(st.lists(KINDS[kind])))
    # A cell beside it, because a row of one empty cell is written in a way of its own.
    rows = csv_text(["a", "b"], [(cell, 1) for cell in values(told)])
    assert "a,b\n" + "".join(f"{text},1\n" for text in texts_of(told)) == rows


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "object"])
@settings(deadline=None)
@given(data=st.data())
def test_lists_are_those_of_rows(kind: Any, data: st.DataObject) -> None:
    lists = data.draw(st.lists(st.lists(KINDS[kind], max_size=3)))
    told = column(kind, [cell for each in lists for cell in each])
    counts = np.array([len(each) for each in lists], np.int64)
    cells = iter(values(told))
    rows = csv_text(["a", "b"], [(tuple(next(cells) for _ in each), 1) for each in lists])
    assert "a,b\n" + "".join(f"{text},1\n" for text in lists_of(told, counts)) == rows
