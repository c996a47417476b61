"""Messages between a session and its window: one JSON object per line.

To the window: first the settings, then `{"show": id, "screen": …}`, `{"saved": id}` once the
journal has the answer, `{"progress": [number, total]}` before each trial, `{"finger": …}`
during a touch whose page shows the participant's finger, `{"press": […]}` for the keys of a
virtual participant, and `{"end": true}`: a pipe that ends without it is that of a session whose
process is gone. From the window:
`opened` or `failed` once; then `alive` periodically and when the window's `state`, which it tells,
changes; `shown` when a screen is first displayed, `answer`, `operator` when the participant
calls, `stop` for the emergency stop, and `closed`, `broken` or `unseen` (its screen is lost, or the
window left it) at an unexpected end.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any

from protocol.study.participant_texts import Wording
from protocol.study.rules import Band
from protocol.study.study_question import StudyQuestion
from runner.screens import (
    Ask,
    FingerPath,
    Instruction,
    LeadIn,
    Notice,
    Pacing,
    Screen,
    ShownSurface,
    Welcome,
)
from runner.window.elements import Input, Key, Pressed, Released, Typed

_INPUTS = {kind.__name__: kind for kind in (Pressed, Released, Key, Typed)}
_SCREENS = {kind.__name__: kind for kind in (Notice, Welcome, Instruction, LeadIn, Pacing, Ask)}


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of the window: texts, screen number (from 0) and the screens to prepare.

    `folder` has their pictures. A page is shown for `readable_s` before its button works. The font
    must have the `signs`, the characters that are drawn.
    """

    wording: Wording
    readable_s: float = 0.0
    screen: int = 0
    windowed: bool = False
    foreseen: tuple[Screen, ...] = ()
    folder: str = ""
    signs: str = ""


def line_of(message: Mapping[str, Any]) -> str:
    r"""Return `message` as a line.

    >>> line_of({"alive": 12.5})
    '{"alive": 12.5}\n'
    """
    # ASCII, so that a line ends nowhere but at its line feed, whatever a text contains.
    return json.dumps(message, ensure_ascii=True, allow_nan=False) + "\n"


def message_of(line: str) -> dict[str, Any]:
    """Return the message in `line`; raises `ValueError` if it is not a JSON object."""
    try:
        return dict(json.loads(line))
    except (TypeError, ValueError):
        raise ValueError(f"a message must be one JSON object, got {line!r}") from None


def settings_message(settings: Settings) -> dict[str, Any]:
    foreseen = [show_message(0, screen) for screen in settings.foreseen]
    return {**vars(settings), "wording": asdict(settings.wording), "foreseen": foreseen}


def settings_of(message: Mapping[str, Any]) -> Settings:
    # JSON knows lists only; the frozen records have tuples.
    wording = Wording(**{**message["wording"], "fonts": tuple(message["wording"]["fonts"])})
    foreseen = tuple(screen_of(show) for show in message["foreseen"])
    return Settings(**{**message, "wording": wording, "foreseen": foreseen})


def show_message(number: int, screen: Screen) -> dict[str, Any]:
    values = {entry.name: getattr(screen, entry.name) for entry in fields(screen)}
    if isinstance(screen, Ask):
        values["question"] = screen.question.model_dump(mode="json")
        values["bands"] = [band.model_dump(mode="json", by_alias=True) for band in screen.bands]
    elif isinstance(screen, Instruction) and screen.touch is not None:
        values["touch"] = asdict(screen.touch)
    elif isinstance(screen, FingerPath):
        values["surface"] = asdict(screen.surface)
    return {"show": number, "screen": type(screen).__name__, **values}


def screen_of(message: Mapping[str, Any]) -> Screen:
    """Return the screen in a `show` message; raises `ValueError` if there is no such kind."""
    values = {key: value for key, value in message.items() if key not in {"show", "screen"}}
    if message["screen"] not in _SCREENS:
        raise ValueError(f"a screen must be one of {', '.join(_SCREENS)}, got {message['screen']}")
    if "question" in values:
        values["question"] = StudyQuestion.model_validate(values["question"])
        values["bands"] = tuple(map(Band.model_validate, values["bands"]))
    if values.get("touch") is not None:
        values["touch"] = FingerPath(**_with_surface(values["touch"]))
    if "surface" in values:
        values = _with_surface(values)
    screen: Screen = _SCREENS[message["screen"]](**values)
    return screen


def _with_surface(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a path with its surface as a record, whose lists are tuples again."""
    surface = dict(values["surface"])
    for name in ("supports", "path_m", "path_in_picture"):
        surface[name] = _as_tuples(surface[name])
    return {**values, "surface": ShownSurface(**surface)}


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


def press_message(inputs: Iterable[Input]) -> dict[str, Any]:
    return {"press": [{"input": type(given).__name__, **vars(given)} for given in inputs]}


def inputs_of(message: Mapping[str, Any]) -> list[Input]:
    inputs: list[Input] = []
    for given in message["press"]:
        values = {key: value for key, value in given.items() if key != "input"}
        inputs.append(_INPUTS[given["input"]](**values))
    return inputs
