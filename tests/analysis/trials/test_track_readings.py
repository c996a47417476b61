"""Thresholds on the axis of measured friction, and by other choices of analysis."""

from typing import Any

import numpy as np
import pytest

from analysis.loading.study_data import load_study_data
from analysis.trials.track_fits import thresholds
from analysis.trials.track_readings import felt_of
from device.friction.calibration import NOMINAL
from device.friction.changes import friction_difference
from protocol.study_file.loading import parsed_study
from tests.analysis.tracks import TRACKS, session

SKINS = (0.6, 1.0, 1.5, 0.8)


def test_the_factor_of_a_skin_comes_back_with_an_error_that_covers_it() -> None:
    rng = np.random.default_rng(11)
    inside = 0
    for _ in range(400):
        predicted = rng.choice(np.geomspace(0.02, 0.3, 12), 60)
        felt = felt_of(predicted, 1.4 * predicted + 0.02 * rng.standard_normal(60))
        assert felt is not None
        inside += abs(felt.ratio - 1.4) < 1.96 * felt.error
    assert 0.925 < inside / 400 < 0.985


def test_friction_that_does_not_follow_the_prediction_gives_no_measured_axis() -> None:
    rng = np.random.default_rng(12)
    predicted = rng.uniform(0.02, 0.3, 60)
    assert felt_of(predicted, 0.02 * rng.standard_normal(60)) is None
    assert felt_of(predicted, -predicted) is None
    assert felt_of(predicted[:4], predicted[:4]) is None


def test_an_interval_on_the_measured_axis_holds_both_errors() -> None:
    predicted = np.geomspace(0.02, 0.3, 60)
    felt = felt_of(predicted, 2 * predicted + 0.05 * np.tile([1.0, -1.0], 30))
    assert felt is not None
    value, (low, high) = felt.contrast(0.1, (0.05, 0.2))
    assert value == pytest.approx(0.2, rel=0.02)
    assert low < felt.ratio * 0.05
    assert high > felt.ratio * 0.2
    certain = felt.contrast(0.1, (0.1, 0.1))[1]
    assert certain[1] / value == pytest.approx(np.exp(1.96 * felt.error / felt.ratio))


def test_thresholds_of_people_with_different_skins_agree_where_friction_was_measured() -> None:
    """People who feel the same contrast have nominal thresholds that their skins set apart."""
    study = parsed_study(TRACKS)
    chains = [
        session(TRACKS, f"P{slot:02d}", slot, threshold=40.0 / skin)
        for slot, skin in enumerate(SKINS)
    ]
    data = load_study_data(chains, rehearsals=False)
    skin_of = dict(zip(data.table.subjects, SKINS, strict=True))
    of_trial = data.trials["participant"]
    friction: dict[Any, float] = {}
    places: Any = data.touches.groupby("attempt_id").cumcount()
    for touch, attempt in data.touches["attempt_id"].items():
        trial = data.trials.loc[attempt]
        if (name := trial["track"]) is None or trial["level"] != trial["level"]:
            continue
        track = study.track_of(name)
        compared = places[touch] + 1 == trial["interval"]
        change = 0.0
        if compared and track.standard is not None:
            change = friction_difference(
                study, track.standard, track.at(int(trial["level"])), NOMINAL
            )
        friction[touch] = 0.5 * np.exp(-skin_of[of_trial[attempt]] * change)
    made = thresholds(study, data, NOMINAL, friction)
    assert made is not None
    for each in made.people:
        assert each.felt is not None
        assert each.felt.ratio == pytest.approx(skin_of[each.participant], rel=1e-6)
        assert each.contrast is not None
        assert each.measured == pytest.approx(each.contrast * skin_of[each.participant])
    for cohort in made.cohort:
        assert cohort.weber_of == "measured"
    found = {
        (it.track, it.axis, it.choice): it
        for it in made.readings
        if it.choice.estimate == "posterior"
    }
    for (name, axis, choice), reading in found.items():
        assert reading.people == len(SKINS)
        if axis == "measured contrast":
            nominal = found[name, "predicted contrast", choice]
            assert reading.sd_db is not None
            assert nominal.sd_db is not None
            assert reading.sd_db < nominal.sd_db, (name, choice)
    choices = {(it.choice.shape, it.choice.lapses) for it in made.readings}
    assert {(s, k) for s in ("weibull", "normal") for k in ("free", "known")} < choices
    assert ("", "") in choices, "the mean of reversals"
