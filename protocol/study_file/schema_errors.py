"""The errors that pydantic finds in a study file, in our words."""

import re
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from protocol.errors import MOST_PROBLEMS, Path, Problem
from protocol.study.fields import unprintable
from protocol.study.study import Study
from protocol.study_file.units import unit_hint

_RULES = {
    "less_than_equal": "must be at most {le:.15g}",
    "less_than": "must be below {lt:.15g}",
    "greater_than_equal": "must be at least {ge:.15g}",
    "greater_than": "must be above {gt:.15g}",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "int_from_float": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be a text",
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "tuple_type": "must be a list",
    "literal_error": "must be one of {expected}",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": "must be a name of letters, digits, . _ and -",
    "too_short": "must have at least {min_length} entries",
    "too_long": "must have at most {max_length} entries",
}
_OUT_OF_RANGE = {"less_than_equal", "greater_than_equal", "float_type"}
_UNKNOWN = "unknown key"
_NEW_LANGUAGE = "touchbeam translate begins the file of another language"
_PEAK = "amplitudes are peak: half of the peak-to-peak value, as a plain number in V"


def schema_problems(document: Mapping[str, Any], error: ValidationError) -> list[Problem]:
    """Return a problem for each error found in `document`, unknown keys before missing ones.

    No more than one above `MOST_PROBLEMS`.
    """
    entries = [entry for entry in error.errors(include_url=False) if not follows(entry)]
    entries.sort(key=lambda entry: entry["type"] == "missing")
    return [_problem(document, entry) for entry in entries[: MOST_PROBLEMS + 1]]


def follows(entry: Any) -> bool:
    """Return whether a list is called too short only because what it holds is wrong."""
    return bool(entry["type"] == "too_short" and len(entry["input"]) >= entry["ctx"]["min_length"])


def _problem(document: Mapping[str, Any], entry: Any) -> Problem:
    path: Path = tuple(part for part in entry["loc"] if part != "[key]")
    where = place(document, path)
    if entry["type"] == "extra_forbidden":
        return Problem(
            where=where, rule=_UNKNOWN, value=repr(path[-1]), hint=_near_miss(path), path=path
        )
    if entry["type"] == "missing":
        return Problem(where=where, rule="must be given", value="nothing", path=path)
    if entry["type"] == "value_error" and isinstance(entry["input"], Mapping):
        return _disagreement(document, path, entry)
    value, key = repr(entry["input"]), str(path[-1])
    if len(value) > 80:
        value = f"{value[:77]}..."
    if entry["type"] == "string_type" and path[:1] == ("texts",):
        hint = _quoted_key(path, entry["input"])
    elif key.endswith("_v") or key == "voltages_are":
        hint = _PEAK
    elif entry["type"] in _OUT_OF_RANGE:
        hint = unit_hint(path, entry["input"], too_large=entry["type"] == "less_than_equal")
    else:
        hint = _meant_choice(entry)
    return Problem(where=where, rule=_rule(entry), value=value, hint=hint, path=path)


def _disagreement(document: Mapping[str, Any], path: Path, entry: Any) -> Problem:
    """A table whose keys do not fit together: its message says `key rule, got value`."""
    rule, _, value = _rule(entry).partition(", got ")
    key, _, of_key = rule.partition(" ")
    if key in entry["input"]:
        path, rule = (*path, key), of_key
    return Problem(where=place(document, path), rule=rule, value=value, path=path)


def _rule(entry: Any) -> str:
    if entry["type"] in _RULES:
        return _RULES[entry["type"]].format(**entry.get("ctx", {}))
    if entry["type"] != "value_error":  # pydantic's own words
        return "cannot be used here"
    rule = str(entry["ctx"]["error"])
    return rule[:1].lower() + rule[1:]


def _quoted_key(path: Path, given: Any) -> str:
    """Return a hint for a key with a point in it, which TOML reads as a table."""
    inner = next(iter(given), None) if isinstance(given, Mapping) else None
    return f'quote the key: "{path[-1]}.{inner}" = "..."' if inner else ""


def _meant_choice(entry: Any) -> str:
    """A hint that names the word that was probably meant where only some words will do."""
    if entry["type"] != "literal_error" or not isinstance(entry["input"], str):
        return ""
    words = re.findall(r"'([^']*)'", entry["ctx"]["expected"])
    close = get_close_matches(entry["input"].lower(), words, n=1)
    if close:
        return f"did you mean {close[0]!r}?"
    return "" if {"language", "languages"}.isdisjoint(entry["loc"]) else _NEW_LANGUAGE


def place(document: Mapping[str, Any], path: Path) -> str:
    """Return where `path` leads, in words: `condition voltage, touch 1, ramp_to_v`."""
    if len(path) < 2 or not isinstance(path[1], int):
        return ".".join(map(str, path)) or "file"
    words = [f"{path[0]} {_named(document, path[0], path[1])}"]
    for part in path[2:]:
        if isinstance(part, int):
            words[-1] = f"{words[-1].removesuffix('es')} {part + 1}"
        else:
            words.append(part)
    return ", ".join(words)


def _named(document: Mapping[str, Any], kind: str | int, number: int) -> str:
    item = document[str(kind)][number]
    name = item.get("name", item.get("kind")) if isinstance(item, dict) else None
    return name if isinstance(name, str) and not unprintable(name) else str(number + 1)


def _near_miss(path: Path) -> str:
    """A hint that names the key that was probably meant."""
    key, names = str(path[-1]), _keys_at(path[:-1])
    if any(mark in key.lower() for mark in ("vpp", "peak", "_pp")):
        return f"{_PEAK}; known: {', '.join(names)}"
    close = _meant(path)
    unit = unit_hint((close,)) if close and key.startswith(f"{close}_") else ""
    if unit:
        return f"did you mean {close!r}, {unit}"
    return f"did you mean {close!r}?" if close else f"known: {', '.join(names)}"


def _meant(path: Path) -> str | None:
    return next(iter(get_close_matches(str(path[-1]), _keys_at(path[:-1]), n=1)), None)


def unreadable(problem: Problem) -> Path:
    """Return the path of what a problem with the schema hides: of a misspelt key, its right one."""
    if problem.rule != _UNKNOWN:
        return problem.path
    return (*problem.path[:-1], _meant(problem.path) or problem.path[-1])


def _keys_at(path: Path) -> list[str]:
    record: type[BaseModel] = Study
    for part in path:
        fields = {field.alias or name: field for name, field in record.model_fields.items()}
        if part in fields:
            record = _record_in(fields[part].annotation) or record
    return [field.alias or name for name, field in record.model_fields.items()]


def _record_in(annotation: Any) -> type[BaseModel] | None:
    """The record that an annotation such as `tuple[Touch, ...]` contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_record_in, get_args(annotation))), None)
