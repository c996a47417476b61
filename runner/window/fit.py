"""Texts that do not fit their places on the participant's screen, found without a screen."""

from collections.abc import Iterator, Mapping
from typing import get_args

from protocol.errors import BadInput
from protocol.problem import Path, Problem
from protocol.study import Language, Study
from protocol.texts import study_texts
from runner.screens import Screen
from runner.window.elements import Text
from runner.window.foreseen import foreseen
from runner.window.metrics import text_height, text_width, wrapped
from runner.window.pages import View, Wording, page

_ALL = View(operator_called=True)


def fits(text: Text) -> bool:
    """Return whether all lines of `text` stay within its room."""
    lines = wrapped(text.text, text.size, text.room.width)
    widest = max(text_width(line, text.size) for line in lines)
    return widest <= text.room.width and text_height(len(lines), text.size) <= text.room.height


def misfits(screens: tuple[Screen, ...], wording: Wording) -> Iterator[str]:
    """Yield every text on `screens` that does not fit its place, once."""
    seen = set()
    for screen in screens:
        for element in page(screen, _ALL, wording):
            if isinstance(element, Text) and element.text not in seen and not fits(element):
                seen.add(element.text)
                yield element.text


def fit_problems(study: Study) -> Iterator[Problem]:
    """Yield a problem for every text of `study`, in every language, that does not fit its place."""
    screens = foreseen(study, consent=None)
    for language in get_args(Language):
        wording = Wording(language=language, texts=study_texts(study, language))
        for text in misfits(screens, wording):
            path = _path(study, language, text)
            yield Problem(
                where=".".join(str(part) for part in path) or f"the text in {language}",
                rule="a text must fit its place on the participant's screen",
                value=repr(text),
                hint="shorten it",
                path=path,
            )


def require_fit(study: Study, language: Language, consent: str | None) -> None:
    """Refuse a session whose participant could not read everything.

    Raises:
        BadInput: a text, or the consent's reference, does not fit its place.
    """
    wording = Wording(language=language, texts=study_texts(study, language))
    for text in misfits(foreseen(study, consent), wording):
        raise BadInput(
            f"a text must fit its place on the participant's screen, got {text!r}; shorten it"
        )


def _path(study: Study, language: Language, text: str) -> Path:
    """Where in the study file `text` stands, empty if it is a built-in one."""
    own: Mapping[str, str] = study.texts.get(language, {})
    for key, value in own.items():
        if value in text:
            return ("texts", language, key)
    for number, band in enumerate(study.rating.bands):
        if getattr(band, language) == text:
            return ("rating", "bands", number, language)
    return ()
