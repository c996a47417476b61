"""Everything that is wrong with a study file which breaks the schema, at once."""

from collections.abc import Callable, Iterable
from typing import Any

from pydantic import ValidationError

from protocol.impossible import design_problems
from protocol.limits import limit_problems
from protocol.problem import Path, Problem
from protocol.salvage import salvaged
from protocol.schema_problems import schema_problems, unreadable
from protocol.study import Study

_OF_THE_DESIGN = frozenset({"touch", "beams", "design", "timing", "opening", "condition"})
"""What the wishes of a design are counted from."""


def mistakes(
    document: dict[str, Any],
    error: ValidationError,
    further: Callable[[Study], Iterable[Problem]],
) -> list[Problem]:
    """Return what breaks the schema, and what else is wrong in the rest of the document.

    Args:
        document: the study file's content.
        error: what the schema says of it.
        further: finds what else is wrong with a study, where more is known than its file says.
    """
    broken = schema_problems(document, error)
    return broken + _else_wrong(document, broken, further)


def _else_wrong(
    document: dict[str, Any], broken: list[Problem], further: Callable[[Study], Iterable[Problem]]
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
