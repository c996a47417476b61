"""Problems in the sound part of a study file that breaks the schema.

Without it a misspelt key would hide a 201 V programme until the key is mended.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import deepcopy
from typing import Any

from pydantic import ValidationError

from protocol.errors import MOST_PROBLEMS, Path, Problem
from protocol.plan.feasibility import design_problems
from protocol.study.fields import Names
from protocol.study.study import Study
from protocol.study_file.limits import limit_problems
from protocol.study_file.schema_errors import follows, schema_problems, unreadable

_TOUCH = {"place": "smooth", "voltage_v": 0}
_ASKED = {"question": "roughness", "expected": "smoother"}
_NAMED = {"beams": (2, 0.0), "texts": (3, "text")}
"""How deep a name stands, and what may stand beside it: a touch that names it still finds it."""
_OF_TABLES = ("opening", "condition", "touches")
"""Lists that keep their length, so that what is found later is still found at its place."""
_OF_THE_DESIGN = frozenset({"touch", "beams", "design", "timing", "opening", "condition"})
"""What the wishes of a design are counted from."""
_ROUNDS = 8


def semantic_problems(
    document: dict[str, Any],
    error: ValidationError,
    further: Callable[[Study], Iterable[Problem]],
    known: Mapping[str, Names],
) -> list[Problem]:
    """Return what breaks the schema, and what else is wrong in the rest of the document.

    Problems that only the harmless values in the place of broken ones cause are dropped. `further`
    finds what else is wrong with a study; `known` are the names to choose from, by kind.
    """
    broken = schema_problems(document, error)
    if len(broken) > MOST_PROBLEMS or (study := recovered(document, known)) is None:
        return broken
    unknown = [unreadable(problem) for problem in broken]
    found = [*limit_problems(study), *further(study)]
    if not found and _OF_THE_DESIGN.isdisjoint(path[0] for path in unknown if path):
        found = design_problems(study)

    def is_known(path: Path) -> bool:
        """Whether no unknown value lies at `path`, above it or below it."""
        return all(path[: len(other)] != other[: len(path)] for other in unknown)

    return broken + [problem for problem in found if is_known(problem.path)]


def recovered(document: dict[str, Any], known: Mapping[str, Names]) -> Study | None:
    """Return the study that is left when what breaks the schema is replaced by something harmless.

    `None` if nothing can be made of the document. `known` are the names to choose from, by kind.
    """
    sound = deepcopy(document)
    for _ in range(_ROUNDS):
        try:
            return Study.model_validate(sound, context=known)
        except ValidationError as error:
            for entry in error.errors(include_url=False):
                if not follows(entry):
                    _drop(sound, entry["loc"], is_missing=entry["type"] == "missing")
            _fill(sound)
    return None


def _drop(document: dict[str, Any], place: Path, *, is_missing: bool) -> None:
    """Take away the innermost part of the document that is wrong, or lacks what is missing."""
    path = tuple(part for part in place if part != "[key]")
    steps = list(_steps(document, path))
    if len(steps) < len(path) - is_missing:
        return  # what holds it has been taken away
    depth, harmless = _NAMED.get(str(path[0]), (0, None))
    if len(path) == depth and "[key]" not in place:
        steps[-1][0][path[-1]] = harmless
        return
    for length in range(len(steps), 0, -1):
        holder, part = steps[length - 1]
        if isinstance(holder, dict):
            del holder[part]
            return
        if path[length - 2] in _OF_TABLES:
            if not is_missing:
                own = holder[part] if isinstance(holder[part], dict) else {}
                holder[part] = {key: value for key, value in own.items() if key not in _ASKED}
            return


def _steps(document: dict[str, Any], path: Path) -> Iterator[tuple[Any, Any]]:
    """What holds each part of `path`, and the part, as far as the document has it."""
    holder: Any = document
    for part in path:
        try:
            inner = holder[part]
        except (KeyError, IndexError, TypeError):
            return
        yield holder, part
        holder = inner


def _fill(document: dict[str, Any]) -> None:
    """Give what a study, an item and a touch cannot do without."""
    document.setdefault("study", {"name": "unnamed"})
    document.setdefault("condition", [{}])
    for kind in ("opening", "condition"):
        for number, item in enumerate(document.get(kind, ())):
            touches = item.setdefault("touches", [{}])
            for touch in touches:
                touch.update(_TOUCH | touch)
            driven = any(touch["voltage_v"] or touch.get("ramp_to_v") for touch in touches)
            wanted = {"name": f"condition {number + 1}", **_ASKED}
            if kind == "opening":
                wanted = {"kind": "signal" if driven else "baseline"}
            item.update(wanted | item)
