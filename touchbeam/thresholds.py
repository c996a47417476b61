"""Thresholds for Python programs: psychometric functions fitted to tables of answers."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from analysis.thresholds.curve_posterior import Shape
    from analysis.thresholds.psychometric import Task


def fit(
    answers: "pd.DataFrame",
    *,
    task: "Task" = "two intervals",
    shape: "Shape" = "weibull",
    threshold_at: float | None = None,
    lapse: float | None = None,
) -> "pd.DataFrame":
    """Return a row per participant and track with threshold, slope and lapse rate.

    The columns are those of `touchbeam fit --json`; an interval is a pair of its ends.

    Args:
        answers: the columns participant, track, level, trials and correct; without trials a row
            is one trial, and correct is 1 or 0. In yes-no correct counts "yes".
        task: `yes or no`, `two intervals` or `three intervals`.
        shape: `normal` is a curve of the level, `weibull` one of its logarithm.
        threshold_at: the share correct that defines the threshold; else the curve's midpoint.
        lapse: the lapse rate if it is known, and in yes-no the share of false alarms.

    Raises:
        ValueError: a column or a cell is wrong; line 2 is the first row.
    """
    import pandas as pd

    from analysis.thresholds.answer_table import fits_of, tracks_in

    source = "answers"
    tracks = tracks_in(answers.to_csv(index=False), source, shape)
    found = fits_of(tracks, source, task=task, shape=shape, threshold_at=threshold_at, lapse=lapse)
    places = ("participant", "track")
    return pd.DataFrame(
        [{name: getattr(track, name) for name in places} | vars(fit) for track, fit in found]
    ).drop(columns="band")
