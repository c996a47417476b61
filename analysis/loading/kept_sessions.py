"""The tables of a journal as data that can be kept: arrays, and each different value once."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.estimates import NotEstimable
from analysis.friction.recorded import TouchForces
from analysis.loading.course import planned_touch
from analysis.loading.records import TEXT, Exclusion, Incident, numbered
from analysis.loading.sessions import Sessions
from device.friction.scenes import Calibration
from protocol.journal.events import StudyAmended, StudyRegistered
from protocol.journal.records import VirtualTruth

_TABLES = ("sessions", "attempts", "touches", "answers", "traces")
_AS_THEY_ARE = ("withdrawn", "withdrawn_completed", "incidents", "exclusions", "forces")
_MASKED = {"Int64": pd.arrays.IntegerArray, "boolean": pd.arrays.BooleanArray}
"""pandas' own types of numbers, which can be missing."""
_NUMBERS = {**dict.fromkeys(("text", "object", "moment", "Int64"), "int64"), "boolean": "bool"}
"""The type of the numbers in such a column, where it is not the column's own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Column:
    """A column of this type: numbers, of which some may be missing, or which of `values` each is.

    A missing text has the number -1. The bytes of the numbers are compressed column by column,
    since all of them at once would need as much memory as the report.
    """

    type: str
    packed: bytes
    missing: bytes = b""
    values: tuple[VirtualTruth | Calibration | Any, ...] = ()


def _packed(numbers: NDArray[Any]) -> bytes:
    return zlib.compress(np.ascontiguousarray(numbers).tobytes(), level=1)


def _unpacked(packed: bytes, kind: str) -> NDArray[Any]:
    return np.frombuffer(zlib.decompress(packed), kind)


@dataclass(frozen=True, kw_only=True, eq=False)
class KeptSessions:
    """What `Sessions` has, and the names of the `broken` chains."""

    tables: Mapping[str, Mapping[str, Column]]
    forces: Mapping[int, TouchForces | NotEstimable]
    incidents: tuple[Incident, ...]
    exclusions: tuple[Exclusion, ...]
    withdrawn: int
    withdrawn_completed: int
    decisions: tuple[tuple[str, StudyAmended | StudyRegistered], ...]
    broken: tuple[str, ...]

    def sessions(self) -> Sessions:
        known: dict[str, Any] = {name: getattr(self, name) for name in _AS_THEY_ARE}
        for table, columns in self.tables.items():
            known[table] = pd.DataFrame({name: _series(name, of) for name, of in columns.items()})
        told = [(datetime.fromisoformat(utc), event) for utc, event in self.decisions]
        return Sessions(**known, decisions=told)


def kept_sessions(found: Sessions, broken: Sequence[str]) -> KeptSessions:
    """Return as data what was found in a journal, some of whose chains may be `broken`."""
    return KeptSessions(
        tables={
            table: {name: _column(name, column) for name, column in getattr(found, table).items()}
            for table in _TABLES
        },
        **{name: getattr(found, name) for name in _AS_THEY_ARE},
        decisions=tuple(
            (utc.isoformat(), event)
            for utc, event in found.decisions
            if isinstance(event, StudyAmended | StudyRegistered)
        ),
        broken=tuple(broken),
    )


def _column(name: str, column: "pd.Series[Any]") -> Column:
    kind = str(column.dtype)
    if column.dtype == TEXT:
        codes, distinct = pd.factorize(column)
        return Column(type="text", packed=_packed(codes), values=tuple(distinct.tolist()))
    if kind == "object":
        codes, told = numbered(column.tolist())
        if name == "planned":  # touches, which are read again as the journal's are
            told = [touch.model_dump(exclude_unset=True) for touch in told]
        return Column(type=kind, packed=_packed(codes), values=tuple(told))
    if kind in _MASKED:
        numbers = column.to_numpy(_NUMBERS[kind], na_value=0)
        return Column(type=kind, packed=_packed(numbers), missing=_packed(column.isna().to_numpy()))
    if kind.startswith("datetime64"):
        # Microseconds, of which the smallest number stands for a missing moment.
        return Column(type="moment", packed=_packed(column.dt.tz_localize(None).to_numpy()))
    return Column(type=kind, packed=_packed(column.to_numpy()))


def _series(name: str, column: Column) -> "pd.Series[Any]":
    kind = column.type
    numbers = _unpacked(column.packed, _NUMBERS.get(kind, kind))
    if kind == "text":
        texts = pd.array(np.array(column.values, object), dtype=TEXT)
        return pd.Series(texts.take(numbers, allow_fill=True))
    if kind == "object":
        told: Sequence[Any] = column.values
        if name == "planned":
            told = [planned_touch(each) for each in told]
        return pd.Series([told[number] for number in numbers.tolist()], dtype=object)
    if kind in _MASKED:
        return pd.Series(_MASKED[kind](numbers, _unpacked(column.missing, "bool"), copy=True))
    if kind == "moment":
        return pd.Series(numbers.view("datetime64[us]")).dt.tz_localize("UTC")
    return pd.Series(numbers)
