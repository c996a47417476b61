"""From the text of a study file to a checked study, with everything that is wrong at once."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from importlib.resources import files
from typing import Any

from pydantic import ValidationError

from protocol.errors import BadInput
from protocol.impossible import design_problems
from protocol.limits import limit_problems, problems
from protocol.problem import Path, Problem
from protocol.salvage import salvaged
from protocol.schema_problems import schema_problems, unreadable
from protocol.study import Study
from protocol.toml_lines import key_lines, line_of
from protocol.toml_reading import toml_document

TEMPLATES = ("paper", "extended")
Further = Callable[[Study], Iterable[Problem]]
_OF_THE_DESIGN = frozenset({"touch", "beams", "design", "timing", "opening", "condition"})
"""What the wishes of a design are counted from."""


class StudyError(BadInput):
    """A study file that cannot be used; `problems` lists why, in the order of the file."""

    def __init__(self, source: str, found: list[Problem]) -> None:
        self.source = source
        self.problems = found
        more = f" (and {len(found) - 1} more: touchbeam check)" if len(found) > 1 else ""
        super().__init__(f"{found[0].located(source)}{more}")


def template(name: str) -> str:
    """Return the text of the built-in study `name`, one of `TEMPLATES`.

    Raises:
        ValueError: there is no such template.
    """
    if name not in TEMPLATES:
        raise ValueError(f"the template must be one of {', '.join(TEMPLATES)}, got {name!r}")
    return (files("protocol") / "templates" / f"{name}.toml").read_text(encoding="utf-8")


def template_tests() -> str:
    """Return the text of the test file that every new study gets."""
    return (files("protocol") / "templates" / "test_study.py.txt").read_text(encoding="utf-8")


def parsed_study(text: str, source: str = "study.toml", further: Further = lambda _: ()) -> Study:
    """Return the study that `text` describes.

    Args:
        text: a study file in TOML.
        source: what to call it in messages.
        further: finds what else is wrong with the study, where more is known than its file says.

    Raises:
        StudyError: the text is no TOML, breaks the schema, asks for more than the rig allows or
            for what cannot be met.
    """
    document = toml_document(text)
    if isinstance(document, Problem):
        raise StudyError(source, located(text, [document]) if document.path else [document])
    try:
        study = Study.model_validate(document)
    except ValidationError as error:
        broken = schema_problems(document, error)
        raise StudyError(
            source, located(text, broken + _limits_broken(document, broken, further))
        ) from error
    if found := problems(study, further(study)):
        raise StudyError(source, located(text, found))
    return study


def _limits_broken(
    document: dict[str, Any], broken: list[Problem], further: Further
) -> list[Problem]:
    """What else is wrong in the part of the document that fits the schema.

    What follows from nothing but the harmless values in the place of broken ones is left out.
    """
    study = salvaged(document)
    if study is None:
        return []
    unknown = [unreadable(problem) for problem in broken]
    found = [*limit_problems(study), *further(study)]
    if not found and _OF_THE_DESIGN.isdisjoint(path[0] for path in unknown if path):
        found = design_problems(study)
    return [problem for problem in found if not _rests_on(problem.path, unknown)]


def _rests_on(path: Path, unknown: list[Path]) -> bool:
    """Whether one of the unknown values lies at `path`, above it or below it."""
    return any(path[: len(other)] == other[: len(path)] for other in unknown)


def located(text: str, found: list[Problem]) -> list[Problem]:
    """Return the problems with their lines in the study file `text`, in its order."""
    lines = key_lines(text)
    located = [replace(problem, line=line_of(lines, problem.path)) for problem in found]
    return sorted(located, key=lambda problem: problem.line or 0)
