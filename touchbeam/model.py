"""The friction model and psychometric functions for Python programs, without a study."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike, NDArray

    from analysis.thresholds.answer_curve import Shape
    from analysis.thresholds.psychometric import Guess
    from device.beam.eq15 import Overlap
    from device.friction.surfaces import BeamSurface


def predict(
    scenes: "pd.DataFrame",
    *,
    law: str = "consistent",
    rung: str = "beam",
    tolerance: float = 1e-6,
    eq15_overlap: "Overlap" = "first",
) -> "pd.DataFrame":
    """Return `scenes`, a row each, with the predicted friction, as `touchbeam predict` does.

    A missing `frequency_hz` in the result is the resonance.

    Args:
        scenes: the columns that 'Friction model' (touchbeam docs) lists; each is optional,
            missing cells take the paper's values.
        law: the friction law.
        rung: a rung of `touchbeam ladder`.
        tolerance: the largest error in μ' of the numbers on the rung `beam`, 1e-8 or more.
        eq15_overlap: the piece of Eq 15 that applies where two overlap.

    Raises:
        ValueError: a column or a cell is wrong; line 2 is the first scene.
    """
    options = {"law": law, "rung": rung, "tolerance": tolerance, "eq15_overlap": eq15_overlap}
    return predicted_frame(scenes, None, options)


def predicted_frame(
    scenes: "pd.DataFrame", defaults: Mapping[str, float] | None, options: Mapping[str, Any]
) -> "pd.DataFrame":
    """Return the predictions of the scenes; `defaults` fill missing cells."""
    import pandas as pd

    from analysis.model.predict import PredictOptions, predicted_table
    from analysis.model.scene_table import column_table

    names = [str(name).strip() for name in scenes.columns]
    repeated = [name for name in names if names.count(name) > 1]
    if repeated or not names:
        said = f"column {repeated[0]!r} stands twice" if repeated else "no column is given"
        raise ValueError(f"scenes, line 1: {said}")
    # `column_table` knows one mark of a missing cell, None; pandas has several.
    columns = {
        name: column.to_numpy()
        if column.dtype.kind in "iuf"
        else column.astype(object).where(column.notna(), None).to_numpy()
        for name, (_, column) in zip(names, scenes.items(), strict=True)
    }
    asked = PredictOptions(**options)
    table = column_table("scenes", columns, len(scenes), defaults, asked.rig.beam_surface)
    # With the caller's index, so that the result can be joined to the scenes.
    return pd.DataFrame(predicted_table(table, asked).columns, scenes.index)


def friction(
    *,
    law: str = "consistent",
    rung: str = "beam",
    tolerance: float = 1e-6,
    surface: "Mapping[str, Any] | None" = None,
    **scene: "ArrayLike",
) -> "NDArray[Any]":
    """Return the effective friction coefficient μ' of scenes, in the shape of the arguments.

    Args:
        law: the friction law.
        rung: a rung of `touchbeam ladder`.
        tolerance: the largest error in μ' of the numbers on the rung `beam`, 1e-8 or more.
        surface: a beam, with the keys of `[surface]` in a study file; by default the paper's.
        **scene: values of the columns that 'Friction model' (touchbeam docs) lists, such as
            `voltage_v` and `x_m`; numbers, words, or arrays of a common shape. What is left out,
            NaN or None is the surface's own value.

    Raises:
        ValueError: a value or the surface is wrong, or its friction is not from a model.
    """
    import numpy as np

    from analysis.model.predict import PredictOptions, predicted_table
    from analysis.model.scene_table import column_table
    from device.friction.calibration import Calibration

    columns = {
        name: np.ma.filled(values.astype(object), np.nan)  # what is masked is missing
        if isinstance(values, np.ma.MaskedArray)
        else np.asarray(values)
        for name, values in scene.items()
    }
    shape = np.broadcast_shapes(*(values.shape for values in columns.values()))
    # One value is not repeated, so that what depends on it alone is computed once.
    cells = {
        name: np.ravel(values if values.size == 1 else np.broadcast_to(values, shape))
        for name, values in columns.items()
    }
    beam = _beam_of(surface or {})
    table = column_table("scenes", cells, math.prod(shape), surface=beam)
    options = PredictOptions(law=law, rung=rung, tolerance=tolerance, rig=Calibration.of(beam))
    return predicted_table(table, options).predictions["mu_effective"].reshape(shape)


def _beam_of(surface: Mapping[str, Any]) -> "BeamSurface":
    from pydantic import ValidationError

    from device.friction.surfaces import beam_surface
    from protocol.study.surface import Surface

    if not isinstance(surface, Mapping):
        raise ValueError(  # noqa: TRY004 - as of any wrong value
            f"surface must have the keys of [surface] in a study file, got {surface!r}"
        )
    # Numbers of arrays are numbers, too.
    plain = {key: getattr(value, "tolist", lambda it=value: it)() for key, value in surface.items()}
    try:
        described = Surface.model_validate(plain)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        is_unknown = first["type"] == "extra_forbidden"
        rule = "unknown key" if is_unknown else first["msg"].removeprefix("Value error, ")
        raise ValueError(f"surface{where and '.'}{where}: {rule}") from None
    if described.kind != "beam":
        raise ValueError(f"surface: no model predicts the friction of kind {described.kind}")
    return beam_surface(described)


def fit(
    answers: "pd.DataFrame",
    *,
    task: str = "two intervals",
    shape: "Shape" = "weibull",
    threshold_at: float | None = None,
    lapse: float | None = None,
    guess: "Guess" = None,
    columns: str | None = None,
) -> "pd.DataFrame":
    """Return a row per participant and track with threshold, slope and lapse rate.

    The columns are those of `touchbeam fit --json`; an interval is a pair of its ends. Its
    `attrs["comparisons"]` compare the tracks of each participant.

    Args:
        answers: the columns participant, track, level, trials and correct; without trials a row
            is one trial, and correct is 1 or 0. In yes-no correct counts "yes". The `trials` of a
            study will do: their `level_value` is the level, and `left_out` in the result counts
            those that are catch trials, not answered, or excluded. A missing answer is left out.
        task: `yes or no`, `two intervals`, `three intervals`, or `2AFC`, `3AFC`, `4AFC`, ...
        shape: `normal` is a curve of the level, `weibull` one of its logarithm.
        threshold_at: the share correct that defines the threshold; else the curve's midpoint.
        lapse: the lapse rate if it is known, and in yes-no the share of false alarms.
        guess: the guess rate if it is not the task's; `free` to estimate it.
        columns: what columns are that have other names, as `subject=ID,level=volts`.

    Raises:
        ValueError: a column or a cell is wrong; line 2 is the first row.
    """
    import pandas as pd

    from analysis.tables.reading import frame_cells
    from analysis.thresholds.answer_table import comparisons, fits_of, tracks_in

    source = "answers"
    tracks = tracks_in(frame_cells(answers, source), shape, columns)
    asked = {"task": task, "shape": shape, "threshold_at": threshold_at, "lapse": lapse}
    fits = list(fits_of(tracks, source, **asked, guess=guess))
    rows = [
        {"participant": track.participant, "track": track.track}
        | vars(fit)
        | {"left_out": track.left_out.total()}
        for track, fit in fits
    ]
    table = pd.DataFrame(rows).drop(columns=["band", "likelihood"])
    table.attrs["comparisons"] = [vars(each) for each in comparisons(fits, shape)]
    return table
