"""The contrast that each friction law predicts for each trial, under what was really done."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.estimates import FloatArray
from analysis.loading.sessions import Drive, TouchDone, TrialRow
from device.beam.beam import Beam
from device.friction.changes import CONDITIONS, Change, Moment, trial_change
from device.friction.contrasts import predicted_contrast
from device.friction.laws import LAWS
from protocol.study.study import Study

FORCE_STEP = 0.05
PLACE_STEP_M = 0.0005
"""Measured force counts in steps of a twentieth of the planned one, and a place in half
millimetres from it: no finger is steadier, and a sensor's noise makes no new touch."""
_BEAM_M = Beam().length_m
RUNG = "mode"
"""The rung (see `device.friction.rungs`) that predicts changes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrialContrasts:
    """Predicted contrasts of trials by law, shape (trials,) each; NaN where none is predicted.

    Positive when the change is the one that the trial itself expects; a trial in the opposite
    order expects the opposite change. `measured` says of which trials force or place are known.
    """

    by_law: dict[str, FloatArray]
    measured: np.typing.NDArray[np.bool_]


def trial_contrasts(study: Study, rows: Sequence[TrialRow]) -> TrialContrasts:
    """Return the contrasts of all trials under every law.

    The study that was in force (`study` where the journal does not hold it) gives the finger's
    force, place, path and speed; where the rig measured force, place, amplitude and frequency
    (relative to its own resonance), those are taken instead, force and place in steps. For
    published scores nothing of this is known: the condition's standard scenes are taken.
    """
    changes = [_change(row.study or study, row) for row in rows]
    by_law = {}
    for law in LAWS:
        # Trials whose touches were alike share a prediction.
        known: dict[Change, float] = {}
        by_law[law] = np.array([_contrast(change, law, known) for change in changes])
    return TrialContrasts(
        by_law=by_law,
        measured=np.array([any(map(_is_measured, row.touches)) for row in rows], dtype=np.bool_),
    )


def _contrast(change: Change | None, law: str, known: dict[Change, float]) -> float:
    if change is None:
        return float("nan")
    if change not in known:
        known[change] = predicted_contrast(change, law, RUNG)
    return known[change]


def _change(study: Study, row: TrialRow) -> Change | None:
    """The change that the trial's touches made; None where nothing was asked, or not of a beam."""
    if row.kind == "published" and (standard := CONDITIONS.get(row.condition or "")):
        return standard
    planned = [done.planned for done in row.touches]
    beams = {touch.beam for touch in planned if touch.beam is not None}
    if row.question is None or not planned or not beams <= study.beams.keys():
        return None
    change = trial_change(study, row.question, row.expected, planned)
    first, last = row.touches[0], row.touches[-1]
    started_at_rest = len(planned) == 1 and first.planned.programme == "hold"
    before = _felt(change.before, first, None if started_at_rest else first.start)
    after = _felt(change.after, last, last.end)
    if change.effect == "friction" and last.place_m is not None:
        place_m = stepped(last.place_m, change.places_m[0], PLACE_STEP_M)
        if 0 <= place_m <= _BEAM_M:
            change = replace(change, places_m=(place_m,))
    return replace(change, before=before, after=after)


def _felt(moment: Moment, done: TouchDone, drive: Drive | None) -> Moment:
    """The moment with what was measured of it in place of what was planned."""
    if done.force_n is not None:
        step_n = FORCE_STEP * moment.force_n
        moment = replace(moment, force_n=stepped(done.force_n, moment.force_n, step_n))
    if drive is not None:
        moment = replace(moment, voltage_v=drive.voltage_v, frequency=drive.frequency)
    return moment


def stepped(measured: float, planned: float, step: float) -> float:
    """Return the value nearest to `measured` that lies whole steps from `planned`.

    >>> stepped(0.0421, 0.0414, 0.0005)
    0.0419
    """
    # Twelve digits, so that the sum is that decimal number and no neighbour of it.
    return float(f"{planned + round((measured - planned) / step) * step:.12g}")


def _is_measured(done: TouchDone) -> bool:
    return done.force_n is not None or done.place_m is not None
