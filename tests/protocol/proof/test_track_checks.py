"""The independent check of the trials of tracks: each change made by hand is named."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from protocol.plan.plan import plan
from protocol.plan.trials import Plan, Trial
from protocol.proof.trial_checks import plan_problems
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study
from tests.protocol.studies import TRACKS

STUDY = parsed_study(TRACKS)
ONE_BY_ONE = parsed_study(TRACKS.replace("interleaved", "one after another"))
Change = Callable[[Trial], Trial]


def told(study: Study, found: Plan) -> str:
    return "\n".join(map(str, plan_problems(study, found)))


def track(role: str, name: str = "stairs") -> Callable[[Trial], bool]:
    return lambda trial: (
        trial.track is not None and (trial.track.name, trial.track.role) == (name, role)
    )


def planned(**changes: Any) -> Change:
    def change(trial: Trial) -> Trial:
        assert trial.track is not None
        return replace(trial, track=replace(trial.track, **changes))

    return change


def fields(**changes: Any) -> Change:
    return lambda trial: replace(trial, **changes)


def driven(trial: Trial) -> Trial:
    louder = trial.touches[-1].model_copy(update={"voltage_v": 30.0})
    return replace(trial, touches=(*trial.touches[:-1], louder))


def other_interval(trial: Trial) -> Trial:
    assert trial.track is not None
    number = 3 - (trial.track.interval or 0)
    moved = replace(trial, touches=trial.touches[::-1], expected=("first", "second")[number - 1])
    return replace(moved, track=replace(trial.track, interval=number))


LEVEL = track("level")
CASES: list[tuple[Callable[[Trial], bool], Change, str]] = [
    (LEVEL, fields(kind="trial"), "a trial of a track, and no other, must name one"),
    (LEVEL, fields(track=None), "a trial of a track, and no other, must name one"),
    (LEVEL, planned(name="another"), "a track must be one of the study's, got 'another'"),
    (LEVEL, planned(role="easy"), "stairs must have .*'level': 9"),
    (LEVEL, other_interval, "stairs must have each interval twice in 4 trials"),
    (LEVEL, fields(expected=None), "the right answer must be"),
    (LEVEL, driven, "the touches must be the standard, and the comparison in its interval"),
    (track("catch"), driven, "the touches must be the standard, and the comparison in its"),
    (track("level", "felt"), driven, "the touches must be the standard, and the comparison"),
    (LEVEL, lambda it: replace(it, touches=it.touches[:1]), "must have the touches of two"),
    (LEVEL, fields(scored=True), "must have no condition and no score"),
    (LEVEL, fields(condition="stairs"), "must have no condition and no score"),
    (LEVEL, fields(question="roughness"), "must have no condition and no score"),
    (LEVEL, fields(opposite=True), "must have no condition and no score"),
    (LEVEL, fields(block=7), "tracks must come in blocks of at most 8 trials"),
    (track("catch"), fields(expected="first"), "the right answer must be None"),
    (track("catch"), planned(interval=1), "the right answer must be"),
    (track("catch", "felt"), fields(expected="yes"), "the right answer must be no"),
    (track("level", "felt"), fields(expected="no"), "the right answer must be yes"),
    (track("level", "felt"), planned(interval=1), "the right answer must be yes"),
]


@pytest.mark.parametrize(("where", "change", "message"), CASES)
def test_a_changed_trial_of_a_track_is_detected(
    where: Callable[[Trial], bool], change: Change, message: str
) -> None:
    whole = plan(STUDY, 0)
    assert told(STUDY, whole) == ""
    index = next(trial.index for trial in whole.trials if where(trial))
    trials = list(whole.trials)
    trials[index] = change(trials[index])
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(told(STUDY, replace(whole, trials=tuple(trials))))


def reordered(whole: Plan, order: list[int]) -> Plan:
    """The trials in another order; what belongs to a place stays there."""
    trials = tuple(
        replace(
            whole.trials[old],
            index=new,
            block=whole.trials[new].block,
            break_s=whole.trials[new].break_s,
        )
        for new, old in enumerate(order)
    )
    return replace(whole, trials=trials)


def test_a_track_must_not_begin_with_a_catch_trial() -> None:
    whole = plan(STUDY, 0)
    level = next(trial.index for trial in whole.trials if LEVEL(trial))
    catch = next(trial.index for trial in whole.trials if track("catch")(trial))
    order = [*range(len(whole.trials))]
    order[level], order[catch] = catch, level
    assert "stairs must begin at a level that its method chooses" in told(
        STUDY, reordered(whole, order)
    )


def test_tracks_in_another_order_than_the_study_s_are_detected() -> None:
    mixed, in_turn = plan(STUDY, 0), plan(ONE_BY_ONE, 0)
    assert "each track must come once before one comes again" in told(STUDY, in_turn)
    assert "tracks must follow one another" in told(ONE_BY_ONE, mixed)


@pytest.mark.parametrize("study", [STUDY, ONE_BY_ONE], ids=["mixed", "in turn"])
def test_a_missing_trial_of_a_track_is_detected(study: Study) -> None:
    whole = plan(study, 0)
    for missing in range(len(whole.trials)):
        order = [index for index in range(len(whole.trials)) if index != missing]
        assert told(study, reordered(whole, order)), missing


def test_a_level_beyond_the_rig_s_limit_is_detected_without_any_answer() -> None:
    rig = STUDY.rig.model_copy(update={"max_voltage_v": 90})
    found = told(STUDY.model_copy(update={"rig": rig}), plan(STUDY, 0))
    assert "level 10 (100) of track stairs" in found
    assert "amplitude, V, must not exceed 90, got 100" in found
