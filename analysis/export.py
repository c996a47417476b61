"""The formats of exported data by name."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from analysis.export_bids import bids_export
from analysis.export_csv import csv_export
from analysis.export_dataset import Dataset
from analysis.export_psychds import psychds_export

EXPORTS: Mapping[str, Callable[[Dataset], dict[str, str]]] = MappingProxyType(
    {"csv": csv_export, "bids": bids_export, "psychds": psychds_export}
)
"""Each returns text by relative path; nothing is written."""
