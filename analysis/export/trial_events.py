"""Trials as BIDS events: when each began, how long it lasted, and what kind of event it was.

Hierarchical Event Descriptors (HED) say the kind in words that programs understand.
"""

from collections.abc import Mapping
from typing import Any

import pandas as pd

from analysis.cells import json_text, tsv_text
from analysis.export.columns import COLUMNS, known
from analysis.loading.records import values

HED_VERSION = "8.3.0"
_TOUCH = "Sensory-event, Tactile-presentation"
_HED = {
    "baseline": f"{_TOUCH}, Label/Baseline",
    "signal": f"{_TOUCH}, Label/Signal",
    "practice": f"{_TOUCH}, Label/Practice",
    "trial": f"{_TOUCH}, Experimental-stimulus, Target",
    "catch": f"{_TOUCH}, Experimental-stimulus, Non-target",
}
"""By kind of trial."""
_KINDS = next(column for column in COLUMNS if column.name == "trial_kind")
_COLUMNS: dict[str, dict[str, Any]] = {
    "onset": {"Description": "When the trial began, from the first one's beginning.", "Units": "s"},
    "duration": {
        "Description": "From the trial's beginning to its last answer; missing without one.",
        "Units": "s",
    },
    "trial_type": {
        "Description": _KINDS.description,
        "Levels": {kind: _KINDS.levels[kind] for kind in _HED},
        "HED": _HED,
    },
    "response_time": {"Description": "From the question to the answer.", "Units": "s"},
    "trial_index": {"Description": "Place of the trial in the session's plan, from 0."},
}


def event_files(stem: str, trials: pd.DataFrame, task: Mapping[str, Any]) -> dict[str, str]:
    """Return the table of a session's events, in the order of time, and its sidecar.

    Published scores are no events. `task` is what each sidecar of the session says of it.
    """
    timed = trials[trials["started_utc"].notna()]
    if timed.empty:
        return {}
    began = pd.to_datetime(timed["started_utc"])
    table = timed.assign(onset=(began - began.min()).dt.total_seconds()).sort_values("onset")
    names = ["onset", "duration_s", "trial_kind", "reaction_time_s", "trial_index"]
    rows = zip(*(values(table[name]) for name in names), strict=True)
    software = {
        "SoftwareName": "touchbeam",
        "SoftwareVersion": values(table["touchbeam_version"])[0],
    }
    return {
        f"{stem}_events.tsv": tsv_text(list(_COLUMNS), rows),
        f"{stem}_events.json": json_text(
            {**task, "StimulusPresentation": known(software), **_COLUMNS}
        ),
    }
