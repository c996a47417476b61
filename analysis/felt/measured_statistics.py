"""What was measured of each trial and touch, and measured contrasts by condition."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimates import BoolArray, FloatArray, NotEstimable
from analysis.friction import measured_contrast as contrast
from analysis.friction import recorded
from analysis.loading.sessions import Sessions, is_scored
from analysis.loading.study_data import StudyData
from analysis.trials.contrasts import trial_changes
from device.friction.changes import Change
from protocol.study.study import Study

# What each trial compared, as it was measured: contrasts with errors, and touches in numbers.

NOT_RECORDED = "it was not recorded"

Forces = Mapping[int, recorded.TouchForces | NotEstimable]


@dataclass(frozen=True, kw_only=True, eq=False)
class SessionFriction:
    """The recorded touches of a session, its jitter and its resting friction."""

    touches: Mapping[int, recorded.TouchForces]
    jitter: recorded.Jitter | NotEstimable
    rest: contrast.Rest | NotEstimable


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredTrials:
    """Measured contrasts of trials, shape (trials,) each, NaN where there is none.

    `value` and `error` are of the trial alone, `best` and `best_error` borrow from others (see
    `borrowed_contrasts`; of scored trials alone). `why` has the reason why a trial has no contrast,
    None where it has one.
    """

    value: FloatArray
    error: FloatArray
    best: FloatArray
    best_error: FloatArray
    why: tuple[str | None, ...]

    @property
    def known(self) -> BoolArray:
        """Which trials have a measured contrast."""
        return np.isfinite(self.value)


def session_friction(
    trials: pd.DataFrame, touches: pd.DataFrame, forces: Forces
) -> dict[int, SessionFriction]:
    """Return what was recorded in each session, the drift of its zeros taken off.

    A session without a touch at one place takes the jitter of all others.
    """
    session_of = trials["session_id"]
    planned, attempts = touches["planned"], touches["attempt_id"]
    by_session: dict[int, dict[int, recorded.TouchForces]] = {}
    for touch, found in forces.items():
        if isinstance(found, recorded.TouchForces):
            by_session.setdefault(int(session_of[attempts[touch]]), {})[touch] = found
    for session, own in by_session.items():
        drift = recorded.zero_drift_n_per_s(list(own.values()))
        by_session[session] = {touch: found.with_drift(drift) for touch, found in own.items()}

    def held(own: Mapping[int, recorded.TouchForces]) -> Iterator[recorded.TouchForces]:
        for touch, found in own.items():
            if planned[touch].place == "smooth" and planned[touch].programme == "hold":
                yield found

    everyone = recorded.jitter_of(found for own in by_session.values() for found in held(own))
    known = {}
    for session, own in by_session.items():
        jitter = recorded.jitter_of(held(own))
        jitter = everyone if isinstance(jitter, NotEstimable) else jitter
        unforced = [found for touch, found in own.items() if planned[touch].peak_voltage_v == 0]
        rest = jitter if isinstance(jitter, NotEstimable) else contrast.rest_of(unforced, jitter)
        known[session] = SessionFriction(touches=own, jitter=jitter, rest=rest)
    return known


def with_measures(study: Study, found: Sessions) -> Sessions:
    """Return the sessions with what was measured in columns of their own.

    Touches have those of `TouchMeasures`, the last attempt at each trial has `measured_contrast`
    and `measured_contrast_error`; they are missing where nothing was recorded.
    """
    touches = found.touches.assign(**dict.fromkeys(_MEASURES, np.nan))
    attempts = found.attempts.assign(measured_contrast=np.nan, measured_contrast_error=np.nan)
    if found.forces:
        trials = found.trials.join(found.sessions["subject"].rename("participant"), "session_id")
        own = found.touches[found.touches["attempt_id"].isin(trials.index)]
        own = own.assign(place_m=found.places_m)
        forces = {touch: found.forces[touch] for touch in own.index if touch in found.forces}
        contrasts = measured_trials(study, trials, own, forces)
        attempts.loc[trials.index, "measured_contrast"] = contrasts.value
        attempts.loc[trials.index, "measured_contrast_error"] = contrasts.error
        measures = measures_of_touches(session_friction(trials, own, forces))
        for name in _MEASURES:
            touches[name] = touches.index.map(
                {touch: getattr(each, name) for touch, each in measures.items()}
            ).astype(float)
    return replace(found, touches=touches, attempts=attempts)


_MEASURES = [entry.name for entry in fields(recorded.TouchMeasures)]


def measures_of_touches(
    sessions: Mapping[int, SessionFriction],
) -> dict[int, recorded.TouchMeasures]:
    """Return the measures of all recorded touches whose jitter is known, by touch."""
    return {
        touch: recorded.touch_measures(found, session.jitter)
        for session in sessions.values()
        if isinstance(session.jitter, recorded.Jitter)
        for touch, found in session.touches.items()
    }


def friction_of_touches(data: StudyData) -> dict[int, float]:
    """Return the measured friction coefficient of each recorded touch, by its index."""
    sessions = session_friction(data.trials, data.touches, data.forces) if data.forces else {}
    return {touch: each.friction for touch, each in measures_of_touches(sessions).items()}


def measured_trials(
    study: Study, trials: pd.DataFrame, touches: pd.DataFrame, forces: Forces
) -> MeasuredTrials:
    """Return the measured contrasts of `trials`; the tables and `forces` are as in `StudyData`.

    Where nothing was driven, nothing changed: the best contrast of such a catch trial is 0. `study`
    is the present one, for trials whose own the journal does not hold.
    """
    sessions = session_friction(trials, touches, forces)
    changes = trial_changes(study, trials, touches, as_felt=False)
    made: dict[int, list[int]] = {attempt: [] for attempt in trials.index}
    for touch, attempt in zip(touches.index, touches["attempt_id"], strict=True):
        made[attempt].append(touch)
    found = [
        _of_trial(change, touches.loc[own, "planned"], forces, sessions.get(session))
        for change, own, session in zip(changes, made.values(), trials["session_id"], strict=True)
    ]
    numbers = [
        [np.nan, np.nan] if isinstance(each, NotEstimable) else [each.value, each.error]
        for each in found
    ]
    value, error = np.array(numbers).reshape(-1, 2).T
    best, best_error = value.copy(), error.copy()
    known = np.isfinite(value)
    scored = known & trials["trial_kind"].eq("trial").to_numpy()
    if scored.any():
        chosen = trials[scored]
        best[scored], best_error[scored] = contrast.borrowed_contrasts(
            pd.factorize(chosen["participant"])[0],
            pd.factorize(chosen["condition"])[0],
            chosen["level"].to_numpy(),
            value[scored],
            error[scored],
        )
    undriven = known & trials["trial_kind"].eq("catch").to_numpy()
    best[undriven], best_error[undriven] = 0.0, 0.0
    return MeasuredTrials(
        value=value,
        error=error,
        best=best,
        best_error=best_error,
        why=tuple(each.reason if isinstance(each, NotEstimable) else None for each in found),
    )


def _of_trial(
    change: Change | None,
    planned: "pd.Series[Any]",
    forces: Forces,
    session: SessionFriction | None,
) -> contrast.MeasuredContrast | NotEstimable:
    """Return the contrast of one trial from its first and last touch."""
    if change is None or planned.empty:
        return NotEstimable("what it compared is not known")
    first, last = planned.index[0], planned.index[-1]
    for touch in (first, last):
        if isinstance(found := forces.get(touch, NotEstimable(NOT_RECORDED)), NotEstimable):
            return found
    assert session is not None
    if isinstance(session.jitter, NotEstimable):
        return session.jitter
    # What is scored without a question is the last touch alone, the more the higher its friction.
    is_level = change.effect == "level"
    if is_level and planned[last].programme != "hold" and planned[last].voltage_v:
        return NotEstimable("the drive changes within the touch, and not from 0 V")
    compared = contrast.TouchPair(
        effect="friction" if is_level else change.effect,
        contrary=is_level or change.contrary,
        before=None if is_level or first == last else session.touches[first],
        after=session.touches[last],
        along_path=len(change.places_m) > 1 and not is_level,
        contact_m=change.after.contact_m,
        within=planned[last].programme != "hold",
    )
    return contrast.measured_contrast(compared, session.jitter, session.rest)


@dataclass(frozen=True, kw_only=True)
class ConditionContrast:
    """The measured contrasts of a condition's scored trials: their mean and its standard error.

    `trial_error` is the root mean square of the standard errors of single trials, and `best_error`
    of those that borrow from others; `spread` the SD of the best contrasts between trials.
    """

    condition: str
    trials: int
    mean: float
    mean_error: float
    predicted: float
    spread: float
    trial_error: float
    best_error: float


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredStatistics:
    """What the recordings of a study say.

    The model of the answers takes each trial's best contrast in place of the predicted one
    (regression calibration). The variance of its error, times the square of the gain, is part of
    the variance of a rating, which it estimates.

    `predicted`, shape (trials,), has the contrasts that the model of friction predicts.
    """

    data: StudyData
    study: Study
    predicted: FloatArray

    @cached_property
    def trials(self) -> MeasuredTrials:
        data = self.data
        return measured_trials(self.study, data.trials, data.touches, data.forces)

    @cached_property
    def conditions(self) -> tuple[ConditionContrast, ...]:
        found, predicted = self.trials, self.predicted
        scored = is_scored(self.data.trials).to_numpy() & found.known
        names = self.data.trials["condition"].to_numpy()
        entries = []
        for name in self.data.table.conditions:
            own = scored & (names == name)
            if own.any():
                errors, best = found.error[own], found.best[own]
                entries.append(
                    ConditionContrast(
                        condition=name,
                        trials=int(own.sum()),
                        mean=float(found.value[own].mean()),
                        mean_error=float(np.sqrt((errors**2).sum()) / own.sum()),
                        predicted=float(predicted[own].mean()),
                        spread=float(best.std()),
                        trial_error=float(np.sqrt((errors**2).mean())),
                        best_error=float(np.sqrt((found.best_error[own] ** 2).mean())),
                    )
                )
        return tuple(entries)

    @cached_property
    def left_out(self) -> Mapping[str, int]:
        """How many scored trials have no measured contrast, by reason."""
        whys = zip(self.trials.why, is_scored(self.data.trials), strict=True)
        return dict(Counter(why for why, counts in whys if counts and why is not None))


def measured_statistics(
    study: Study, data: StudyData, predicted: FloatArray
) -> MeasuredStatistics | None:
    """Return the statistics of the trials with recorded touches; None if nothing was recorded."""
    if not data.forces:
        return None
    return MeasuredStatistics(study=study, data=data, predicted=predicted)
