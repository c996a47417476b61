"""Measured contrasts of simulated sessions: near the truth, zero at rest, and left out with why."""

from functools import cache

import numpy as np
import pytest

from analysis.felt.measured_statistics import (
    NOT_RECORDED,
    MeasuredStatistics,
    measured_statistics,
    measured_trials,
    measures_of_touches,
    session_friction,
)
from analysis.loading.study_data import StudyData, load_study_data
from analysis.trials.contrasts import trial_contrasts
from device.friction.changes import LAW
from protocol.plan.plan import plan
from protocol.study.touch import Touch
from tests.analysis.friction.recorded_sessions import (
    MeasuredStudy,
    measured_study,
    recorded_cohort,
)
from tests.analysis.rated import RATED
from tests.analysis.reports import EXTENDED, PAPER, cohort

SKIPPED = next(trial.index for trial in plan(PAPER, 0).trials if trial.kind == "trial")


@cache
def extended() -> MeasuredStudy:
    return measured_study(EXTENDED, 3, seed=1)


@cache
def paper() -> StudyData:
    return load_study_data(recorded_cohort(PAPER, 3, skipped=SKIPPED)[0], rehearsals=False)


@cache
def paper_statistics() -> MeasuredStatistics:
    data = paper()
    predicted = trial_contrasts(PAPER, data.trials, data.touches).by_law[LAW]
    found = measured_statistics(PAPER, data, predicted)
    assert found is not None
    return found


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_measured_contrasts_are_near_the_truth_and_say_how_near() -> None:
    study = extended()
    found, of = study.found, study.scored
    assert of.sum() == 60
    assert rms((found.best - study.true)[of]) < 0.012
    assert rms((found.value - study.true)[of]) < 0.016
    scores, names = (found.value - study.true) / found.error, study.data.trials["condition"]
    for condition in EXTENDED.conditions:
        assert 0.6 < rms(scores[of & names.eq(condition).to_numpy()]) < 1.4, condition
    # What the model predicts is further off, because skin and rig are not the paper's.
    assert rms((study.predicted - study.true)[of]) > 0.03


def test_where_nothing_was_driven_nothing_changed() -> None:
    study = extended()
    catch = study.data.trials["trial_kind"].eq("catch").to_numpy()
    assert catch.sum() == 12
    assert (study.found.best[catch] == 0).all()
    assert 0 < rms(study.found.value[catch]) < 0.05


def test_what_is_scored_without_a_question_is_measured_against_touches_at_rest() -> None:
    study = measured_study(RATED, 3, seed=2)
    found, of, names = study.found, study.scored, study.data.trials["condition"].to_numpy()
    assert rms((found.best - study.true)[of]) < 0.02
    # At the largest amplitude friction is lowest, as the model predicts of it.
    measured, predicted = (
        [float(values[of & (names == name)].mean()) for name in RATED.conditions]
        for values in (found.value, study.predicted)
    )
    assert np.argmin(measured) == np.argmin(predicted) == 3
    assert measured[-1] < min(0.0, measured[0]) - 0.03


def test_a_ramp_that_does_not_begin_at_rest_has_no_level() -> None:
    ramp = {"place": "smooth", "ramp_to_v": 100.0, "duration_s": 2.0}
    for start_v, is_known in ((0.0, True), (50.0, False)):
        touch = Touch.model_validate({**ramp, "voltage_v": start_v})
        condition = RATED.condition[0].model_copy(update={"touches": (touch,)})
        study = RATED.model_copy(update={"condition": (condition, *RATED.condition[1:])})
        data = load_study_data(recorded_cohort(study, 1)[0], rehearsals=False)
        own = data.trials["condition"].eq(condition.name) & data.trials["trial_kind"].eq("trial")
        found = measured_trials(study, data.trials, data.touches, data.forces)
        assert (np.isfinite(found.value[own.to_numpy()]) == is_known).all()


def test_trials_without_a_recording_are_left_out_and_counted() -> None:
    data, found = paper(), paper_statistics()
    scored = data.trials["trial_kind"].eq("trial").to_numpy()
    known = found.trials.known[scored]
    assert (len(known), known.sum()) == (15, 12)
    assert found.left_out == {NOT_RECORDED: 3}
    assert sum(entry.trials for entry in found.conditions) == 12
    silent = found.trials.why.index(NOT_RECORDED)
    assert np.isnan([found.trials.value[silent], found.trials.best[silent]]).all()


def test_conditions_have_the_means_of_their_trials() -> None:
    found = paper_statistics()
    for entry in found.conditions:
        of = paper().trials["condition"].eq(entry.condition).to_numpy() & found.trials.known
        of &= paper().trials["trial_kind"].eq("trial").to_numpy()
        assert entry.mean == pytest.approx(found.trials.value[of].mean())
        error = np.sqrt((found.trials.error[of] ** 2).sum()) / of.sum()
        assert entry.mean_error == pytest.approx(error)
        assert entry.predicted == pytest.approx(found.predicted[of].mean())
        assert entry.trials == of.sum()


def test_a_study_without_recordings_has_no_measured_statistics() -> None:
    data = load_study_data(cohort(PAPER, 2), rehearsals=False)
    assert data.forces == {}
    assert measured_statistics(PAPER, data, np.zeros(len(data.trials))) is None
    alone = measured_trials(PAPER, data.trials, data.touches, data.forces)
    assert not alone.known.any()


def test_touches_have_measures() -> None:
    data = paper()
    found = measures_of_touches(session_friction(data.trials, data.touches, data.forces))
    assert found.keys() == data.forces.keys()
    planned = zip(found, data.touches["planned"][list(found)], strict=True)
    touch = next(number for number, each in planned if each.place == "path")
    assert found[touch].speed_m_s == pytest.approx(0.04, rel=0.3)
    assert found[touch].stick_slip == pytest.approx(0.05, rel=0.6)
    assert 0.1 < found[touch].friction < 1
    assert found[touch].friction_error < 0.03 * found[touch].friction
