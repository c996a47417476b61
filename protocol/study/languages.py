"""The languages that participants read, one file each: texts, fonts and names of score bands.

The built-in ones stand in `protocol/languages`. A study's own come with the study.
"""

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Annotated

from pydantic import AfterValidator, Field

from protocol.study.fields import Line, Name, Record, known_as, require_printable, setting

REFERENCE = "en"
"""The language whose texts say which keys there are, and with which fields in braces."""
FIRST = frozenset({
    "welcome", "consent", "ready", "practice", "break", "remember", "thanks", "wait", "pause",
    "touch.smooth", "touch.smooth.harder", "touch.right", "touch.left", "touch.full",
    "touch.full.harder", "touch.full.right", "touch.full.left", "touch.now", "touch.end",
    "question.roughness", "question.strength", "question.places", "score", "answer.smoother",
    "answer.rougher", "answer.stronger", "answer.weaker", "answer.same", "answer.swapped",
    "answer.not swapped", "button.ready", "button.confirm", "button.close", "button.skip",
    "hint.start", "hint.change", "hint.score", "hint.several", "hint.analogue", "hint.typed",
    "operator.called",
})  # fmt: skip
"""Keys of the first language files, which every one must have. No key is ever added here: a study's
own file would be refused that was complete when it was written."""
_OLDER: Mapping[str, str] = {
    "stopped": "touch.end",
    "hint.change.two": "hint.change",
    "touch.soon": "wait",
    "touch.soon.full": "wait",
    # Where nothing is marked; an older text may speak of a mark, that of waiting does not.
    "touch.smooth.unmarked": "touch.smooth",
    "touch.smooth.harder.unmarked": "touch.smooth.harder",
    "touch.soon.unmarked": "wait",
    "touch.soon.full.unmarked": "wait",
    "wait.beam": "wait",
    "wait.touch": "wait",
}
FOLDER: Traversable = files("protocol") / "languages"
CODE = r"[a-z]{2,3}(-[A-Za-z0-9]{2,8})*"

Code = Annotated[str, Field(pattern=f"^{CODE}$")]
"""Of a language, as in BCP 47: `fr`, `pt-BR`."""
KnownCode = Annotated[str, known_as("languages")]
_Shown = Annotated[Line, AfterValidator(require_printable)]


class Language(Record):
    """What participants read in one language, as its file has it."""

    name: Annotated[_Shown, Field(description="in English, for exported data")]
    fonts: tuple[_Shown, ...] = Field(min_length=1)
    """families that show it; the first one there is taken"""
    font_package: _Shown | None = setting(None, "what brings the first font on Debian and Ubuntu")
    letters: Annotated[
        str,
        Field(max_length=36, pattern=r"^\w*$"),
        AfterValidator(require_printable),
        Field(description="letters that the keyboard on the screen shows beside those from a to z"),
    ] = ""
    bands: dict[Name, Line] = Field(default_factory=dict)
    """names of score bands, by their English names, where `[rating]` gives none"""
    texts: Annotated[dict[Name, Line], Field(description="all texts, by the built-in keys")]


@cache
def built_in_codes() -> tuple[str, ...]:
    """Return the codes of the languages that every study has."""
    names = (entry.name for entry in FOLDER.iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in names if name.endswith(".toml")))


@cache
def built_in(code: str) -> Language:
    """Return one of the languages that every study has."""
    # The encoding is named, because on some systems the usual one is not UTF-8.
    text = (FOLDER / f"{code}.toml").read_text(encoding="utf-8")
    return Language.model_validate(tomllib.loads(text))


def reference_texts() -> dict[str, str]:
    """Return every key with its text in the language of reference."""
    return built_in(REFERENCE).texts


@cache
def later_texts() -> dict[str, str]:
    """Return the keys that a study's own language may lack, because they came after the first ones.

    Each with the older text that stands in for it; without one it is the text of the reference.
    """
    return {key: _OLDER.get(key, "") for key in reference_texts() if key not in FIRST}
