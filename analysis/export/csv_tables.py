"""Tables as CSV, each with a JSON file that describes its columns."""

import io
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from analysis.cells import BETWEEN_TOUCHES, csv_cell, csv_item, csv_quoted, csv_scalar, json_text
from analysis.estimates import IntArray
from analysis.export.dataset import Dataset, known
from analysis.export.recordings import DRIVEN, MEASURED, TIME, samples_csv
from analysis.loading.records import values
from protocol.study.columns import TOUCH_COLUMNS, Column


def csv_tables(data: Dataset) -> dict[str, str]:
    """Return tables of trials, touches, contrasts and participants, each with its description."""
    touched = data.tables.touched
    return {
        **_table("trials", data.tables.flat, data.columns, data),
        # Published scores have no touches; an empty table would look like a loss.
        **({} if touched.empty else _table("touches", touched, TOUCH_COLUMNS, data)),
        **_table("contrasts", data.contrasts, data.contrast_columns, data),
        **_table("participants", data.participants, data.participant_columns, data),
    }


def _table(
    name: str, table: pd.DataFrame, columns: Sequence[Column], data: Dataset
) -> dict[str, str]:
    touched, counts = data.tables.touched, data.tables.counts
    texts = [
        lists_of(touched[it.name], counts) if it.per_touch else texts_of(table[it.name])
        for it in columns
    ]
    out = io.StringIO()  # takes half the memory of all rows before they are joined
    out.write(",".join(csv_quoted(csv_cell(it.name)) for it in columns) + "\n")
    out.writelines(f"{','.join(row)}\n" for row in zip(*texts, strict=True))
    return {
        f"{name}.csv": out.getvalue(),
        f"{name}.json": json_text({csv_cell(it.name): _described(it, data) for it in columns}),
    }


# Columns as texts: most have few different values, each of which is made a text once.


def texts_of(column: "pd.Series[Any]") -> list[str]:
    """Return a column's cells as `csv_text` writes them."""
    codes, known = _coded(column)
    if column.dtype == np.float64:
        return _taken([*map(repr, known)], "", codes)
    return _taken([csv_quoted(csv_scalar(value)) for value in known], "", codes)


def lists_of(column: "pd.Series[Any]", counts: IntArray) -> list[str]:
    """Return cells with lists as `csv_text` writes them: of each trial its `counts` of values."""
    codes, known = _coded(column)
    missing = codes < 0
    if missing.all():
        return [""] * len(counts)
    told = [*map(repr if column.dtype == np.float64 else csv_item, known)]
    items = _taken(told, csv_item(None), codes)
    spans = pairwise([0, *np.cumsum(counts).tolist()])
    lists = [BETWEEN_TOUCHES.join(items[begin:end]) for begin, end in spans]
    if missing.any():
        of = np.repeat(np.arange(len(counts)), counts)
        empty = np.bincount(of, ~missing, len(counts)) == 0
        lists = ["" if none else text for text, none in zip(lists, empty.tolist(), strict=True)]
    return lists if told == [*map(csv_quoted, told)] else [*map(csv_quoted, lists)]


def _coded(column: "pd.Series[Any]") -> tuple[IntArray, Sequence[Any]]:
    """Return the place of each value of a column among those of a list; -1 for a missing value."""
    if column.dtype == np.float64:
        numbers = column.to_numpy()
        # By their bits, because 0.0 and -0.0 are equal.
        codes, bits = pd.factorize(numbers.view(np.int64))
        return np.where(np.isnan(numbers), -1, codes), bits.view(np.float64).tolist()
    if column.dtype == object:  # 1, 1.0 and True are equal, too
        told = values(column)
        return np.array([-1 if it is None else n for n, it in enumerate(told)], np.int64), told
    codes, known = pd.factorize(column)
    return codes, known.tolist()


def _taken(texts: Sequence[str], missing: str, codes: IntArray) -> list[str]:
    taken: list[str] = np.array([*texts, missing], object)[codes].tolist()
    return taken


def csv_recordings(data: Dataset) -> dict[str, bytes]:
    """Return a table of samples for each session that recorded touches, and what describes it."""
    files = {
        f"recordings/{data.subject_labels[who]}_session-{number}.csv": samples_csv(touches)
        for (who, number), touches in data.recorded_by_session()
    }
    columns = {it.name: _described(it, data) for it in (TIME, *MEASURED, *DRIVEN)}
    return {**files, "recordings/recordings.json": json_text(columns).encode()} if files else {}


def _described(column: Column, data: Dataset) -> dict[str, object]:
    return known(
        {
            "description": data.meaning(column),
            "unit": column.unit,
            "levels": dict(data.levels(column)),
            "one_per_touch_separated_by": BETWEEN_TOUCHES if column.per_touch else None,
            "any_separated_by": BETWEEN_TOUCHES if column.several else None,
        }
    )
