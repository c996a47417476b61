"""People files: one person or a population, and every problem at once."""

import re

import pytest

from device.people.people_file import PeopleError, people_in
from device.people.person import DEFAULT, LogNormal, Normal, OneOf, Person, Uniform, drawn_person


def test_a_file_with_a_person_alone_is_that_person() -> None:
    people = people_in("[person]\ngain = 3\nfelt_noise = 0.05\n")
    assert people.varied == {}
    assert drawn_person(people, "1/P01") == Person(gain=3.0, felt_noise=0.05)
    assert drawn_person(people, "2/P02") == Person(gain=3.0, felt_noise=0.05)


def test_a_population_has_what_the_file_says_and_the_rest_of_the_default_one() -> None:
    people = people_in(
        "[person]\nfelt_noise = 0.05\nbias = 6\n[population]\n"
        "gain = { mean = 4.0, sd = 1.5 }\n"
        "skin = { median = 1.1, log_sd = 0.3 }\n"
        "drift = { low = -0.02, high = 0.02 }\n"
        "number_step = { values = [1, 2], shares = [0.8, 0.2] }\n"
    )
    assert people.typical.felt_noise == 0.05
    assert people.typical.beyond_ramp == DEFAULT.typical.beyond_ramp
    assert people.varied == {
        **{name: how for name, how in DEFAULT.varied.items() if name != "bias"},
        "gain": Normal(mean=4.0, sd=1.5),
        "skin": LogNormal(median=1.1, log_sd=0.3),
        "drift": Uniform(low=-0.02, high=0.02),
        "number_step": OneOf(values_of=(1.0, 2.0), shares=(0.8, 0.2)),
    }


def test_a_group_has_what_the_file_says_of_it_and_shares_the_rest() -> None:
    people = people_in(
        "[person]\nlapse = 0.02\n[population]\ngain = { mean = 4.0, sd = 1.5 }\n"
        "[group.old.person]\ngain = 2\nfelt_noise = 0.2\n"
        "[group.gloves.population]\nskin = { low = 0.1, high = 0.2 }\n"
    )
    assert people.of_group(None) is people is people.of_group("young")
    old, gloves = map(people.of_group, ("old", "gloves"))
    assert (old.typical.gain, old.typical.felt_noise, old.typical.lapse) == (2.0, 0.2, 0.02)
    assert "gain" not in old.varied
    assert gloves.varied == {**people.varied, "skin": Uniform(low=0.1, high=0.2)}
    assert drawn_person(gloves, "1/P01").gain == drawn_person(people, "1/P01").gain
    one = people_in("[group.old.person]\ngain = 2\n")
    assert one.of_group("old").varied == {}
    assert drawn_person(one.of_group("old"), "1/P01") == Person(gain=2.0)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[group.old]\n", "1: group.old: must have person or population, got {}"),
        ("[group.old.person]\ngian = 3\n", "2: group.old.person.gian: unknown key, got 'gian'"),
        ("[group.old.group]\na = 3\n", "group.old.group: unknown key, got 'group'"),
        ("[group.old.population]\nskin = 3\n", "2: group.old.population.skin: must be one of"),
        ("", "people.toml: file: must have [person] or [population], got neither"),
        (
            "[persons]\n",
            "1: persons: unknown key, got 'persons'; did you mean 'person'?",
        ),
        ("person = 3\n", "people.toml:1: person: must be a table, got 3"),
        (
            "[person]\ngian = 3\n",
            "2: person.gian: unknown key, got 'gian'; did you mean 'gain'?",
        ),
        ("[person]\nlapse = 1.5\n", "people.toml:2: person.lapse: must be at most 1, got 1.5"),
        ("[person]\nlapse = -1\n", "people.toml:2: person.lapse: must be at least 0, got -1"),
        ("[person]\ngain = true\n", "people.toml:2: person.gain: must be a number, got True"),
        ("[person]\ngain = nan\n", "people.toml:2: person.gain: must be a number, got nan"),
        ("[population]\ngain = 3\n", "got 3; give what all share in [person]"),
        ("[population]\ngain = { mean = 3 }\n", "population.gain: must be one of { mean, sd }, "),
        ("[population]\ngain = { mean = 3, sd = -1 }\n", "gain.sd: must be at least 0, got -1"),
        ("[population]\ngain = { mean = 3000, sd = 1 }\n", "gain.mean: must be at most 200"),
        (
            "[population]\nskin = { median = 0, log_sd = 1 }\n",
            "median: must be above 0, got 0",
        ),
        ("[population]\nskin = { low = 2, high = 1 }\n", "high: must be at least low = 2, got 1"),
        (
            "[population]\nskin = { values = [], shares = [] }\n",
            "a list of numbers, got []",
        ),
        (
            "[population]\nskin = { values = [1], shares = [1, 2] }\n",
            "skin.shares: must be as many as values: 1, got 2",
        ),
        (
            "[population]\nskin = { values = [1], shares = [0] }\n",
            "must have a finite sum above 0, got 0",
        ),
        (
            "[population]\nskin = { values = [1, 2], shares = [1e308, 1e308] }\n",
            "sum above 0, got inf",
        ),
        ("[person\n", "people.toml:1: "),
    ],
)
def test_a_problem_names_line_key_rule_and_value(text: str, problem: str) -> None:
    with pytest.raises(PeopleError, match=re.escape(problem)):
        people_in(text)


def test_all_problems_are_told_at_once_in_the_order_of_the_file() -> None:
    with pytest.raises(PeopleError, match=r"(?s)2: person\.lapse.*3: person\.gian.*5: population"):
        people_in("[person]\nlapse = 2\ngian = 1\n[population]\nskin = 1\n")


def test_a_file_of_any_size_is_refused_at_once() -> None:
    with pytest.raises(PeopleError, match="must have at most 262144 characters"):
        people_in("# " + "x" * 300_000)
