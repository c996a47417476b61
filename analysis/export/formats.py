"""The formats of exported data by name."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from analysis.cells import BETWEEN_TOUCHES, csv_text, json_text
from analysis.export.bids import bids_export, bids_recordings
from analysis.export.columns import Column, known
from analysis.export.dataset import Dataset
from analysis.export.psychds import psychds_export
from analysis.export.readme import changed
from analysis.export.recordings import DRIVEN, MEASURED, TIME, samples_csv
from analysis.export.trial_table import cells


def csv_export(data: Dataset) -> dict[str, str]:
    """Return `trials.csv`, and `trials.json` that describes each of its columns.

    Data of a journal that was changed come with a `README.md` that says so.
    """
    described = {column.name: _described(column, data) for column in data.columns}
    return {
        **({"README.md": changed(data)} if data.broken_chains else {}),
        "trials.csv": trials_csv(data),
        "trials.json": json_text(described),
    }


def trials_csv(data: Dataset) -> str:
    """Return all trials as one table."""
    return csv_text([column.name for column in data.columns], cells(data.trials))


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


EXPORTS: Mapping[str, Callable[[Dataset], dict[str, str]]] = MappingProxyType(
    {"csv": csv_export, "bids": bids_export, "psychds": psychds_export}
)
"""Each returns text by relative path; nothing is written."""

RECORDINGS: Mapping[str, Callable[[Dataset], dict[str, bytes]]] = MappingProxyType(
    {"csv": csv_recordings, "bids": bids_recordings, "psychds": lambda _: {}}
)
"""Each returns further files by relative path: what was recorded during touches."""
