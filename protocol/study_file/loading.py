"""From the text of a study file to a checked study, with everything that is wrong at once.

What finds and tells mistakes is loaded when there are any.
"""

from collections.abc import Callable, Iterable, Mapping
from hashlib import sha256
from importlib.resources import files
from types import MappingProxyType

from pydantic import ValidationError

from protocol.errors import BadInput, Problem
from protocol.study.fields import Names
from protocol.study.languages import built_in_codes
from protocol.study.study import Study
from protocol.study_file.language_files import located, whole_document
from protocol.study_file.limits import problems

TEMPLATES = ("paper", "extended")
Further = Callable[[Study], Iterable[Problem]]


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


def parsed_study(
    text: str,
    source: str = "study.toml",
    further: Further = lambda _: (),
    dialects: Mapping[str, Names] = MappingProxyType({}),
) -> Study:
    """Return the study that `text` describes.

    Args:
        text: a study file in TOML.
        source: what to call it in messages.
        further: finds what else is wrong with the study, where more is known than its file says.
        dialects: what devices and gauges there are speak, by kind; without a kind any name will do.

    Raises:
        StudyError: the text is no TOML, breaks the schema, asks for more than the rig allows or
            for what cannot be met.
    """
    document = whole_document(text)
    if isinstance(document, Problem):
        raise StudyError(source, [document])
    own = document.get("languages")
    codes = own if isinstance(own, dict) else {}
    known: dict[str, Names] = {
        "languages": lambda: dict.fromkeys([*built_in_codes(), *codes]),
        **dialects,
    }
    try:
        study = Study.model_validate(document, context=known)
    except ValidationError as error:
        from protocol.study_file.recovery import semantic_problems

        found = semantic_problems(document, error, further, known)
        raise StudyError(source, located(text, found)) from error
    if found := problems(study, further(study)):
        raise StudyError(source, located(text, found))
    return study


def text_digest(text: str) -> str:
    """Return the digest that identifies a study file."""
    return sha256(text.encode()).hexdigest()
