"""A people file: one virtual person, or a population to draw from, in TOML.

`[person]` gives what all persons share, `[population]` how they differ:

    [person]
    felt_noise = 0.05

    [population]
    gain = { mean = 4.0, sd = 1.0 }
    skin = { median = 1.0, log_sd = 0.2 }
    drift = { low = -0.02, high = 0.02 }
    number_step = { values = [1, 2], shares = [0.9, 0.1] }

`effect` gives points by which conditions change a score, for a surface whose friction is not known:

    effect = { frequency = 2.0, pressure = -1.0 }

A file without `[population]` describes one person. What is given nowhere is as in the default
population, or, in a file of one person, as in `Person`. `[group.NAME.person]` and
`[group.NAME.population]` give what is otherwise in a group of the study.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from device.people import person as people
from protocol.errors import BadInput, Path, Problem, listed, meant, shown
from protocol.study.study import Study
from protocol.study_file.loading import located
from protocol.study_file.toml import toml_document

_TABLES = ("person", "population")
_EFFECT = "effect"
MOST_POINTS = 100.0
_FORMS = (("mean", "sd"), ("median", "log_sd"), ("low", "high"), ("values", "shares"))
_FORMS_IN_WORDS = ", ".join(f"{{ {one}, {other} }}" for one, other in _FORMS)


EFFECT_EXAMPLE = "effect = { condition = points }"


def require_effects(population: people.Population, study: Study) -> None:
    """Refuse effects of conditions that a study does not have.

    Raises:
        BadInput: there is one.
    """
    known = (*study.conditions, *(item.kind for item in study.opening))
    for name in population.effect or {}:
        if name not in known:
            raise BadInput(f"people file, effect: no condition {name!r}; there are {listed(known)}")


class PeopleError(BadInput):
    """A people file that cannot be used; `problems` lists why, in the order of the file."""

    def __init__(self, source: str, found: list[Problem]) -> None:
        self.problems = found
        super().__init__("; ".join(problem.located(source) for problem in found))


def people_in(text: str, source: str = "people.toml") -> people.Population:
    """Return the population that `text` describes; a single person is one without differences.

    Raise `PeopleError` if the text is no TOML, or has a key or value that cannot be used.
    """
    document = toml_document(text)
    if isinstance(document, Problem):
        raise PeopleError(source, [document])
    if problems := list(_problems(document)):
        raise PeopleError(source, located(text, problems))
    effect = document.get(_EFFECT)
    return replace(
        _population(document),
        effect=None if effect is None else {name: float(it) for name, it in effect.items()},
        groups={
            name: _population(_with_group(document, own))
            for name, own in document.get("group", {}).items()
        },
    )


def _with_group(document: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a group has: its own values, and those of all others."""
    person = own.get("person", {})
    varied = {key: how for key, how in document.get("population", {}).items() if key not in person}
    merged = {
        "person": document.get("person", {}) | person,
        "population": varied | own.get("population", {}),
    }
    return merged if {"population"} & {*document, *own} else {"person": merged["person"]}


def _population(document: Mapping[str, Any]) -> people.Population:
    person = {name: float(value) for name, value in document.get("person", {}).items()}
    if "population" not in document:
        return people.Population(typical=people.Person(**person))
    # What `[person]` gives is given for all: it must not vary as in the default population.
    varied = {
        name: given for name, given in people.DEFAULT.varied.items() if name not in person
    } | {name: _distribution(given) for name, given in document["population"].items()}
    return people.Population(typical=replace(people.DEFAULT.typical, **person), varied=varied)


def _problems(document: Mapping[str, Any], within: Path = ()) -> Iterator[Problem]:
    known = _TABLES if within else (*_TABLES, _EFFECT, "group")
    for table, entries in document.items():
        path = (*within, table)
        if table not in known:
            yield _unknown(path, known)
        elif not isinstance(entries, dict):
            yield _problem(path, "must be a table", entries)
        else:
            for name, value in entries.items():
                if table != "group":
                    yield from _entry_problems((*path, name), value)
                elif isinstance(value, dict) and value:
                    yield from _problems(value, (*path, name))
                else:
                    yield _problem((*path, name), "must have person or population", value)
    if not document:
        rule = "must have [person] or [population]"
        yield Problem(where="file", rule=rule, value="neither", path=())


def _entry_problems(path: Path, value: Any) -> Iterator[Problem]:
    limits = people.PARAMETERS.get(str(path[-1]))
    if path[-2] == _EFFECT:
        yield from _number_problems(path, value, -MOST_POINTS, MOST_POINTS)
    elif limits is None:
        yield _unknown(path, people.PARAMETERS)
    elif path[-2] == "person":
        yield from _number_problems(path, value, limits.low, limits.high)
    elif not isinstance(value, dict) or tuple(sorted(value)) not in map(tuple, map(sorted, _FORMS)):
        hint = "give what all share in [person]" if isinstance(value, int | float) else ""
        yield _problem(path, f"must be one of {_FORMS_IN_WORDS}", value, hint)
    else:
        yield from _distribution_problems(path, value, limits)


def _distribution_problems(
    path: Path, value: Mapping[str, Any], limits: people.Parameter
) -> Iterator[Problem]:
    if "values" in value:
        yield from _choice_problems(path, value, limits)
        return
    for key, given in value.items():
        # A spread is not one of the parameter's own values: its limits do not apply.
        ends = (0.0, math.inf) if key in {"sd", "log_sd"} else (limits.low, limits.high)
        yield from _number_problems((*path, key), given, *ends, above=key == "median")
    if all(_is_number(value.get(end)) for end in ("low", "high")) and value["low"] > value["high"]:
        yield _problem((*path, "high"), f"must be at least low = {value['low']}", value["high"])


def _choice_problems(
    path: Path, value: Mapping[str, Any], limits: people.Parameter
) -> Iterator[Problem]:
    values, shares = value["values"], value["shares"]
    for key, given, high in (("values", values, limits.high), ("shares", shares, math.inf)):
        if not isinstance(given, list) or not given:
            yield _problem((*path, key), "must be a list of numbers", given)
            return
        low = limits.low if key == "values" else 0.0
        for number, each in enumerate(given):
            yield from _number_problems((*path, key, number), each, low, high)
    if len(values) != len(shares):
        rule = f"must be as many as values: {len(values)}"
        yield _problem((*path, "shares"), rule, len(shares))
    elif all(map(_is_number, shares)) and not 0 < sum(shares) < math.inf:
        yield _problem((*path, "shares"), "must have a finite sum above 0", sum(shares))


def _number_problems(
    path: Path, value: Any, low: float, high: float, *, above: bool = False
) -> Iterator[Problem]:
    if not _is_number(value):
        yield _problem(path, "must be a number", value)
    elif not low <= value <= high:
        end = f"at least {low:g}" if value < low else f"at most {high:g}"
        yield _problem(path, f"must be {end}", value)
    elif above and value <= 0:
        yield _problem(path, "must be above 0", value)


def _is_number(value: Any) -> bool:
    # `true` is an int in Python.
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _problem(path: Path, rule: str, value: Any, hint: str = "") -> Problem:
    return Problem.of_key(path, rule, shown(value), hint)


def _unknown(path: Path, known: Iterable[str]) -> Problem:
    return _problem(path, "unknown key", str(path[-1]), meant(path[-1], known))


def _distribution(given: Mapping[str, Any]) -> people.Distribution:
    if "values" in given:
        values, shares = (tuple(map(float, given[key])) for key in ("values", "shares"))
        return people.OneOf(values_of=values, shares=shares)
    numbers = {key: float(value) for key, value in given.items()}
    if "mean" in given:
        return people.Normal(**numbers)
    return people.LogNormal(**numbers) if "median" in given else people.Uniform(**numbers)
