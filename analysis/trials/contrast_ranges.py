"""The range of each condition's contrast over rungs, laws, and what the paper leaves open."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import Interval
from analysis.loading.study_data import StudyData
from analysis.sensitivity.ratings import Ratings
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import AT_A_PLACE, CONDITIONS, Change, Kind, trial_change
from device.friction.contrasts import predicted_contrast
from device.friction.laws import LAWS
from device.friction.rungs import SEGMENTED_RUNGS
from protocol.study.study import Study

RUNGS = ("mode", *SEGMENTED_RUNGS)
"""The models of the beam; the cheaper rungs approximate the first of them."""
FACTORS = (0.5, 0.5**0.5, 1.0, 2**0.5, 2.0)
"""Multiples of the damping ratio and of the finger's speed, neither of which the paper gives."""


@dataclass(frozen=True, kw_only=True)
class ContrastRange:
    """A condition's contrast as planned, its kind, and its values if one assumption changes.

    `by_damping` and `by_speed` are keyed by damping ratio and by finger speed, m/s. A value is NaN
    where a law gives no friction above 0.
    """

    condition: str
    kind: Kind
    value: float
    by_rung: Mapping[str, float]
    by_law: Mapping[str, float]
    by_damping: Mapping[str, float]
    by_speed: Mapping[str, float]

    @property
    def ends(self) -> Interval:
        """The smallest and the largest value under the same law."""
        values = [
            value
            for known in (self.by_rung, self.by_damping, self.by_speed)
            for value in known.values()
            if not math.isnan(value)
        ]
        return min(values, default=self.value), max(values, default=self.value)


def condition_changes(study: Study, data: StudyData) -> dict[str, Change]:
    """Return the change of each condition that is known, as planned and at level 1.

    For published scores it is that of the standard scenes.
    """
    own = {
        entry.name: trial_change(study, entry.question, entry.expected, entry.touches)
        for entry in study.condition
    }
    known = CONDITIONS if data.kinds == ("published",) else {**CONDITIONS, **own}
    return {name: known[name] for name in data.table.conditions if name in known}


def contrast_range(condition: str, change: Change, rig: Calibration = NOMINAL) -> ContrastRange:
    """Return the contrast of a condition with its values under other assumptions."""
    damping_ratio, speed = rig.damping_ratio, change.before.sliding_speed_m_s
    return ContrastRange(
        condition=condition,
        kind=change.kind,
        value=predicted_contrast(change, rig=rig),
        by_rung={rung: predicted_contrast(change, rung=rung, rig=rig) for rung in RUNGS},
        by_law={law: predicted_contrast(change, law, rig=rig) for law in LAWS},
        by_damping={
            f"{factor * damping_ratio:.4g}": predicted_contrast(
                change, rig=replace(rig, damping_ratio=factor * damping_ratio)
            )
            for factor in FACTORS
        },
        by_speed={
            f"{factor * speed:.4g}": predicted_contrast(_at_speed(change, factor * speed), rig=rig)
            for factor in FACTORS
        },
    )


def _at_speed(change: Change, speed_m_s: float) -> Change:
    before, after = (
        replace(moment, sliding_speed_m_s=speed_m_s) for moment in (change.before, change.after)
    )
    return replace(change, before=before, after=after)


def at_places(ratings: Ratings, changes: Mapping[str, Change]) -> Ratings:
    """Return the ratings of the conditions whose contrast is that at a place."""
    chosen = [
        place
        for place, name in enumerate(ratings.conditions)
        if name in changes and changes[name].kind == AT_A_PLACE
    ]
    return ratings.where(np.isin(ratings.condition, chosen))
