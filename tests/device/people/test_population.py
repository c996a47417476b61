"""Virtual people: populations, and the scores of the default one against the published ones."""

from dataclasses import replace

import numpy as np
import pytest

from device.people.person import (
    DEFAULT,
    PARAMETERS,
    Distribution,
    LogNormal,
    Normal,
    OneOf,
    People,
    Person,
    Population,
    Uniform,
    World,
    drawn_person,
    people_of,
    person_name,
    person_of,
    truth_of,
)
from handbook.meanings import meanings

MEANINGS = meanings(Person)
NAMES = [person_name(seed, "P01") for seed in range(4000)]


def test_every_parameter_lies_within_its_limits() -> None:
    people = people_of(DEFAULT, NAMES)
    for name, parameter in PARAMETERS.items():
        values = getattr(people, name)
        assert parameter.low <= values.min() <= values.max() <= parameter.high, name
        assert (len(np.unique(values)) > 1) == (name in DEFAULT.varied), name
        assert MEANINGS[name]
        assert parameter.source


def test_a_distribution_has_its_moments() -> None:
    varied: dict[str, Distribution] = {
        "gain": Normal(mean=4.0, sd=1.0),
        "skin": LogNormal(median=1.2, log_sd=0.2),
        "drift": Uniform(low=-1.0, high=2.0),
        "number_step": OneOf(values_of=(1.0, 2.0), shares=(3.0, 1.0)),
    }
    people = people_of(Population(varied=varied), NAMES)
    assert (people.gain.mean(), people.gain.std()) == pytest.approx((4, 1), abs=0.05)
    assert np.log(people.skin).mean() == pytest.approx(np.log(1.2), abs=0.01)
    assert np.log(people.skin).std() == pytest.approx(0.2, abs=0.01)
    assert (people.drift.min(), people.drift.max()) == pytest.approx((-1, 2), abs=0.01)
    assert (people.number_step == 2).mean() == pytest.approx(0.25, abs=0.02)


def test_a_normal_distribution_is_cut_off_at_the_limits() -> None:
    people = people_of(Population(varied={"lapse": Normal(mean=0.0, sd=1.0)}), NAMES)
    assert people.lapse.min() >= 0
    assert people.lapse.max() <= 1
    assert 0.3 < people.lapse.mean() < 0.5


def test_a_person_is_the_same_wherever_the_name_is_drawn() -> None:
    people = people_of(DEFAULT, NAMES[:5])
    assert [people[number] for number in range(5)] == [
        drawn_person(DEFAULT, name) for name in NAMES[:5]
    ]
    assert people[0] != people[1]
    varied = {**DEFAULT.varied, "lapse": Uniform(low=0.1, high=0.2)}
    other = drawn_person(Population(typical=DEFAULT.typical, varied=varied), NAMES[0])
    assert replace(other, lapse=people[0].lapse) == people[0], "one parameter leaves the others"


def test_people_know_no_other_parameter() -> None:
    with pytest.raises(AttributeError, match="mood"):
        People.of([Person()]).mood  # noqa: B018 - reading it raises


def test_the_truth_holds_the_whole_person() -> None:
    person, world = drawn_person(DEFAULT, NAMES[0]), World(law="coulomb", damping_ratio=0.01)
    truth = truth_of(person, world)
    assert person_of(truth) == person
    assert (truth.law, truth.damping_ratio, truth.beam_gain) == ("coulomb", 0.01, 1.0)
