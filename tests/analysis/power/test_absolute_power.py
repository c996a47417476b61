"""Power of a study that scores what is felt at once: its people, truths and null cohorts."""

from dataclasses import replace

import numpy as np

from analysis.estimates import NotEstimable
from analysis.power.answered_cohorts import AnsweredCohorts
from analysis.power.null_cohorts import ALIKE, DIFFERING, KINDS, kind_named, kinds_of, null_tables
from analysis.power.people_cohorts import PeopleCohorts
from analysis.power.study_records import asked_by
from analysis.sensitivity.answers_model import answers_model
from analysis.simulation import responses
from device.people.person import Person
from protocol.registration.registration import FOLLOWS, GAINS, NOTICED, OMNIBUS
from tests.analysis.rated import RATED
from tests.analysis.reports import PAPER

PEOPLE = 8


def cohorts(**typical: float) -> PeopleCohorts:
    own = Person(bias=6.0, gain=8.0, rating_noise=0.8)
    made = PeopleCohorts(study=RATED, participants=PEOPLE)
    population = replace(made.population, typical=replace(own, **typical), varied={})
    return replace(made, population=population)


def test_nothing_is_asked_of_noticing() -> None:
    asked = asked_by(RATED, models=True)
    assert asked.absolute
    assert not [name for name in asked.tests if NOTICED in name]
    assert {OMNIBUS, FOLLOWS, GAINS} <= set(asked.tests)
    assert max(asked.contrasts) < 0
    assert kinds_of(asked) == (ALIKE, DIFFERING)
    assert kinds_of(asked_by(PAPER)) == KINDS
    assert kind_named(ALIKE.name) is ALIKE


def test_a_response_of_simulated_people_is_their_score() -> None:
    simulation = cohorts().simulation
    (made,) = simulation.sessions(PEOPLE, "1")
    assert np.array_equal(responses(simulation.planned, made), made.score)
    assert np.isfinite(made.score).all()
    assert set(np.unique(made.score)) <= set(range(1, 8))
    # Friction falls, and so do the scores of people with a gain above 0.
    tables, _ = simulation.tables(PEOPLE, [made])
    means = tables.responses[0].mean(axis=0)
    assert means[0] > means[-1] + 0.5


def test_the_model_has_ratings_alone_and_holds_the_truth() -> None:
    answered = AnsweredCohorts(cohorts=cohorts())
    held = []
    for key in map(str, range(8)):
        one = answered.cohort(key)
        answers = one.answers
        assert answers.answered is None
        assert not answers.selects
        assert len(answers.ratings.rating) == PEOPLE * 12  # no catch trials
        assert answers.ratings.contrast.max() < 0
        model = answers_model(answers)
        assert not isinstance(model.rating, NotEstimable)
        assert model.rating.selection is None
        gain = model.rating.of_group("gain")
        low, high = gain.interval
        held.append(low <= float(answered.population.gain) <= high)
        assert gain.value > 0
    # What 8 of 10 points a unit are of 6 points, a little less because fingers differ.
    assert 3.5 < float(answered.population.gain) < 5.0
    assert sum(held) >= 7


def test_where_nothing_has_an_effect_conditions_are_alike() -> None:
    keys = [str(number) for number in range(60)]
    people = replace(cohorts(), population=ALIKE.population(cohorts().population))
    means = null_tables(ALIKE, people, keys).responses.mean(axis=(0, 1))
    assert np.ptp(means) < 0.1
    asked = asked_by(RATED)
    assert ALIKE.is_false(asked, OMNIBUS)
    assert ALIKE.is_false(asked, FOLLOWS)
    apart = replace(cohorts(), population=DIFFERING.population(cohorts().population))
    differ = null_tables(DIFFERING, apart, keys[:6]).responses.mean(axis=1)
    assert (np.ptp(differ, axis=1) > 0.3).all()
    assert not DIFFERING.is_false(asked, OMNIBUS)
