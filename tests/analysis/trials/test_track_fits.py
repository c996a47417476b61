"""Thresholds of people in tracks: known ones come back, and what must be looked at is flagged."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.estimates import NotEstimable
from analysis.loading.study_data import load_study_data
from analysis.statistics.detection import Detection
from analysis.thresholds.psychometric import fitted
from analysis.trials.track_fits import Thresholds, thresholds
from device.friction.calibration import NOMINAL
from protocol.study_file.loading import parsed_study
from tests.analysis.tracks import TRACKS, session

QUEST, STAIRCASE = "smallest amplitude", "by a staircase"


def found(text: str, *known: float) -> Thresholds:
    chains = [
        session(text, f"P{slot:02d}", slot, threshold=each) for slot, each in enumerate(known)
    ]
    study = parsed_study(text)
    data = load_study_data(chains, rehearsals=False)
    made = thresholds(study, data, NOMINAL)
    assert made is not None
    return made


def test_known_thresholds_come_back_for_a_cohort() -> None:
    made = found(TRACKS, *[40.0] * 8)
    assert [each.track for each in made.cohort] == [QUEST, STAIRCASE]
    for each in made.cohort:
        assert each.people == 8
        assert not isinstance(each.threshold, NotEstimable)
        assert each.threshold == pytest.approx(40.0, rel=0.25)
        assert each.threshold_at == 0.75
    person = made.people[0]
    assert person.db == pytest.approx(20 * np.log10(person.threshold))
    assert person.contrast is not None
    assert person.weber == pytest.approx(1 - np.exp(-person.contrast))
    low, high = person.threshold_interval
    assert low < person.threshold < high


def test_the_fit_is_that_of_touchbeam_fit_with_easy_trials_and_without_catch_trials() -> None:
    person = found(TRACKS, 40.0).people[0]
    level, number, right = zip(*person.points, strict=True)
    assert sum(number) == 40 + 4  # easy ones; no answer to a catch trial is right
    alone = fitted(level, number, right, threshold_at=0.75, span=(4.0, 160.0))
    assert replace(person.fit, band=(), likelihood=()) == alone
    assert person.course.values[0] in parsed_study(TRACKS).track_of(QUEST).values
    assert person.reversal_mean is None


def test_reversals_have_a_mean_of_their_own() -> None:
    person = found(TRACKS, 40.0).people[1]
    assert person.reversals == 12
    assert person.reversal_mean == pytest.approx(40.0, rel=0.5)


def test_who_feels_nothing_is_flagged() -> None:
    flags = [flag for each in found(TRACKS, 4000.0).people for flag in each.flags]
    assert "stuck at the easiest level" in flags


def test_a_threshold_beyond_the_levels_is_said_and_has_no_weber_fraction() -> None:
    made = found(TRACKS, 40.0, 4000.0)
    near, far = (each for each in made.people if each.track == QUEST)
    assert (near.reason, near.limit) == (None, None)
    assert far.reason == "above 160 V"
    assert far.limit == pytest.approx(160.0)
    assert np.isnan([far.threshold, *far.threshold_interval]).all()
    assert (far.db, far.contrast, far.weber, far.measured) == (None, None, None, None)
    assert np.isfinite([far.fit.slope, far.fit.lapse]).all()
    cohort = next(each for each in made.cohort if each.track == QUEST)
    said = "1 of 2 thresholds lies above 160 V"
    for value in (cohort.threshold, cohort.threshold_interval, cohort.weber, cohort.weber_interval):
        assert value == NotEstimable(said)
    # The model of all answers takes in what is known of both.
    assert not isinstance(cohort.mixed, NotEstimable)
    assert near.threshold < cohort.mixed.threshold


def test_levels_below_a_standard_have_thresholds_below_it() -> None:
    (track, *_) = parsed_study(TRACKS).track
    standard = track.standard
    assert standard is not None
    changed = {"standard": standard.model_copy(update={"voltage_v": 200.0})}
    below = track.model_copy(update=changed)
    assert below.reference == 200
    assert [below.on_axis(each) for each in below.distances] == pytest.approx(below.values)


def test_who_names_one_touch_too_often_is_flagged() -> None:
    data = load_study_data([session(TRACKS, "P01")], rehearsals=False)
    vars(data)["trials"] = data.trials.assign(change="second")
    made = thresholds(parsed_study(TRACKS), data, NOMINAL)
    assert made is not None
    assert "the second touch was named in 48 of 48" in made.people[0].flags


def test_a_study_without_answers_to_tracks_has_no_thresholds() -> None:
    study = parsed_study(TRACKS)
    data = load_study_data([session(TRACKS, "P01")], rehearsals=False)
    none = data.trials[data.trials["track"].isna()]
    vars(data)["trials"] = none
    assert thresholds(study, data, NOMINAL) is None


YES_NO = TRACKS.replace('task = "two intervals"', 'task = "yes or no"').replace(
    "threshold_at = 0.75", "threshold_at = 0.5"
)


def test_catch_trials_of_yes_or_no_are_answers_without_a_stimulus() -> None:
    person = found(YES_NO, 40.0).people[0]
    assert person.points[0][:2] == (0.0, 4)
    told = person.detection
    assert isinstance(told, Detection)
    assert told.false_alarms.trials == 4
    assert told.hits.trials == sum(answers for level, answers, _ in person.points if level)
    assert told.d_prime > 0
    assert person.fit.threshold_at == 0.5
