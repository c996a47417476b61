"""The model of the answers with arbitrary ones: a finite result or a reason."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.estimates import Estimate, NotEstimable
from analysis.sensitivity.answers_model import (
    NOBODY_ASKED,
    Noticed,
    Rated,
    StudyAnswers,
    sensitivity,
)
from analysis.sensitivity.lines import Ratings
from analysis.sensitivity.noticing_stage import Answered


@st.composite
def any_ratings(draw: st.DrawFn) -> Ratings:
    subjects, trials = draw(st.integers(1, 4)), draw(st.integers(1, 24))
    conditions = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    levels = draw(st.integers(1, 5))
    rating = rng.integers(0, draw(st.integers(1, 11)), trials).astype(np.float64)
    rating[rng.random(trials) < draw(st.sampled_from([0.0, 0.3]))] = np.nan
    return Ratings(
        subjects=tuple(f"s{number}" for number in range(subjects)),
        conditions=tuple(f"c{number}" for number in range(conditions)),
        subject=rng.integers(0, subjects, trials),
        condition=rng.integers(0, conditions, trials),
        contrast=rng.integers(-1, levels, trials).astype(np.float64) / 4,
        rating=rating,
    )


def is_sound(rated: Rated) -> bool:
    told = [
        estimate
        for person in rated.subjects
        for estimate in (person.level, person.bias, person.gain, person.relative_gain)
        if isinstance(estimate, Estimate)
    ]
    assert all(isinstance(person.relative_gain, Estimate) for person in rated.subjects[1:])
    told += [one for one in (rated.level, rated.gain) if isinstance(one, Estimate)]
    told += [*rated.effects.values(), *([rated.selection] if rated.selection else [])]
    ends = [(one.interval[0], one.value, one.interval[1]) for one in told]
    return bool(
        np.isfinite(ends).all()
        and (np.diff(ends) >= 0).all()
        and 0 <= rated.equal_gains <= 1
        and rated.gain_sd_upper > 0
        and all(person.trials and person.told != bool(person.reason) for person in rated.subjects)
    )


@settings(max_examples=20, deadline=None)
@given(any_ratings())
def test_ratings_alone_have_a_finite_result_or_a_reason(ratings: Ratings) -> None:
    found = sensitivity(StudyAnswers(ratings=ratings, scale=(0.0, 10.0)))
    assert found.noticing == NOBODY_ASKED
    assert isinstance(found.rating, NotEstimable) or is_sound(found.rating)


@settings(max_examples=15, deadline=None)
@given(any_ratings(), st.booleans(), st.integers(0, 2**32 - 1))
def test_answers_have_a_finite_result_or_a_reason(
    ratings: Ratings, selects: bool, chance: int
) -> None:
    rng = np.random.default_rng(chance)
    count = len(ratings.rating)
    answer, session = rng.integers(-1, 2, count), rng.integers(0, 2, count)
    answered = Answered(
        ratings=ratings,
        answer=answer,
        two_sided=(answer < 0) | (rng.random(count) < 0.5),
        first=rng.random(count) < 0.5,
        catch=ratings.contrast == 0,
    )
    people = len(ratings.subjects)
    several = people > 1
    found = sensitivity(
        StudyAnswers(
            ratings=ratings,
            scale=(0.0, 10.0),
            answered=answered,
            selects=selects,
            groups=("a", "b") if several else (),
            group=np.arange(people) % 2 if several else None,
            session=session,
        )
    )
    if isinstance(found.noticing, Noticed):
        ks = [person.criterion.interval for person in found.noticing.subjects]
        ds = [person.d.interval for person in found.noticing.subjects]
        assert np.isfinite([*ks, *ds]).all()
        assert 0 <= found.noticing.p <= 1
    assert isinstance(found.rating, NotEstimable) or is_sound(found.rating)


@pytest.mark.parametrize("repeats", [2, 4])
def test_some_ratings_have_a_result(repeats: int) -> None:
    ratings = Ratings(
        subjects=("a", "b"),
        conditions=("c",),
        subject=np.repeat([0, 1], 6 * repeats),
        condition=np.zeros(12 * repeats, dtype=np.int64),
        contrast=np.tile([0.0, 0.0, 0.5, 0.5, 1.0, 1.0], 2 * repeats),
        rating=np.tile([0.0, 2.0, 3.0, 4.0, 6.0, 9.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0], repeats),
    )
    alone = StudyAnswers(ratings=ratings, scale=(0.0, 10.0))
    assert isinstance(sensitivity(alone).rating, Rated)
    answer = np.where(np.isin(ratings.rating, [1.0, 4.0, 5.0, 6.0, 9.0, 10.0]), 1, 0)
    answered = Answered(
        ratings=ratings,
        answer=answer,
        two_sided=answer == 1,
        first=np.ones(len(answer), dtype=np.bool_),
        catch=ratings.contrast == 0,
    )
    found = sensitivity(replace(alone, answered=answered, selects=True))
    assert isinstance(found.noticing, Noticed)
    assert isinstance(found.rating, Rated)
