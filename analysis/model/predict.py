"""Batch prediction: a table of scenes in, the same table with friction coefficients out."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from analysis.estimates import BoolArray, FloatArray
from analysis.model.scene_table import COLUMNS, SceneTable, scene_table
from device.beam.eq15 import Overlap
from device.errors import OutOfRangeError
from device.friction.calibration import NOMINAL, Calibration
from device.friction.contact import Contact
from device.friction.fineness import TOLERANCE, fineness_for
from device.friction.prediction import Batch, LawChoice, Prediction, Ratio, rung_prediction
from device.friction.rungs import TOP_RUNG, rung_named, rung_resonance_hz
from device.friction.scenes import Coverage, Direction
from device.friction.surfaces import BeamSurface
from protocol.errors import BadInput
from protocol.study.study import Study

OUTPUTS = (
    "mu_effective",
    "same_direction_ratio",
    "anisotropy",
    "inertial_ratio",
    "inertial_load_n",
    "displacement_m",
)


_NUMBERS_PER_SCENE, _MOST_NUMBERS = 64, 2**21
"""About so many numbers are in memory at once."""


@dataclass(frozen=True, kw_only=True)
class PredictOptions:
    """What `touchbeam predict` is asked for."""

    law: str = "consistent"
    rung: str = TOP_RUNG
    tolerance: float = TOLERANCE
    eq15_overlap: Overlap = "first"
    rig: Calibration = NOMINAL

    def __post_init__(self) -> None:
        # Made only to be checked, so that a wrong option is refused before a table is read.
        LawChoice(name=self.law, overlap=self.eq15_overlap)
        fineness_for(self.tolerance)
        object.__setattr__(self, "rung", rung_named(self.rung))

    def model_hz(self, frequency_hz: FloatArray) -> FloatArray:
        """Return drives of the rig as drives of the model that are as far from its resonance."""
        if self.rig.resonance_hz is None:
            return frequency_hz
        own = self.rig.beam_surface
        own_hz = rung_resonance_hz(self.rung, own.structure.beam, own.mode)
        return np.asarray(frequency_hz * (own_hz / self.rig.resonance_hz))


def study_rig(study: Study, rig: Calibration = NOMINAL, *, instead: str = "") -> Calibration:
    """Return the rig as calibrated; without a fitted resonance its own is the study's nominal one.

    As everywhere in a study, a drive in Hz is then as far from the resonance as on the rig. Raise
    `BadInput` for a surface whose friction no model predicts, with what to do `instead`.
    """
    if not isinstance(rig.surface, BeamSurface):
        raise BadInput(
            f"the surface of {study.study.name} has kind {study.surface.kind}: no model predicts "
            f"its friction{instead and f'; {instead}'}"
        )
    return replace(rig, resonance_hz=rig.resonance_hz or study.rig.nominal_resonance_hz)


def study_defaults(study: Study, rig: Calibration = NOMINAL) -> dict[str, float]:
    """Return a study's touch, and the rig as calibrated, as defaults for blank cells."""
    touch = study.touch
    return {
        "damping_ratio": rig.damping_ratio,
        "body_height_m": rig.body_height_m,
        "x_m": touch.smooth_place_m,
        "contact_m": touch.contact_m,
        "finger_load_n": touch.force_n,
        "sliding_speed_m_s": touch.sliding_speed_m_s,
    }


def _optional(values: FloatArray) -> FloatArray | None:
    """Return a column of which a group has all values; None if it has none."""
    # One value tells, because a group is made of rows that all have it or all lack it.
    return None if np.isnan(values[:1]).any() else values


def _shared(values: FloatArray) -> FloatArray:
    """Return a column's one value, shape (1,), if all values are the same bits, else all."""
    if values.size == 1:
        return values
    # Bits rather than values, because NaN differs from itself and -0 equals 0.
    bits = values.view(np.int64)
    return values[:1] if (bits == bits[0]).all() else values


def _word(table: SceneTable, name: str, rows: NDArray[np.intp]) -> str:
    words = table.words[name]
    return str(words[rows[0] if words.size == len(table.lines) else 0])


def _group_batch(table: SceneTable, rows: NDArray[np.intp], options: PredictOptions) -> Batch:
    count = len(table.lines)
    number = {
        name: _shared(values if values.size != count else values[rows])
        for name, values in table.numbers.items()
    }
    # At least one column must say how many scenes the batch has.
    number["x_m"] = np.broadcast_to(number["x_m"], rows.size)
    mode = int(number.pop("mode")[0])
    driven = {name: number.pop(name) for name in ("voltage_v", "frequency_hz", "damping_ratio")}
    # A calibrated rig moves by `gain` as much as the model at the same voltage.
    driven["voltage_v"] = options.rig.gain * driven["voltage_v"]
    driven["frequency_hz"] = options.model_hz(driven["frequency_hz"])
    contact = Contact(
        beam=options.rig.structure.beam,
        coverage=cast(Coverage, _word(table, "coverage", rows)),
        direction=cast(Direction, _word(table, "direction", rows)),
        finger_load_n=_optional(number.pop("finger_load_n")),
        same_direction_fraction=_optional(number.pop("same_direction_fraction")),
        **number,
    )
    return Batch(contact=contact, mode=mode, **driven)


def _groups(table: SceneTable) -> Iterator[NDArray[np.intp]]:
    """Yield rows to compute in one pass: alike in mode, words and what is given at all."""
    count = len(table.lines)
    columns = [*table.words.values(), table.numbers["mode"]]
    columns += [
        np.isnan(table.numbers[name]) for name in ("finger_load_n", "same_direction_fraction")
    ]
    # What all rows share separates none of them; most tables are then one group and need no
    # sorting.
    keys = [
        np.unique(column, return_inverse=True)[1]
        for column in columns
        if (column != column[0]).any()
    ]
    if not keys:
        yield np.arange(count)
        return
    _, group = np.unique(np.stack(keys), axis=1, return_inverse=True)
    # Stable, so that rows of a group keep the order of the table.
    order = np.argsort(group, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(group[order])) + 1)


def _predicted(batch: Batch, options: PredictOptions, ratio: Ratio) -> Prediction:
    choice = LawChoice(name=options.law, ratio=ratio, overlap=options.eq15_overlap)
    fineness = fineness_for(options.tolerance)
    return rung_prediction(batch, options.rung, choice.on(batch.beam), fineness)


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictedTable:
    """A table of scenes with its predictions, shape (n,) each.

    The error bound is the tolerance, on the rung `beam`; the others differ from it by their model.
    """

    table: SceneTable
    predictions: Mapping[str, FloatArray]
    rung: str
    error_bound: float

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """Every input column as used, the predictions, rung, error bound and note.

        The note names an a/u outside [0, 1], which the printed law takes from Eq 15 as it stands.
        """
        given = {**self.table.numbers, **self.table.words}
        count = len(self.table.lines)
        return {
            **{name: np.broadcast_to(given[name], count) for name in COLUMNS},
            **{name: self.predictions[name] for name in OUTPUTS},
            "rung": np.full(count, self.rung),
            "error_bound": np.broadcast_to(self.error_bound, count),
            "note": np.where(self.impossible, "a/u outside 0 to 1", ""),
        }

    @property
    def impossible(self) -> BoolArray:
        """Where a/u lies outside 0 to 1, so that the printed law may give friction below 0."""
        ratio = self.predictions["same_direction_ratio"]
        return (ratio < 0) | (ratio > 1)


def predicted_table(table: SceneTable, options: PredictOptions) -> PredictedTable:
    """Return the predictions for a table of scenes; warn if the printed law has impossible ones.

    Raises:
        BadInput: a mode lies beyond the cut-off of the rung it needs, or a contact is too short
            for Eq 15 under a repaired law; names file and line.
    """
    count = len(table.lines)
    # The C library on Linux keeps as much memory as was once given back to it as a whole; else the
    # system would clear all arrays of each call anew, which takes as long as the predictions.
    np.empty(min(_NUMBERS_PER_SCENE * count, _MOST_NUMBERS))
    columns = {name: np.empty(count) for name in OUTPUTS}
    for rows in _groups(table) if count else ():
        ratio = cast(Ratio, _word(table, "ratio", rows))
        try:
            batch = _group_batch(table, rows, options)
            prediction = _predicted(batch, options, ratio)
        except OutOfRangeError as error:
            raise table.complaint(rows[error.row], error.name, error.rule, error.value) from None
        which = rows if rows.size < count else slice(None)
        for name, column in columns.items():
            column[which] = getattr(prediction, name)
    bound = options.tolerance if options.rung == TOP_RUNG else np.nan
    predicted = PredictedTable(
        table=table, predictions=columns, rung=options.rung, error_bound=bound
    )
    if predicted.impossible.any():
        warnings.warn(_impossible(predicted), stacklevel=2)
    return predicted


def _impossible(predicted: PredictedTable) -> str:
    """Return which scenes are impossible, with the numbers of the first one."""
    rows, table = np.flatnonzero(predicted.impossible), predicted.table
    names = ("same_direction_ratio", "mu_effective")
    ratio, mu = (predicted.predictions[name][rows[0]] for name in names)
    return (
        f"by Eq 15, a/u lies outside 0 to 1 in {len(rows)} of {len(table.lines)} scenes, first in "
        f"line {table.lines[rows[0]]} of {table.source}: a/u {ratio:.3g} makes mu_effective "
        f"{mu:.3g}; take a longer contact, the ratio 'mode' or another law"
    )


def _texts(values: FloatArray, missing: str = "") -> list[str]:
    """Return the shortest texts that give the same numbers; what is not given is `missing`."""
    shared = values.strides == (0,)  # one value, which `broadcast_to` repeats
    texts = [
        missing if value != value else repr(value).removesuffix(".0")  # noqa: PLR0124 - nan alone
        for value in (values[:1] if shared else values).tolist()
    ]
    return texts * len(values) if shared else texts


def csv_text(predicted: PredictedTable) -> str:
    columns = [
        _texts(values, getattr(COLUMNS.get(name), "word", ""))
        if values.dtype == np.float64
        else values.tolist()
        for name, values in predicted.columns.items()
    ]
    # Nothing needs quotes: all words are from lists of the model's own.
    rows = map(",".join, zip(*columns, strict=True))
    return "\n".join([",".join(predicted.columns), *rows, ""])


def predict(
    source: str,
    text: str,
    options: PredictOptions | None = None,
    defaults: Mapping[str, float] | None = None,
) -> str:
    """Return a CSV text of scenes with its predictions, as CSV text.

    `source` is the file's name, for messages; `defaults` are values for blank cells in place of the
    paper's. `analysis.model.scene_table` has the columns.

    Raises:
        BadInput: a cell breaks its column's rule; names file, line, column, rule and value.
    """
    options = options or PredictOptions()
    table = scene_table(source, text, defaults, options.rig.beam_surface)
    return csv_text(predicted_table(table, options))
