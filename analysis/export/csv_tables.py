"""Tables as CSV, each with a JSON file that describes its columns."""

from collections.abc import Sequence

import pandas as pd

from analysis.cells import BETWEEN_TOUCHES, csv_of_columns, json_text
from analysis.export.columns import CONTRAST_COLUMNS, TOUCH_COLUMNS, Column, known
from analysis.export.dataset import Dataset
from analysis.export.recordings import DRIVEN, MEASURED, TIME, samples_csv
from analysis.export.trial_table import touch_table
from analysis.loading.records import values


def csv_tables(data: Dataset, *, shared: bool = False) -> dict[str, str]:
    """Return tables of trials, touches, contrasts and participants, each with its description.

    Args:
        data: what is exported.
        shared: whether others are to have it, who get no private columns.
    """
    columns = data.shared_columns if shared else data.columns
    touches = touch_table(data.trials)
    return {
        **_table("trials", data.trials, columns, data),
        **({} if touches.empty else _table("touches", touches, TOUCH_COLUMNS, data)),
        **_table("contrasts", data.contrasts, CONTRAST_COLUMNS, data),
        **_table("participants", data.participants, data.participant_columns, data),
    }


def _table(
    name: str, table: pd.DataFrame, columns: Sequence[Column], data: Dataset
) -> dict[str, str]:
    names = [column.name for column in columns]
    return {
        f"{name}.csv": csv_of_columns(names, (values(table[name]) for name in names)),
        f"{name}.json": json_text({column.name: _described(column, data) for column in columns}),
    }


def csv_recordings(data: Dataset) -> dict[str, bytes]:
    """Return a table of samples for each session that recorded touches, and what describes it."""
    files = {
        f"recordings/{data.subject_labels[who]}_session-{number}.csv": samples_csv(touches)
        for (who, number), touches in data.recorded_by_session()
    }
    columns = {
        name: known({"description": said["Description"], "unit": said.get("Units")})
        for name, said in {"t_s": TIME, **MEASURED, **DRIVEN}.items()
    }
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
