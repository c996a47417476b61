"""The model of the answers: noticing, then rating, corrected for who noticed."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from analysis.estimates import Estimate, NotEstimable
from analysis.sensitivity.answers_model import (
    AnswersModel,
    Rated,
    StudyAnswers,
    answers_model,
    evidence,
    sensitivity,
)
from analysis.sensitivity.noticing_stage import (
    LAPSE,
    Answered,
    NoticingStage,
    noticing_stage,
)
from analysis.sensitivity.rating_stage import Beside, RatingStage, codes, rating_stage
from tests.analysis.sensitivity.answering_people import answered_study, people
from tests.analysis.sensitivity.calibration import held


def stages(answers: StudyAnswers) -> tuple[NoticingStage, RatingStage]:
    model = answers_model(answers)
    assert isinstance(model.noticing, NoticingStage)
    assert isinstance(model.rating, RatingStage)
    return model.noticing, model.rating


def answered(answers: StudyAnswers) -> Answered:
    assert answers.answered is not None
    return answers.answered


def rated(answers: StudyAnswers) -> Rated:
    found = sensitivity(answers).rating
    assert isinstance(found, Rated)
    return found


def holds(estimate: Estimate | NotEstimable, truth: float) -> bool:
    assert isinstance(estimate, Estimate)
    low, high = estimate.interval
    return low <= truth <= high


def test_the_gain_of_those_who_score_what_they_felt_is_not_too_small() -> None:
    """Who notices a weak change feels more of it: without the column, the line is too flat."""
    answers = people(2, subjects=30, repeats=12)
    _, found = stages(answers)
    plain = rating_stage(answers.rated, Beside())
    assert isinstance(plain, RatingStage)
    assert not holds(plain.of_group("gain"), 6)
    assert holds(found.of_group("gain"), 6)
    selection = found.selection
    assert selection is not None
    assert holds(selection, 6 * 0.15)
    assert selection.interval[0] > 0
    assert holds(found.of_group("level"), 4 + 6 * found.ready.axes.x_mean)
    assert holds(found.of_group("bias"), 4)


def test_noticing_is_what_it_was() -> None:
    first, _ = stages(people(subjects=20))
    assert holds(first.slopes[-1], first.answered.unit / 0.15)
    assert holds(first.criteria[-1], 1)
    assert holds(first.lean, -0.025 / 0.15)
    assert len({estimate.value for estimate in first.slopes}) == 21
    assert first.p < 1e-3


def test_false_alarms_are_those_of_the_catch_trials() -> None:
    first, _ = stages(people(1, subjects=60))
    trials, lean = first.answered, first.lean.value
    criterion = np.array([person.value for person in first.criteria[:-1]])
    assert not trials.first[trials.catch].any()
    for answer, towards in ((1, -lean), (-1, lean)):
        share = (1 - LAPSE) * norm.sf(criterion + towards).mean() + LAPSE / 3
        observed = np.mean(trials.answer[trials.catch] == answer)
        assert observed == pytest.approx(share, abs=0.02)


def test_criteria_d_and_gains_are_covered() -> None:
    shares = []
    for seed in range(8):
        study = answered_study(100 + seed)
        first, second = stages(study.answers)
        d = np.full(12, first.answered.unit / 0.15)
        # The column is the mean noise of those who notice, and b the level without any.
        shares.append(
            [
                held(first.criteria[:-1], study.criterion),
                held(first.slopes[:-1], d),
                held(second.of_subjects("gain"), study.gain),
            ]
        )
    assert (np.mean(shares, axis=0) > 0.9).all()


def test_noticing_whose_halves_disagree_has_twice_the_points(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    trials = answered(people(1, subjects=9, repeats=3))

    def effective() -> float:
        found = noticing_stage(trials)
        assert isinstance(found, NoticingStage)
        return found.posterior.points.effective

    once = effective()
    monkeypatch.setattr("analysis.sensitivity.integration.MOST_DISAGREEMENT", 0.01)
    assert effective() > 1.8 * once
    monkeypatch.setattr("analysis.sensitivity.integration.MOST_DISAGREEMENT", 0.001)
    found = noticing_stage(trials)
    assert isinstance(found, NotEstimable)
    assert "two sets of points" in found.reason


def test_who_notices_nothing_more_by_contrast_has_no_d() -> None:
    answers = people(subjects=12)
    trials = answered(answers)
    shuffled = np.random.default_rng(3).permutation(trials.answer)
    found = noticing_stage(replace(trials, answer=shuffled))
    assert isinstance(found, NoticingStage)
    assert holds(found.slopes[-1], 0)
    low, high = found.slopes[-1].interval
    assert (found.p < 0.05) == (low > 0 or high < 0)


def test_the_column_is_the_mean_noise_of_those_who_notice() -> None:
    first, _ = stages(people(subjects=2, repeats=4))
    d, k, lean = np.array([1.5, 0.8]), np.array([0.4, 1.3]), 0.3
    found = first.selection_at(d, k, lean, np.zeros(0))
    trials = first.answered
    subject, r = trials.ratings.subject, np.where(trials.first, 1, -1)
    a = d[subject] * trials.ratings.contrast / trials.unit - k[subject] - r * lean
    assert found == pytest.approx(norm.pdf(a) / norm.cdf(a))
    noise = np.random.default_rng(1).normal(size=400_000)
    for trial in range(6):
        assert found[trial] == pytest.approx(noise[noise > -a[trial]].mean(), abs=0.01)


def test_a_condition_that_is_noticed_better_selects_less() -> None:
    first, _ = stages(people(subjects=2, repeats=4))
    lines = np.ones(2), np.ones(2), 0.0
    plain = first.selection_at(*lines, np.zeros(0))
    better = first.selection_at(*lines, np.array([2.0, 0, 0, 0, 0]))
    changed = first.answered.ratings.condition == 0
    assert (better[changed & ~first.answered.catch] < plain[changed & ~first.answered.catch]).all()
    assert (better == plain)[~changed | first.answered.catch].all()


def test_the_questions_answers_exchanged_turn_the_lean_alone() -> None:
    trials = answered(people(subjects=6))
    found = [noticing_stage(it) for it in (trials, replace(trials, first=~trials.first))]
    one, other = (stage for stage in found if isinstance(stage, NoticingStage))
    assert other.lean.value == pytest.approx(-one.lean.value, abs=1e-6)
    assert other.selection == pytest.approx(one.selection, abs=1e-6)


def test_where_everything_is_scored_nothing_is_selected() -> None:
    answers = people(selects=False)
    _, found = stages(answers)
    changes = ~answered(answers).catch
    plain = rating_stage(answers.ratings.where(changes), Beside())
    assert isinstance(plain, RatingStage)
    assert found.selection is None
    assert found.of_group("gain") == plain.of_group("gain")
    assert holds(found.of_group("gain"), 6)


def test_scores_after_other_answers_and_of_catch_trials_do_not_count() -> None:
    answers = people(subjects=6)
    missing = np.isnan(answers.ratings.rating)
    scored = replace(answers.ratings, rating=np.where(missing, 0.0, answers.ratings.rating))
    trials = replace(answered(answers), ratings=scored)
    (_, one), (_, other) = (
        stages(it) for it in (answers, replace(answers, ratings=scored, answered=trials))
    )
    assert one.of_subjects("gain") == other.of_subjects("gain")


def test_where_nearly_everything_is_noticed_the_gain_is_that_of_the_ratings() -> None:
    answers = people(subjects=12, plus=0.5)
    assert answered(answers).share_noticed > 0.97
    assert holds(rated(answers).gain, 6)


def test_where_every_change_is_noticed_ratings_need_no_correction() -> None:
    answers = people(subjects=12, plus=0.5)
    changes = ~answered(answers).catch
    ratings = answers.ratings.where(changes)
    every = Answered(
        ratings=ratings,
        answer=np.ones(len(ratings.rating), dtype=np.int64),
        two_sided=np.ones(len(ratings.rating), dtype=np.bool_),
        first=answered(answers).first[changes],
        catch=np.zeros(len(ratings.rating), dtype=np.bool_),
    )
    known = replace(ratings, rating=np.nan_to_num(ratings.rating, nan=5.0))
    alike = replace(answers, ratings=known, answered=replace(every, ratings=known))
    model = answers_model(alike)
    assert model.noticing == NotEstimable("all answers are the same")
    plain = rating_stage(known, Beside())
    assert isinstance(plain, RatingStage)
    assert isinstance(model.rating, RatingStage)
    assert model.rating.selection is None
    assert model.rating.of_group("gain") == plain.of_group("gain")
    assert evidence(alike) == evidence(replace(alike, answered=None, selects=False))


def test_gains_are_refused_where_nearly_nothing_is_noticed() -> None:
    answers = people(subjects=6)
    number = np.arange(len(answers.ratings.rating))
    nothing = replace(answered(answers), answer=(number % 50 == 1).astype(np.int64))
    found = sensitivity(replace(answers, answered=nothing)).rating
    assert isinstance(found, NotEstimable)
    assert "2% of the changes were answered as expected" in found.reason


def test_contrasts_that_are_all_equal_have_no_slope() -> None:
    answers = people(subjects=6)
    ratings = replace(answers.ratings, contrast=np.ones(len(answers.ratings.contrast)))
    trials = replace(answered(answers), ratings=ratings, catch=np.zeros(len(ratings.rating), bool))
    found = answers_model(replace(answers, ratings=ratings, answered=trials))
    assert isinstance(found.noticing, NotEstimable)
    assert isinstance(found.rating, NotEstimable)


def test_invalid_answers_are_refused() -> None:
    trials = answered(people(subjects=2))
    with pytest.raises(ValueError, match="an answer must be -1, 0 or 1, got 2"):
        replace(trials, answer=trials.answer + 1)
    with pytest.raises(ValueError, match="first must have 72 trials, got 3"):
        replace(trials, first=trials.first[:3])


# Groups and sessions.


def test_codes_of_levels_have_the_same_prior_for_all() -> None:
    for levels in (2, 3, 5):
        of_levels = codes(levels)
        assert of_levels.sum(axis=0) == pytest.approx(np.zeros(levels - 1))
        wanted = np.eye(levels) - 1 / levels
        assert of_levels @ of_levels.T == pytest.approx(wanted)
    assert codes(0).shape == (0, 0)


def test_groups_have_their_gains_and_the_group_their_mean() -> None:
    found = rated(people(3, subjects=24, repeats=8, steeper=-4.0))
    young, old = found.groups
    assert (young.name, old.name) == ("young", "old")
    assert holds(young.gain, 6)
    assert holds(old.gain, 2)
    (apart,) = found.differences
    assert apart.name == "young - old"
    assert holds(apart.gain, 4)
    assert apart.gain.interval[0] > 0
    assert holds(found.gain, 4)
    mean = (young.gain.value + old.gain.value) / 2
    assert isinstance(found.gain, Estimate)
    assert found.gain.value == pytest.approx(mean, abs=0.05)
    of_old = [person.gain.value for person in found.subjects[12:]]
    assert np.mean(of_old) == pytest.approx(old.gain.value, abs=0.6)


def test_the_order_of_groups_changes_names_alone() -> None:
    answers = people(3, subjects=12, steeper=-4.0)
    assert answers.group is not None
    turned = replace(answers, groups=("old", "young"), group=1 - answers.group)
    one, other = rated(answers), rated(turned)
    assert other.groups[0].gain.value == pytest.approx(one.groups[1].gain.value, abs=1e-2)
    assert other.differences[0].gain.value == pytest.approx(
        -one.differences[0].gain.value, abs=1e-2
    )


def test_a_session_that_is_scored_higher_throughout_leaves_the_lines() -> None:
    plain, later = (people(4, subjects=12, later=points) for points in (1e-9, 2.0))
    one, other = rated(plain), rated(later)
    assert isinstance(one.gain, Estimate)
    assert holds(other.gain, 6)
    # The level is that of the mean of the sessions.
    assert isinstance(one.level, Estimate)
    assert holds(other.level, one.level.value + 1)


# What is told.


def test_gains_are_told_where_a_persons_interval_leaves_less_than_half_of_the_scale() -> None:
    for repeats, is_told in ((2, False), (10, True)):
        answers = people(5, subjects=12, repeats=repeats)
        model = answers_model(answers)
        found = model.rated
        assert isinstance(found, Rated)
        for person in found.subjects:
            low, high = person.gain.interval
            assert person.told == ((high - low) * found.span / 10 < 0.5)
            assert person.told == (not person.reason)
        assert (found.untold is None) == is_told
        if found.untold is not None:
            times = np.ceil(10 * (model.usual_open_share / 0.5) ** 2) / 10
            assert f"about {times:.3g} times as many rated trials" in found.untold.reason


def test_no_gain_is_told_where_most_scores_are_the_highest() -> None:
    answers = people(5, subjects=12, repeats=10)
    lower = replace(answers, scale=(0.0, float(np.nanmedian(answers.ratings.rating))))
    found = rated(lower)
    assert found.untold is not None
    assert "of the scores are the highest possible" in found.untold.reason
    assert not any(person.told for person in found.subjects)


def test_a_single_subject_tells_nothing_about_a_population() -> None:
    found = rated(people(subjects=1, repeats=20))
    assert isinstance(found.gain, NotEstimable)
    assert isinstance(found.level, NotEstimable)
    (person,) = found.subjects
    assert found.of(np.array([0.0])) == pytest.approx([person.bias.value])
    assert isinstance(person.relative_gain, NotEstimable)


def test_somebody_without_ratings_is_not_among_the_people() -> None:
    answers = people(subjects=8)
    silent = answers.ratings.subject == 3
    trials = replace(answered(answers), answer=np.where(silent, 0, answered(answers).answer))
    found = sensitivity(replace(answers, answered=trials))
    assert isinstance(found.rating, Rated)
    assert [person.subject for person in found.rating.subjects] == [
        f"P{number}" for number in range(8) if number != 3
    ]
    relative = [person.relative_gain for person in found.rating.subjects]
    values = [of.value for of in relative if isinstance(of, Estimate)]
    assert len(values) == 7
    assert sum(values) == pytest.approx(0, abs=0.2)


def test_the_evidence_is_higher_under_the_contrasts_that_were_felt() -> None:
    answers = people(6, subjects=12)
    wrong = replace(answers.ratings, contrast=answers.ratings.contrast**0.2)
    other = replace(answers, ratings=wrong, answered=replace(answered(answers), ratings=wrong))
    right, false = evidence(answers), evidence(other)
    assert isinstance(right, float)
    assert isinstance(false, float)
    assert right > false + 3


def test_where_nobody_was_asked_ratings_alone_are_modelled() -> None:
    answers = replace(people(selects=False), answered=None)
    changes = answers.ratings.where(answers.ratings.contrast > 0)
    model: AnswersModel = answers_model(replace(answers, ratings=changes))
    assert isinstance(model.noticing, NotEstimable)
    assert "nobody was asked" in model.noticing.reason
    assert isinstance(model.rating, RatingStage)
    assert holds(model.rating.of_group("gain"), 6)
