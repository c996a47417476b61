"""The formats of exported data by name."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from analysis.export.bids import bids_export, bids_recordings
from analysis.export.csv_tables import csv_recordings, csv_tables
from analysis.export.dataset import Dataset
from analysis.export.psychds import psychds_export
from analysis.export.readme import changed


def csv_export(data: Dataset) -> dict[str, str]:
    """Return the tables; data of a journal that was changed have a `README.md` that says so."""
    warned = {"README.md": changed(data)} if data.broken_chains else {}
    return {**warned, **csv_tables(data)}


EXPORTS: Mapping[str, Callable[[Dataset], dict[str, str]]] = MappingProxyType(
    {
        "csv": csv_export,
        "bids": bids_export,
        "psychds": psychds_export,
    }
)
"""Each returns text by relative path; nothing is written."""

RECORDINGS: Mapping[str, Callable[[Dataset], dict[str, bytes]]] = MappingProxyType(
    {
        "csv": csv_recordings,
        "bids": bids_recordings,
        "psychds": lambda _: {},
    }
)
"""Each returns further files by relative path: what was recorded during touches."""
