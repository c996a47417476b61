"""The contrast that each friction law predicts for each trial, under what was really done."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial
from itertools import chain
from math import isfinite
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimates import BoolArray, FloatArray, IntArray, Interval
from analysis.loading.sessions import is_scored
from analysis.loading.study_data import StudyData
from analysis.sensitivity.lines import Ratings
from device.friction import laws
from device.friction.calibration import NOMINAL, Calibration
from device.friction.changes import (
    CONDITIONS,
    LAW,
    Change,
    Kind,
    Moment,
    predicted_contrast,
    trial_change,
)
from device.friction.surfaces import MeasuredSurface, length_of
from protocol.study.study import Study
from protocol.study.study_question import QUESTIONS, Question
from protocol.study.touch import Touch
from protocol.study_file.loading import StudyError, parsed_study

FORCE_STEP = 0.05
PLACE_STEP_M = 0.0005
FREQUENCY_DIGITS = 4
"""Measured force counts in steps of a twentieth of the planned one, a place in half millimetres
from it, a frequency in ten-thousandths of the resonance: no finger is steadier, a resonance is a
hundred times as wide, and a sensor's noise makes no new touch and no new solution of the beam."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TrialContrasts:
    """Predicted contrasts of trials by law, shape (trials,) each; NaN where none is predicted.

    Positive when the change is the one that the trial itself expects; a trial in the opposite
    order expects the opposite change. Without a question nothing is expected: the contrast is that
    of the last touch with itself at 0 V, positive where friction rises. `measured` says of which
    trials force or place are known.
    """

    by_law: dict[str, FloatArray]
    measured: BoolArray


def trial_contrasts(
    study: Study,
    trials: pd.DataFrame,
    touches: pd.DataFrame,
    rig: Calibration = NOMINAL,
) -> TrialContrasts:
    """Return the contrasts of all trials under every law.

    The study that was in force (`study` where the journal does not hold it) gives the finger's
    force, place, path and speed; where the rig measured force, place, amplitude and frequency
    (relative to its own resonance), those are taken instead, force and place in steps. For
    published scores nothing of this is known: the condition's standard scenes are taken, or, in a
    study of imported scores, what their author predicts. Trials of registered sessions were felt
    on the rig as it was calibrated then.

    `trials` are those of `StudyData`, or some of them, and `touches` theirs; `rig` is taken where
    no calibration was in force.
    """
    changes = trial_changes(study, trials, touches)
    if isinstance(rig.surface, MeasuredSurface):
        # What was felt under another table of friction is not what this one says.
        there = map(partial(_has_table, study, rig.surface.table.digest), trials["study_text"])
        changes = [change if same else None for change, same in zip(changes, there, strict=True)]
    rigs = [own.on(rig.surface) if isinstance(own, Calibration) else rig for own in trials["rig"]]
    # Trials whose touches were alike share a prediction.
    felt = list(zip(changes, rigs, strict=True))
    number_of: dict[tuple[Change | None, Calibration], int] = {}
    numbers = [number_of.setdefault(each, len(number_of)) for each in felt]
    measured = touches["attempt_id"][touches["force_n"].notna() | touches["place_m"].notna()]
    by_law = {law: _predicted(number_of, law)[numbers] for law in laws.LAWS}
    if study.imported:
        stated = _stated(study, trials)
        by_law = dict.fromkeys(laws.LAWS, stated)
    return TrialContrasts(
        by_law=by_law,
        measured=trials.index.isin(measured),
    )


def _stated(study: Study, trials: pd.DataFrame) -> FloatArray:
    """Return the contrasts that the author of imported scores predicts, NaN where none is."""
    of_condition = {each.name: each.contrast for each in study.condition}
    by_condition = trials["condition"].map(of_condition).astype("float64")
    return trials["contrast"].fillna(by_condition).to_numpy(np.float64)


def _has_table(study: Study, digest: str, text: object) -> bool:
    """Return whether the study in force had the table of that digest, as far as it is known."""
    return not isinstance(text, str) or _tables(text).get(study.surface.table or "") == digest


@lru_cache(maxsize=64)
def _tables(text: str) -> Mapping[str, str]:
    try:
        return parsed_study(text).tables
    except StudyError:
        return {}


def _predicted(felt: Iterable[tuple[Change | None, Calibration]], law: str) -> FloatArray:
    """Return the contrasts of changes on the rigs on which they were felt, shape (changes,)."""
    contrasts = [
        np.nan if change is None else predicted_contrast(change, law, rig=rig)
        for change, rig in felt
    ]
    return np.array(contrasts, np.float64)


_ASKED = ["trial_kind", "condition", "question", "expected", "resonance_hz", "study_text"]
_FELT = [
    *("attempt_id", "planned", "force_n", "place_m"),
    *("start_voltage_v", "start_frequency_hz", "end_voltage_v", "end_frequency_hz"),
]
"""The columns of trials and of touches that the felt change depends on."""


def trial_changes(
    study: Study, trials: pd.DataFrame, touches: pd.DataFrame, *, as_felt: bool = True
) -> list[Change | None]:
    """Return the change that each trial made, or was planned to make; None where none is known."""

    @cache
    def in_force(text: str | None) -> Study:
        try:
            return study if text is None else parsed_study(text)
        # A file from another version must not stop a report; the present study is the best guess.
        except StudyError:
            return study

    # Most trials share their plan with others.
    @cache
    def planned_change(text: str | None, kind: str, *planned: Any) -> Change | None:
        return planned_change_of(in_force(text), kind, *planned)

    made: dict[Any, list[Any]] = {attempt: [] for attempt in trials.index}
    for touch in touches[_FELT].itertuples():
        made[touch.attempt_id].append(touch)
    asked = trials[_ASKED].astype(object).where(trials[_ASKED].notna(), None)
    length_m = length_of(study.surface)
    return [
        _change(trial, own, planned_change, length_m, as_felt=as_felt, is_imported=study.imported)
        for trial, own in zip(asked.itertuples(), made.values(), strict=True)
    ]


_OF_CONDITIONS = frozenset({"practice", "trial", "catch"})
"""The kinds of trial that are scored although their study asks nothing about a change."""


def planned_change_of(
    study: Study,
    kind: str,
    question: Question | None,
    expected: str | None,
    planned: tuple[Touch, ...],
) -> Change | None:
    """Return the change that a kind of trial was planned to make.

    None with a question or a beam that is not known, and of a trial in which nothing is scored.
    """
    beams = {touch.beam for touch in planned if touch.beam is not None}
    is_rated = question is None and study.absolute and kind in _OF_CONDITIONS
    if (is_rated or question in QUESTIONS) and planned and beams <= study.beams.keys():
        return trial_change(study, question, expected, planned)
    return None


def _change(
    trial: Any,
    touches: Sequence[Any],
    planned_change: Callable[..., Change | None],
    length_m: float,
    *,
    as_felt: bool,
    is_imported: bool,
) -> Change | None:
    if trial.trial_kind == "published":
        return None if is_imported else CONDITIONS.get(trial.condition)
    planned = tuple(touch.planned for touch in touches)
    asked = (trial.trial_kind, trial.question, trial.expected)
    change = planned_change(trial.study_text, *asked, planned)
    if change is None or not as_felt:
        return change
    return felt_change(change, touches, trial.resonance_hz, length_m)


def felt_change(
    change: Change, touches: Sequence[Any], resonance_hz: float | None, length_m: float
) -> Change:
    """Return the planned change with measured values in place of planned ones.

    `touches` have the columns of touches that the change depends on, as attributes; `length_m` is
    the surface's.
    """
    first, last = touches[0], touches[-1]
    start = first.start_voltage_v, first.start_frequency_hz
    if change.effect == "level":
        first = last  # the same touch at 0 V
    if change.effect == "level" or (len(touches) == 1 and first.planned.programme == "hold"):
        start = math.nan, math.nan  # it started at rest
    before = _measured(change.before, first.force_n, *start, resonance_hz)
    end = last.end_voltage_v, last.end_frequency_hz
    after = _measured(change.after, last.force_n, *end, resonance_hz)
    places_m = change.places_m
    if change.effect in {"friction", "level"} and isfinite(last.place_m):
        place_m = stepped(last.place_m, places_m[0], PLACE_STEP_M)
        # A sensor may place the finger off the surface, where nothing is predicted.
        if 0 <= place_m <= length_m:
            places_m = (place_m,)
    return _felt(change, before, after, places_m)


_Measured = tuple[tuple[str, float], ...]
"""Fields of a moment with what was measured of them."""


def _measured(
    moment: Moment,
    force_n: float,
    voltage_v: float,
    frequency_hz: float,
    resonance_hz: float | None,
) -> _Measured:
    """Return the measured force and the drive that was read back, if known, in place of planned."""
    known: _Measured = ()
    if isfinite(force_n):
        known = (("force_n", stepped(force_n, moment.force_n, FORCE_STEP * moment.force_n)),)
    if isfinite(voltage_v) and resonance_hz is not None:
        # Rounded, so that trials with the same drive share a prediction.
        frequency = round(frequency_hz / resonance_hz, FREQUENCY_DIGITS)
        known += ("voltage_v", round(voltage_v, 3)), ("frequency", frequency)
    return known


# Trials are felt alike again and again, because measured values count in steps.
@lru_cache(maxsize=8192)
def _felt(
    change: Change, before: _Measured, after: _Measured, places_m: tuple[float, ...]
) -> Change:
    return replace(
        change,
        before=replace(change.before, **dict[str, Any](before)),
        after=replace(change.after, **dict[str, Any](after)),
        places_m=places_m,
    )


def stepped(measured: float, planned: float, step: float) -> float:
    """Return the value nearest to `measured` that lies whole steps from `planned`.

    >>> stepped(0.0421, 0.0414, 0.0005)
    0.0419
    """
    # Twelve digits, so that the sum is that decimal number and no neighbour of it.
    return float(f"{planned + round((measured - planned) / step) * step:.12g}")


# Trials as the arrays that the sensitivity models and checks take.


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoredTrials:
    """The trials that count, in the order of `trials`; see `Ratings` for the arrays.

    `ratings` has the contrasts of the law `consistent` and, of all laws, only trials with a
    prediction; `contrasts` has the same trials by law. `every` are all trials, predicted or not,
    with contrast 0. `place` and `previous` go with `every`; 0 and -1 where not known.
    """

    ratings: Ratings
    contrasts: dict[str, FloatArray]
    every: Ratings
    place: IntArray
    previous: IntArray


def scored_trials(data: StudyData, contrasts: TrialContrasts) -> ScoredTrials:
    """Return the trials with a score, or with one that was not given."""
    scored = is_scored(data.trials)
    trials = data.trials[scored]
    by_law = {law: values[scored] for law, values in contrasts.by_law.items()}
    # Trials that only some laws predict are left out, so that all laws are judged on the same.
    predicted = np.asarray(np.isfinite(list(by_law.values())).all(axis=0))
    every = ratings_of(data, trials, np.zeros(len(trials)))
    named = ratings_of(data, trials, np.where(predicted, by_law[LAW], 0.0)).where(predicted)
    return ScoredTrials(
        ratings=named,
        contrasts={law: values[predicted] for law, values in by_law.items()},
        every=every,
        place=trials["place"].to_numpy(np.int64, na_value=0),
        previous=_positions(trials["previous"], data.table.conditions),
    )


def ratings_of(data: StudyData, trials: pd.DataFrame, contrast: FloatArray) -> Ratings:
    """Return trials as arrays; their conditions must be among those of the table."""
    return Ratings(
        subjects=data.table.subjects,
        conditions=data.table.conditions,
        subject=_positions(trials["participant"], data.table.subjects),
        condition=_positions(trials["condition"], data.table.conditions),
        contrast=contrast,
        rating=trials["score"].to_numpy(),
    )


def _positions(names: "pd.Series[str]", known: Sequence[str]) -> IntArray:
    """Return the position of each name among `known`, -1 for any other."""
    return pd.Index(known).get_indexer(pd.Index(names))


# The range of each condition's contrast over rungs, laws, and what the paper leaves open.

BEAM_MODELS = ("mode", "own-mode", "beam")
"""The models of the beam: the paper's, one mode as built, and the whole beam."""
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
        every = chain(*(it.values() for it in (self.by_rung, self.by_damping, self.by_speed)))
        values = [value for value in every if not math.isnan(value)]
        return min(values, default=self.value), max(values, default=self.value)


def condition_changes(study: Study, data: StudyData) -> dict[str, Change]:
    """Return the change of each condition that is known, as planned and at level 1.

    For published scores it is that of the standard scenes.
    """
    if study.imported:
        return {}
    own = {
        entry.name: trial_change(study, entry.question, entry.expected, entry.touches)
        for entry in study.condition
    }
    known = CONDITIONS if data.kinds == ("published",) else {**CONDITIONS, **own}
    return {name: known[name] for name in data.table.conditions if name in known}


def contrast_range(condition: str, change: Change, rig: Calibration = NOMINAL) -> ContrastRange:
    """Return the contrast of a condition with its values under other assumptions."""
    speed, ratios = change.before.sliding_speed_m_s, [rig.damping_ratio * it for it in FACTORS]
    damped = [predicted_contrast(change, rig=replace(rig, damping_ratio=it)) for it in ratios]
    return ContrastRange(
        condition=condition,
        kind=change.kind,
        value=predicted_contrast(change, rig=rig),
        by_rung={rung: predicted_contrast(change, rung=rung, rig=rig) for rung in BEAM_MODELS},
        by_law={law: predicted_contrast(change, law, rig=rig) for law in laws.LAWS},
        by_damping={f"{it:.4g}": found for it, found in zip(ratios, damped, strict=True)},
        by_speed={
            f"{it * speed:.4g}": predicted_contrast(_faster(change, it), rig=rig) for it in FACTORS
        },
    )


def _faster(change: Change, factor: float) -> Change:
    before, after = (
        replace(moment, sliding_speed_m_s=factor * moment.sliding_speed_m_s)
        for moment in (change.before, change.after)
    )
    return replace(change, before=before, after=after)
