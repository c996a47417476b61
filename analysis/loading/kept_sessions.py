"""The tables of a journal as data that can be kept: arrays, and each different value once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.estimates import BoolArray, IntArray, NotEstimable
from analysis.friction.recorded import TouchForces
from analysis.loading.course import planned_touch
from analysis.loading.records import TEXT, Exclusion, Incident
from analysis.loading.sessions import Sessions
from device.friction.scenes import Calibration
from protocol.journal.events import StudyAmended, StudyRegistered
from protocol.journal.records import VirtualTruth

_TABLES = ("sessions", "attempts", "touches", "answers", "traces")
_AS_THEY_ARE = ("withdrawn", "withdrawn_completed", "incidents", "exclusions", "forces")
_MASKED = {"Int64": (pd.arrays.IntegerArray, np.int64), "boolean": (pd.arrays.BooleanArray, bool)}
"""pandas' own types of numbers, which can be missing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Column:
    """A column of this type: numbers, of which some may be missing, or which of `values` each is.

    A missing text has the number -1.
    """

    type: str
    numbers: NDArray[Any]
    missing: BoolArray | None = None
    values: tuple[VirtualTruth | Calibration | Any, ...] = ()


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
        """Return the sessions."""
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
        return Column(type="text", numbers=codes, values=tuple(distinct.tolist()))
    if kind == "object":
        codes, told = _numbered(column.tolist())
        if name == "planned":  # touches, which are read again as the journal's are
            told = [touch.model_dump(exclude_unset=True) for touch in told]
        return Column(type=kind, numbers=codes, values=tuple(told))
    if kind in _MASKED:
        missing = column.isna().to_numpy()
        numbers = column.to_numpy(_MASKED[kind][1], na_value=0)
        return Column(type=kind, numbers=numbers, missing=missing)
    if kind.startswith("datetime64"):
        # Microseconds, of which the smallest number stands for a missing moment.
        since = column.dt.tz_localize(None).to_numpy().view(np.int64)
        return Column(type="moment", numbers=since)
    return Column(type=kind, numbers=column.to_numpy())


def _numbered(values: Sequence[Any]) -> tuple[IntArray, list[Any]]:
    """Return the place of each value among the different objects, and those."""
    # By identity, because 1, 1.0 and True are equal, and a mapping has no hash.
    place_of: dict[int, int] = {}
    places = [place_of.setdefault(id(value), len(place_of)) for value in values]
    told = dict(zip(places, values, strict=True))
    return np.array(places, np.int64), list(told.values())


def _series(name: str, column: Column) -> "pd.Series[Any]":
    numbers, kind = column.numbers, column.type
    if kind == "text":
        texts = pd.array(np.array(column.values, object), dtype=TEXT)
        return pd.Series(texts.take(numbers, allow_fill=True))
    if kind == "object":
        told: Sequence[Any] = column.values
        if name == "planned":
            told = [planned_touch(each) for each in told]
        return pd.Series([told[number] for number in numbers.tolist()], dtype=object)
    if kind in _MASKED:
        return pd.Series(_MASKED[kind][0](numbers, column.missing))
    if kind == "moment":
        return pd.Series(numbers.view("datetime64[us]")).dt.tz_localize("UTC")
    return pd.Series(numbers)
