"""The trials of tracks: their roles, intervals, order and blocks."""

from collections import Counter
from itertools import groupby

import pytest

from protocol.plan.plan import plan
from protocol.plan.trials import Trial
from protocol.proof.trial_checks import plan_problems
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.protocol.studies import TRACKS

STUDY = parsed_study(TRACKS)
ONE_BY_ONE = parsed_study(TRACKS.replace("interleaved", "one after another"))
MANY = parsed_study(TRACKS.replace("trials = 9", "trials = 90").replace("= 7", "= 70"))


def trials_of(study: Study, slot: int, name: str) -> list[Trial]:
    return [each for each in plan(study, slot).trials if each.track and each.track.name == name]


def names(study: Study, slot: int) -> list[str]:
    return [trial.track.name for trial in plan(study, slot).trials if trial.track]


@pytest.mark.parametrize("study", [STUDY, ONE_BY_ONE, MANY], ids=["mixed", "in turn", "many"])
def test_plans_of_tracks_keep_every_rule(study: Study) -> None:
    for slot in range(40):
        assert plan_problems(study, plan(study, slot)) == []


def test_each_role_comes_as_often_as_the_study_says() -> None:
    for slot in range(20):
        roles = Counter(each.track.role for each in trials_of(STUDY, slot, "stairs") if each.track)
        assert roles == {"level": 9, "catch": 2, "easy": 1}
        first = trials_of(STUDY, slot, "stairs")[0].track
        assert first is not None
        assert first.role == "level"


@pytest.mark.parametrize(("name", "intervals"), [("stairs", 2), ("odd one", 3)])
def test_the_comparison_comes_equally_often_in_each_interval(name: str, intervals: int) -> None:
    for slot in range(10):
        made = [each for each in trials_of(MANY, slot, name) if each.expected is not None]
        drawn = [each.track.interval for each in made if each.track]
        whole = drawn[: len(drawn) // (2 * intervals) * 2 * intervals]
        assert set(Counter(whole).values()) == {len(whole) // intervals}
        assert max(len(list(run)) for _, run in groupby(drawn)) <= 4
        for trial, interval in zip(made, drawn, strict=True):
            assert interval is not None
            assert trial.expected == ("first", "second", "third")[interval - 1]


def test_a_catch_trial_has_the_standard_alone_and_no_right_interval() -> None:
    (track, felt, _) = STUDY.track
    caught = [each for each in trials_of(STUDY, 0, "stairs") if each.track.role == "catch"]  # type: ignore[union-attr]
    assert [(each.touches, each.expected) for each in caught] == [((track.standard,) * 2, None)] * 2
    answers = Counter((each.expected, len(each.touches)) for each in trials_of(STUDY, 0, "felt"))
    assert answers == {("yes", 1): 6, ("no", 1): 2}
    assert felt.intervals == 1


def test_interleaved_tracks_take_turns_and_others_follow_one_another() -> None:
    for slot in range(20):
        mixed, in_turn = names(STUDY, slot), names(ONE_BY_ONE, slot)
        assert Counter(mixed) == Counter(in_turn) == {"stairs": 12, "felt": 8, "odd one": 7}
        rounds = [sorted(mixed[at : at + 3]) for at in range(0, 21, 3)]
        assert rounds == [sorted(["stairs", "felt", "odd one"])] * 7
        assert len(list(groupby(in_turn))) == 3
    # Both draw their order: participants do not all begin with the same track.
    for study in (STUDY, ONE_BY_ONE):
        assert {names(study, slot)[0] for slot in range(20)} == {"stairs", "felt", "odd one"}


def test_blocks_and_breaks_of_tracks_follow_those_of_conditions() -> None:
    text = template("threshold").replace(
        "[[track]]", "break_every_blocks = 1\nbreak_s = 60\ntrack_block = 25\n\n[[track]]", 1
    )
    trials = plan(parsed_study(text), 0).trials
    before = max(trial.block for trial in trials if trial.track is None)
    sizes = Counter(trial.block - before for trial in trials if trial.track)
    assert sizes == {1: 25, 2: 25, 3: 25, 4: 25, 5: 8}
    breaks = [trial.block - before for trial in trials if trial.track and trial.break_s]
    assert breaks == [1, 2, 3, 4, 5]
    assert before == 1


def test_the_same_seed_gives_the_same_plan_and_another_slot_or_session_another() -> None:
    assert plan(STUDY, 3) == plan(STUDY, 3)
    orders = {tuple(names(STUDY, slot)) for slot in range(10)}
    assert len(orders) == 10
    assert plan(STUDY, 3).trials != plan(STUDY, 3, 2).trials


def test_a_track_that_is_added_leaves_the_conditions_and_other_tracks_as_they_were() -> None:
    text = template("threshold")
    whole = parsed_study(text)
    fewer = whole.model_copy(update={"track": whole.track[:1]})
    for slot in range(5):
        assert plan(whole, slot).sequence == plan(fewer, slot).sequence
        own = [
            [each.track for each in trials_of(study, slot, "smallest amplitude")]
            for study in (whole, fewer)
        ]
        assert own[0] == own[1]
