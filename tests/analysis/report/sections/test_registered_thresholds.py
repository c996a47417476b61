"""Registered hypotheses on thresholds: one that is above another, and one that is estimated."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from analysis.estimates import NotEstimable
from analysis.loading.study_data import load_study_data
from analysis.report.findings import Findings
from analysis.report.hypotheses import Judged, how_tested, registered
from analysis.trials.track_fits import thresholds
from device.friction.calibration import NOMINAL
from protocol.registration.registration import OMNIBUS, threshold_of
from protocol.study_file.loading import parsed_study
from tests.analysis.tracks import BOTH, TRACKS, session

QUEST, STAIRCASE = "smallest amplitude", "by a staircase"


def judged(found: Findings, name: str) -> Judged:
    (hypothesis,) = registered(found.study, [name])
    return hypothesis.judge(found)


@pytest.fixture(scope="module")
def found() -> Findings:
    chains = [session(TRACKS, f"P{slot:02d}", slot, threshold=40.0) for slot in range(8)]
    study = parsed_study(TRACKS)
    data = load_study_data(chains, rehearsals=False)
    same = thresholds(study, data, NOMINAL)
    assert same is not None
    people = [
        replace(each, threshold=each.threshold * (2 if each.track == STAIRCASE else 1))
        for each in same.people
    ]
    made: Any = SimpleNamespace(study=study, thresholds=replace(same, people=tuple(people)))
    return cast(Findings, made)


def test_thresholds_that_are_twice_as_large_are_above_the_others(found: Findings) -> None:
    told = judged(found, threshold_of(STAIRCASE, QUEST))
    assert isinstance(told, tuple)
    said, p, supported = told
    assert supported
    assert p is not None
    assert p < 0.05
    assert said.startswith("ratio ")
    contrary = judged(found, threshold_of(QUEST, STAIRCASE))
    assert isinstance(contrary, tuple)
    assert contrary[1:] == (p, False)


def test_a_threshold_beyond_the_levels_counts_as_the_last_level(found: Findings) -> None:
    same = found.thresholds
    assert same is not None
    people = [
        replace(each, threshold=float("nan"), reason="above 160 V", limit=160.0)
        if each.track == STAIRCASE
        else each
        for each in same.people
    ]
    made: Any = SimpleNamespace(study=found.study, thresholds=replace(same, people=tuple(people)))
    told = judged(cast(Findings, made), threshold_of(STAIRCASE, QUEST))
    assert isinstance(told, tuple)
    assert told[2]


def test_a_single_threshold_is_estimated_and_nothing_is_claimed(found: Findings) -> None:
    told = judged(found, threshold_of(QUEST))
    assert isinstance(told, tuple)
    assert told[1:] == (None, None)
    assert " V, 95% CI [" in told[0]


def test_a_study_of_tracks_alone_has_no_hypotheses_on_conditions() -> None:
    assert next(iter(how_tested(parsed_study(TRACKS)))) == threshold_of(QUEST, STAIRCASE)
    assert OMNIBUS in how_tested(parsed_study(BOTH))


def test_missing_thresholds_are_said(found: Findings) -> None:
    nobody = cast(Findings, SimpleNamespace(study=found.study, thresholds=None))
    assert isinstance(judged(nobody, threshold_of(QUEST)), NotEstimable)
    assert isinstance(judged(nobody, threshold_of(QUEST, STAIRCASE)), NotEstimable)


def test_a_weber_fraction_is_below_a_limit_if_its_interval_is(found: Findings) -> None:
    made = found.thresholds
    assert made is not None
    (cohort,) = (each for each in made.cohort if each.track == QUEST)
    assert not isinstance(cohort.weber_interval, NotEstimable)
    upper = cohort.weber_interval[1]
    for limit, holds in ((round(1.1 * upper, 4), True), (round(0.9 * upper, 4), False)):
        told = judged(found, f"Weber fraction of {QUEST} below {limit:g}")
        assert isinstance(told, tuple)
        assert told[1:] == (None, holds)
        assert "(predicted friction), 95% CI [" in told[0]
    nobody = cast(Findings, SimpleNamespace(study=found.study, thresholds=None))
    unknown = judged(nobody, f"Weber fraction of {QUEST} below 0.1")
    assert isinstance(unknown, NotEstimable)


def test_only_a_share_is_a_limit_of_a_weber_fraction() -> None:
    study = parsed_study(TRACKS)
    right = f"Weber fraction of {QUEST} below 0.15"
    for wrong in (
        f"Weber fraction of {QUEST} below 15",
        f"Weber fraction of {QUEST} below 0",
        "Weber fraction of nothing below 0.15",
        f"Weber fraction of {QUEST}",
    ):
        assert [*how_tested(study, [right, wrong])][-1] == right
