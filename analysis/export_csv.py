"""The tidy export: one table, a row per trial, and what its columns mean."""

from analysis.export_column import Column
from analysis.export_columns import COLUMNS, cells
from analysis.export_dataset import Dataset
from analysis.export_readme import changed
from analysis.export_text import BETWEEN_TOUCHES, csv_text, json_text


def csv_export(data: Dataset) -> dict[str, str]:
    """Return `trials.csv`, and `trials.json` that describes each of its columns.

    Data of a journal that was changed come with a `README.md` that says so.
    """
    described = {column.name: _described(column, data) for column in COLUMNS}
    return {
        **({"README.md": changed(data)} if data.broken_chains else {}),
        "trials.csv": trials_csv(data),
        "trials.json": json_text(described),
    }


def trials_csv(data: Dataset) -> str:
    """Return all trials as one table."""
    rows = (cells(trial) for trial in data.trials.trials)
    return csv_text([column.name for column in COLUMNS], rows)


def _described(column: Column, data: Dataset) -> dict[str, object]:
    levels = data.condition_levels() if column.name == "condition" else column.levels
    return {
        "description": column.description,
        **({"unit": column.unit} if column.unit else {}),
        **({"levels": dict(levels)} if levels else {}),
        **({"one_per_touch_separated_by": BETWEEN_TOUCHES} if column.per_touch else {}),
    }
