"""Whether a touch was made as instructed, by its samples alone."""

import pytest

from protocol.journal.records import TraceSample
from protocol.study.rules import TouchRules
from runner.screens import Pacing
from runner.session.measured import judged


@pytest.mark.parametrize(
    ("force_n", "is_right"), [(0.24, False), (0.26, True), (0.74, True), (0.76, False)]
)
def test_a_force_may_differ_by_a_share_of_the_instructed_one(
    force_n: float, is_right: bool
) -> None:
    pacing = Pacing(start_m=0.04, end_m=0.04, duration_s=1.0, force_n=0.5, direction="right")
    samples = [TraceSample(0.1 * step, force_n, 0.04) for step in range(5)]
    assert judged(pacing, samples, TouchRules(force_within=0.5)).force_ok is is_right


def test_the_median_force_is_kept_to_a_tenth_of_a_millinewton() -> None:
    pacing = Pacing(start_m=0.04, end_m=0.04, duration_s=1.0, force_n=0.5, direction="right")
    samples = [TraceSample(0.1 * step, 0.412345 + 0.1 * step, 0.04) for step in range(3)]
    assert judged(pacing, samples, TouchRules()).force_n == 0.5123


@pytest.mark.parametrize(("end_m", "is_right"), [(0.05, True), (0.046, False), (0.03, False)])
def test_a_slide_is_judged_by_all_of_its_path(end_m: float, is_right: bool) -> None:
    pacing = Pacing(start_m=0.03, end_m=0.05, duration_s=1.0, force_n=0.5, direction="right")
    places = (0.03, (0.03 + end_m) / 2, end_m)
    samples = [TraceSample(0.5 * step, 0.5, place) for step, place in enumerate(places)]
    assert judged(pacing, samples, TouchRules(path_within=0.15)).place_ok is is_right


@pytest.mark.parametrize(
    ("speed_m_s", "is_right"), [(0.0161, True), (0.0159, False), (0.0239, True), (0.0241, False)]
)
def test_the_median_speed_may_differ_by_a_share_of_the_instructed_one(
    speed_m_s: float, is_right: bool
) -> None:
    pacing = Pacing(start_m=0.03, end_m=0.05, duration_s=1.0, force_n=0.5, direction="right")
    places_m = (0.03, 0.03 + 0.2 * speed_m_s, 0.03 + 0.4 * speed_m_s, 0.05)
    samples = [TraceSample(0.2 * step, 0.5, place) for step, place in enumerate(places_m)]
    assert judged(pacing, samples, TouchRules(speed_within=0.2)).speed_ok is is_right


def test_a_share_itself_is_allowed() -> None:
    pacing = Pacing(start_m=0.0, end_m=0.25, duration_s=1.0, force_n=0.5, direction="right")
    samples = [TraceSample(0.25 * step, 0.75, 0.09375 * step) for step in range(5)]
    rules = TouchRules(speed_within=0.5, force_within=0.5, path_within=0.5)
    measured = judged(pacing, samples, rules)
    assert (measured.speed_ok, measured.force_ok, measured.place_ok) == (True, True, True)
