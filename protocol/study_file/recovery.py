"""What is sound in a study file that breaks the schema, so that its limits are checked as well.

Without it a misspelt key would hide a 201 V programme until the key is mended.
"""

from collections.abc import Callable, Iterable
from copy import deepcopy
from typing import Any

from pydantic import ValidationError

from protocol.errors import Path, Problem
from protocol.plan.feasibility import design_problems
from protocol.study.study import Study
from protocol.study_file.limits import limit_problems
from protocol.study_file.schema_errors import follows, schema_problems, unreadable

_TOUCH = {"place": "smooth", "voltage_v": 0}
_ITEM = {"touches": [_TOUCH]}
_ASKED = {"question": "roughness", "expected": "smoother"}
_NAMED = {"beams": (2, 0.0), "texts": (3, "text")}
"""How deep a name stands, and what may stand beside it."""
_ROUNDS = 8


def recovered(document: dict[str, Any]) -> Study | None:
    """Return the study that is left when what breaks the schema is replaced by something harmless.

    Lists keep their length, so that what is found later is still found at its place. `None` if
    nothing can be made of the document.
    """
    sound = deepcopy(document)
    for _ in range(_ROUNDS):
        try:
            return Study.model_validate(sound)
        except ValidationError as error:
            found = error.errors(include_url=False)
            _mend(sound, [entry["loc"] for entry in found if not follows(entry)])
    return None


def _mend(document: dict[str, Any], places: Iterable[Path]) -> None:
    gone: list[Path] = []
    for place in places:
        path = tuple(part for part in place if part != "[key]")
        if any(path[: len(above)] == above for above in gone):
            continue
        if "[key]" not in place and _replaced_named(document, path):
            continue
        if not _replaced_item(document, path):
            gone.append(_drop(document, path))


def _replaced_named(document: dict[str, Any], path: Path) -> bool:
    """Keep the name of a beam or text that is wrong: the touches that name it still find it."""
    depth, harmless = _NAMED.get(str(path[0]), (0, None))
    holder = _holder(document, path)
    if len(path) != depth or not isinstance(holder, dict):
        return False
    holder[path[-1]] = harmless
    return True


def _replaced_item(document: dict[str, Any], path: Path) -> bool:
    """Mend a touch, opening or condition as a whole if `path` is one, or lacks something."""
    kind, *rest = path
    if kind not in ("opening", "condition") or not rest or not isinstance(rest[0], int):
        return False
    items, number = document.get(str(kind)), rest[0]
    if not isinstance(items, list) or number >= len(items):
        return False
    if not isinstance(items[number], dict) or len(rest) == 1:
        items[number] = _harmless(str(kind), number, items[number])
        return True
    return _mended_part(items[number], rest[1:], _harmless(str(kind), number, items[number]))


def _mended_part(item: dict[str, Any], rest: list[str | int], harmless: dict[str, Any]) -> bool:
    field = str(rest[0])
    if len(rest) == 1:
        return _given(item, field, harmless)
    if field != "touches":
        return False
    touch = item["touches"][rest[1]]
    if isinstance(touch, dict) and len(rest) > 2:
        return _given(touch, str(rest[2]), _TOUCH)
    item["touches"][rest[1]] = dict(_TOUCH)
    return True


def _given(holder: dict[str, Any], field: str, harmless: dict[str, Any]) -> bool:
    """Give what is missing a harmless value; whether it was missing and has one."""
    if field in holder or field not in harmless:
        return False
    holder[field] = harmless[field]
    return True


def _harmless(kind: str, number: int, item: Any) -> dict[str, Any]:
    own = item if isinstance(item, dict) else {}
    kept = {key: value for key, value in own.items() if key not in _ASKED}
    if kind == "opening":
        return deepcopy({"kind": _fitting_kind(own), **_ITEM, **kept})
    return deepcopy({"name": f"condition {number + 1}", **_ITEM, **kept, **_ASKED})


def _fitting_kind(opening: dict[str, Any]) -> str:
    touches = opening.get("touches")
    driven = any(
        isinstance(touch, dict) and (touch.get("voltage_v") or touch.get("ramp_to_v"))
        for touch in (touches if isinstance(touches, list) else ())
    )
    return "signal" if driven else "baseline"


def _drop(document: dict[str, Any], path: Path) -> Path:
    """Take away the innermost key on `path`, and give what a study cannot do without.

    Returns the path of what has been taken away.
    """
    length = 0
    for length in range(len(path), 0, -1):
        holder = _holder(document, path[:length])
        if isinstance(holder, dict) and path[length - 1] in holder:
            del holder[path[length - 1]]
            break
    document.setdefault("study", {"name": "unnamed"})
    document.setdefault("condition", [_harmless("condition", 0, {})])
    return path[:length]


def _holder(document: dict[str, Any], path: Path) -> Any:
    """What directly contains the last key of `path`; `None` if the way there is broken."""
    holder: Any = document
    for part in path[:-1]:
        try:
            holder = holder[part]
        except (KeyError, IndexError, TypeError):
            return None
    return holder


_OF_THE_DESIGN = frozenset({"touch", "beams", "design", "timing", "opening", "condition"})
"""What the wishes of a design are counted from."""


def semantic_problems(
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
    study = recovered(document)
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
