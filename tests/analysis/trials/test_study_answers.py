"""Answers of a study as the model takes them: what is expected, which trials, which contrasts."""

from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest

from analysis.estimates import FloatArray
from analysis.loading.study_data import StudyData, load_study_data
from analysis.sensitivity.answers_model import StudyAnswers
from analysis.sensitivity.noticing_stage import Answered
from analysis.trials.contrasts import trial_contrasts
from analysis.trials.study_answers import predictor, study_answers
from device.friction.changes import LAW
from protocol.study.factor import Group
from protocol.study.study import Study
from tests.analysis.reports import EXTENDED, PAPER, cohort, imported

EXPECTED = {entry.name: entry.expected for entry in EXTENDED.condition}


@cache
def loaded() -> StudyData:
    return load_study_data(cohort(EXTENDED, 4), rehearsals=False)


def contrasts(data: StudyData, study: Study = EXTENDED) -> FloatArray:
    return trial_contrasts(study, data.trials, data.touches).by_law[LAW]


def taken(data: StudyData, study: Study = EXTENDED, **changed: FloatArray) -> StudyAnswers:
    contrast = changed.get("contrast", contrasts(data, study))
    return study_answers(study, data, contrast, study.rating)


def answered(answers: StudyAnswers) -> Answered:
    assert answers.answered is not None
    return answers.answered


def used(data: StudyData) -> pd.DataFrame:
    """The scored trials and the catch trials, in the order in which they are taken."""
    return data.trials[data.trials["trial_kind"].isin(["trial", "catch"])]


def where(data: StudyData, chosen: "pd.Series[bool]", **columns: object) -> StudyData:
    """The data with other values in some columns of the chosen trials."""
    values = {name: data.trials[name].mask(chosen, value) for name, value in columns.items()}
    return replace(data, trials=data.trials.assign(**values))


def test_answers_are_relative_to_what_the_trial_itself_expects() -> None:
    data = loaded()
    trials, found = used(data), answered(taken(data))
    is_catch = trials["trial_kind"].eq("catch").to_numpy()
    opposite = trials["opposite"].astype(bool).to_numpy()
    agrees = trials["change"].eq(trials["expected"]).to_numpy()
    assert (opposite & ~is_catch).sum() >= 8
    for of in (opposite & ~is_catch, ~opposite & ~is_catch):
        assert ((found.answer == 1) == agrees)[of].all()
    assert set(found.answer[opposite]) >= {0, 1}
    # A trial in the opposite order expects the other answer of its question.
    more = {"smoother", "stronger", "swapped"}
    assert (found.first == trials["expected"].isin(more).to_numpy())[~is_catch].all()
    assert not found.first[opposite & ~is_catch].any()
    assert (found.ratings.contrast[~is_catch] > 0).all(), "in the direction that is expected"


def test_the_contrary_is_told_from_no_change() -> None:
    data = loaded()
    trials = data.trials
    smoother = trials["expected"].eq("smoother") & trials["trial_kind"].eq("trial")
    for change, answer in (("rougher", -1), ("same", 0), ("smoother", 1)):
        found = answered(taken(where(data, smoother, change=change)))
        assert (found.answer[smoother[used(data).index].to_numpy()] == answer).all(), change


def test_questions_of_two_answers_have_no_contrary() -> None:
    data = loaded()
    places = used(data)["question"].eq("places").to_numpy()
    scored = data.trials["question"].eq("places") & data.trials["trial_kind"].eq("trial")
    found = answered(taken(where(data, scored, change="not swapped")))
    assert (found.two_sided == ~places).all()
    chosen = scored[used(data).index].to_numpy()
    assert (found.answer[chosen] == 0).all()
    assert found.first[places].all()


def test_catch_trials_have_the_answer_that_their_condition_expects() -> None:
    data = loaded()
    trials = data.trials
    is_catch = trials["trial_kind"].eq("catch")
    of_condition = trials["condition"].map(EXPECTED)
    assert set(trials["expected"][is_catch]) == {"same", "not swapped"}
    found = answered(taken(data))
    assert found.catch.tolist() == is_catch[used(data).index].tolist()
    assert (found.ratings.contrast[found.catch] == 0).all()
    alarms = where(data, is_catch, change=of_condition)
    assert (answered(taken(alarms)).answer[found.catch] == 1).all()
    silent = where(data, is_catch, change=trials["expected"])
    assert (answered(taken(silent)).answer[found.catch] == 0).all()
    strength = is_catch & trials["question"].eq("strength")
    weaker = answered(taken(where(data, strength, change="weaker")))
    assert (weaker.answer[strength[used(data).index].to_numpy()] == -1).all()
    assert found.expected.sum() == trials["agrees"][trials["trial_kind"].eq("trial")].sum()


def test_trials_that_expect_no_change_tell_nothing() -> None:
    data = loaded()
    trials = data.trials
    pressure = trials["trial_kind"].eq("trial") & trials["condition"].eq("pressure")
    found = taken(where(data, pressure, expected="same"))
    left = ~pressure[used(data).index]
    assert len(answered(found).answer) == left.sum()
    assert found.ratings.rating == pytest.approx(used(data)["score"][left], nan_ok=True)


def test_of_practice_and_of_trials_without_an_answer_or_a_contrast_nothing_is_taken() -> None:
    data = loaded()
    assert len(answered(taken(data)).answer) == len(used(data)) < len(data.trials)
    first = used(data).index[0]
    silent = data.trials.index == first
    assert len(taken(where(data, pd.Series(silent, data.trials.index), change=None)).rated.rating)
    missing = where(data, pd.Series(silent, data.trials.index), change=None)
    assert len(answered(taken(missing)).answer) == len(used(data)) - 1
    contrast = contrasts(data)
    scored = data.trials["trial_kind"].eq("trial").to_numpy()
    contrast[np.flatnonzero(scored)[:3]] = np.nan
    found = answered(taken(data, contrast=contrast))
    assert len(found.answer) == len(used(data)) - 3
    assert found.catch.sum() == answered(taken(data)).catch.sum()


def test_scores_are_rated_where_the_change_was_noticed_or_everywhere() -> None:
    data = loaded()
    found = taken(data)
    assert found.selects
    assert found.scale == (0.0, 10.0)
    assert (np.isfinite(found.rated.rating) <= answered(found).expected).all()
    rating = EXTENDED.rating.model_copy(update={"score_when": "always"})
    every = taken(data, EXTENDED.model_copy(update={"rating": rating}))
    assert not every.selects
    assert every.selection_refusal is None


def test_imported_scores_have_no_answers() -> None:
    data = imported([[5, 7, np.nan], [4, 8, 9]])
    found = study_answers(PAPER, data, contrasts(data, PAPER), PAPER.rating)
    assert found.answered is None
    assert found.ratings.rating == pytest.approx([5, 7, np.nan, 4, 8, 9], nan_ok=True)
    assert found.rated is found.ratings
    assert (found.groups, found.group, found.session) == ((), None, None)
    unknown = np.full(len(data.trials), np.nan)
    assert len(study_answers(PAPER, data, unknown, PAPER.rating).ratings.rating) == 0


def test_groups_are_in_the_order_of_the_study_and_nobody_is_of_none() -> None:
    data, groups = loaded(), (Group(name="young", size=2), Group(name="old", size=2))
    study = EXTENDED.model_copy(update={"group": groups})
    names = data.table.subjects
    assert taken(data, study).groups == ()
    alone = replace(data, groups=dict.fromkeys(names, "old"))
    assert (taken(alone, study).groups, taken(alone, study).group) == ((), None)
    both = replace(data, groups={names[0]: "old", names[1]: "young", names[2]: "old"})
    found = taken(both, study)
    assert found.groups == ("young", "old")
    assert found.group is not None
    assert found.group.tolist() == [1, 0, 1, -1]
    # A group of an earlier study file comes last.
    other = replace(both, groups={**both.groups, names[3]: "middle"})
    assert taken(other, study).groups == ("young", "old", "middle")


def test_sessions_are_told_apart_where_there_are_several() -> None:
    data = loaded()
    assert taken(data).session is None
    later = data.trials["participant"].isin(data.table.subjects[:2])
    found = taken(where(data, later, session=3))
    assert found.session is not None
    assert found.session.tolist() == later[used(data).index].astype(int).tolist()


def test_measured_contrasts_are_taken_where_most_trials_have_one() -> None:
    predicted: FloatArray = np.arange(6, dtype=np.float64)
    scored = np.array([True] * 4 + [False] * 2)
    assert predictor(predicted, None, scored) == (predicted, False)
    few = np.array([1.0, np.nan, np.nan, np.nan, 1.0, 1.0])
    assert predictor(predicted, few, scored) == (predicted, False), (
        "those of other trials count not"
    )
    half = np.array([1.0, 2.0, np.nan, np.nan, np.nan, np.nan])
    taken_of, is_measured = predictor(predicted, half, scored)
    assert is_measured
    assert taken_of is half
    data = loaded()
    chosen = data.trials["trial_kind"].eq("trial").to_numpy()
    measured = np.where(chosen & (np.cumsum(chosen) % 3 > 0), 0.5, np.nan)
    contrast, is_measured = predictor(contrasts(data), measured, chosen)
    found = answered(taken(data, contrast=contrast))
    assert is_measured
    assert (~found.catch).sum() == np.isfinite(measured).sum()
    assert set(found.ratings.contrast) == {0.0, 0.5}
