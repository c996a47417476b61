"""The exported table of predicted contrasts: a row per trial and friction law."""

import pandas as pd

from analysis.export.columns import CONTRAST_COLUMNS
from analysis.loading.sessions import Sessions
from analysis.trials.contrasts import trial_contrasts
from device.friction.calibration import Calibration
from device.friction.contrasts import RUNG
from protocol.study.study import Study


def contrast_table(
    study: Study, found: Sessions, trials: pd.DataFrame, rig: Calibration
) -> pd.DataFrame:
    """Return what each law predicts for each of the exported `trials`, as in the report.

    Args:
        study: the present study.
        found: what `trials` were made from, with measures.
        trials: a `trial_table`.
        rig: of the trials for which no calibration was in force.
    """
    begun = found.trials.loc[trials.index]
    touches = found.touches[found.touches["attempt_id"].isin(begun.index)]
    contrasts = trial_contrasts(study, begun, touches.assign(place_m=found.places_m), rig)
    laws = [
        trials.assign(
            law=law, rung=RUNG, predicted_contrast=predicted, touch_measured=contrasts.measured
        )
        for law, predicted in contrasts.by_law.items()
    ]
    rows = pd.concat(laws).loc[trials.index]
    return rows[[column.name for column in CONTRAST_COLUMNS]].reset_index(drop=True)
