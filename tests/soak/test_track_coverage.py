"""Thresholds of each method over 500 tracks: bias, RMSE and coverage; and the measured axis."""

from typing import Any

import numpy as np
import pytest

from analysis.estimates import FloatArray
from analysis.trials.track_readings import felt_of
from device.friction.calibration import NOMINAL
from device.friction.changes import friction_difference
from device.tracks.expected import counted_answers
from device.tracks.posterior import correct_share, lattice, slopes
from protocol.study.track import Track
from protocol.study_file.loading import parsed_study, template

TRACKS = 500
LAPSES, ALARMS = (0.0, 0.05), (0.02, 0.2)
WEBER = 0.11
SKIN_SD, FRICTION_ERROR = 0.35, 0.03
STUDY = parsed_study(template("threshold"))
GRID = {"from": 4, "to": 160, "count": 41}
METHODS: dict[str, dict[str, Any]] = {
    "quest+": {"method": "quest+", "trials": 60},
    "quest+ normal": {"method": "quest+", "trials": 60, "shape": "normal", "slope": [0.015, 0.1]},
    "three intervals": {"method": "quest+", "trials": 60, "task": "three intervals"},
    "yes or no": {"method": "quest+", "trials": 60, "task": "yes or no", "false_alarms": ALARMS},
    "constant": {
        "method": "constant",
        "trials": 120,
        "levels": {"from": 8, "to": 160, "count": 8},
    },
    "staircase": {
        "method": "staircase",
        "trials": 80,
        "rule": "3 down 1 up",
        "step_levels": [4, 1],
    },
    "weighted": {
        "method": "staircase",
        "trials": 80,
        "rule": "1 down 1 up",
        "step_levels": [1],
        "up_step_levels": [3],
    },
    "cumulative": {
        "method": "staircase",
        "trials": 80,
        "rule": "3 down 1 up",
        "step_levels": [4, 1],
        "streak": "cumulative",
    },
    "limits": {
        "method": "limits",
        "trials": 200,
        "task": "yes or no",
        "false_alarms": ALARMS,
        "levels": {"from": 8, "to": 160, "count": 14},
    },
}

pytestmark = pytest.mark.soak


def track_by(method: str) -> Track:
    usual = {
        "name": method,
        "task": "two intervals",
        "axis": "voltage",
        "levels": GRID,
        "standard": {"place": "smooth", "voltage_v": 0},
        "comparison": {"place": "smooth"},
        "lapse": LAPSES,
    }
    return Track.model_validate(usual | METHODS[method])


def answered(track: Track, threshold: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return counts of the answers of people with these thresholds and drawn slopes and rates."""
    low, high = slopes(track)
    slope = rng.uniform(low, high, len(threshold))
    lapse, alarms = (rng.uniform(*ends, len(threshold)) for ends in (LAPSES, ALARMS))
    levels = np.array(track.distances)[:, np.newaxis]
    right = correct_share(track, levels, threshold, slope, lapse, alarms)
    return counted_answers(track, right, rng.random((track.trials, len(threshold))))


@pytest.mark.parametrize("method", METHODS)
def test_intervals_cover_the_truth(method: str) -> None:
    track, rng = track_by(method), np.random.default_rng(30)
    ends = np.log(np.array([track.distances[0], track.distances[-1]]))
    # Where the prior of the estimate lies, evenly over all levels in ratios.
    threshold = np.exp(rng.uniform(ends[0], ends[1], TRACKS))
    counted = answered(track, threshold, rng)
    grid = lattice(track, fine=True)
    middle, low, high = grid.interval(grid.posterior(counted))
    inner = np.abs(np.log(threshold) - ends.mean()) < 0.4 * np.diff(ends)
    error_db = 20 * np.log10(middle / threshold)
    cover = float(((low <= threshold) & (threshold <= high)).mean())
    print(
        f"{method}: bias {error_db[inner].mean():+.2f} dB, RMSE "
        f"{np.sqrt(np.mean(error_db[inner] ** 2)):.2f} dB, coverage {cover:.3f}"
    )
    # Near the ends of the levels an interval ends there, too, and holds the truth more often.
    assert 0.93 <= cover <= 0.98
    assert abs(error_db[inner].mean()) < 1.0


@pytest.mark.parametrize("method", ["quest+", "staircase", "constant"])
def test_the_weber_fraction_comes_back_on_the_measured_axis(method: str) -> None:
    """Everybody tells a Weber fraction of .11; skins set their nominal thresholds apart."""
    track, rng = track_by(method), np.random.default_rng(31)
    standard = track.standard
    assert standard is not None
    felt_at = np.array(
        [
            friction_difference(STUDY, standard, track.at(level), NOMINAL)
            for level in range(len(track.values))
        ]
    )
    skin = np.exp(SKIN_SD * rng.standard_normal(TRACKS))
    truth = -np.log1p(-WEBER)
    levels = np.log(track.distances)
    threshold = np.exp(np.interp(np.log(truth / skin), np.log(felt_at), levels))
    known = threshold < 0.9 * track.distances[-1]
    counted = answered(track, threshold, rng)
    grid = lattice(track, fine=True)
    told = grid.interval(grid.posterior(counted))
    told_contrast = np.exp(np.interp(np.log(told), levels, np.log(felt_at)))
    inside, value = np.zeros(TRACKS, bool), np.full(TRACKS, np.nan)
    nominal = (told_contrast[1] <= truth) & (truth <= told_contrast[2])
    for who in range(TRACKS):
        asked = np.repeat(felt_at, counted[who].sum(axis=0).astype(int))
        noise = FRICTION_ERROR * rng.standard_normal(len(asked))
        felt = felt_of(asked, skin[who] * asked + noise)
        assert felt is not None
        middle, low, high = told_contrast[:, who].tolist()
        value[who], ends = felt.contrast(middle, (low, high))
        inside[who] = ends[0] <= truth <= ends[1]
    weber = 1 - np.exp(-np.exp(np.log(value[known]).mean()))
    print(
        f"{method}: Weber fraction {weber:.4f}; coverage {inside[known].mean():.3f} on the "
        f"measured axis, {nominal[known].mean():.3f} on the nominal one; {known.mean():.2f} known"
    )
    assert 0.93 <= inside[known].mean() <= 0.98
    assert weber == pytest.approx(WEBER, abs=0.006)
