"""From the text of a study file to a checked study, with everything that is wrong at once."""

import tomllib
from difflib import get_close_matches
from importlib.resources import files
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from protocol.errors import BadInput
from protocol.limits import Problem, problems
from protocol.study import Study

TEMPLATES = ("paper",)


class StudyError(BadInput):
    """A study file that cannot be used; `problems` lists why."""

    def __init__(self, source: str, found: list[Problem]) -> None:
        self.source = source
        self.problems = found
        more = f" (and {len(found) - 1} more: touchbeam check)" if len(found) > 1 else ""
        super().__init__(f"{source}: {found[0]}{more}")


def template(name: str) -> str:
    """Return the text of the built-in study `name`, one of `TEMPLATES`."""
    return (files("protocol") / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def parsed_study(text: str, source: str = "study.toml") -> Study:
    """Return the study that `text` describes.

    Args:
        text: a study file in TOML.
        source: what to call it in messages.

    Raises:
        StudyError: the text is no TOML, breaks the schema, or asks for more than the rig allows.
    """
    try:
        study = Study.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise StudyError(
            source,
            [Problem(where="file", rule="must be TOML", value=str(error), hint="mend the line")],
        ) from error
    except ValidationError as error:
        raise StudyError(source, [_problem(entry) for entry in error.errors()]) from error
    if found := problems(study):
        raise StudyError(source, found)
    return study


def _problem(entry: Any) -> Problem:
    """One of pydantic's errors in our words."""
    where = ".".join(str(part) for part in entry["loc"]) or "file"
    if entry["type"] == "extra_forbidden":
        return Problem(
            where=where,
            rule="unknown key",
            value=repr(entry["loc"][-1]),
            hint=_near_miss(entry["loc"]),
        )
    if entry["type"] == "missing":
        return Problem(where=where, rule="must be given", value="nothing")
    rule = entry["msg"].removeprefix("Value error, ")
    return Problem(where=where, rule=rule[0].lower() + rule[1:], value=repr(entry["input"])[:80])


def _near_miss(location: tuple[int | str, ...]) -> str:
    """A hint that names the key that was probably meant."""
    names = _keys_at(location[:-1])
    close = get_close_matches(str(location[-1]), names, n=1)
    return f"did you mean {close[0]!r}?" if close else f"known: {', '.join(names)}"


def _keys_at(location: tuple[int | str, ...]) -> list[str]:
    record: type[BaseModel] = Study
    for part in location:
        if isinstance(part, str):
            record = _record_in(record.model_fields[part].annotation)
    return [field.alias or name for name, field in record.model_fields.items()]


def _record_in(annotation: Any) -> type[BaseModel]:
    """The record type that an annotation such as `tuple[Touch, ...]` contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(_record_in(part) for part in get_args(annotation) if part is not ...)
