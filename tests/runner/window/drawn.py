"""Draws every page in a real window, measures each line and, given a folder, saves pictures.

    python -m tests.runner.window.drawn en [FOLDER]

prints how many lines were drawn and which of them are wider than was estimated.
"""

import json
import os
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from PIL import Image, ImageGrab

from protocol.study.participant_texts import Wording, study_wording
from protocol.study.rules import Rating
from protocol.study.study import Study
from protocol.study.touch import Touch
from protocol.study_file.loading import parsed_study, template
from runner.screens import (
    Ask,
    Instruction,
    Notice,
    OwnFinger,
    Screen,
    Welcome,
    ask_change,
    ask_rating,
    ask_score,
    ask_track,
    lead_in,
    pacing,
)
from runner.window.canvas import PsychopyCanvas
from runner.window.elements import Text, text_width, wrapped
from runner.window.messages import Settings
from runner.window.pages import page
from runner.window.preflight import foreseen
from runner.window.question_pages import PageState
from tests.protocol.studies import OWN_QUESTIONS, TRACKS

Shown = tuple[str, Screen, PageState]


def _named(touch: Touch) -> str:
    if touch.place == "path":
        return touch.direction
    return "harder" if touch.press > 1 else "place"


CHOSEN = {
    "choice": "right",
    "several": "vibration;sticking",
    "scale": "5",
    "analogue": "61.8",
    "number": "31",
    "text": "a bit rough",
}


def own_questions() -> list[Shown]:
    """A question of each kind, answered."""
    study = parsed_study(template("paper") + OWN_QUESTIONS)
    return [
        (
            f"question-{question.kind}",
            Ask(question=question),
            PageState(chosen=CHOSEN[question.kind], typed=CHOSEN[question.kind]),
        )
        for question in study.question
    ]


def pictures(study: Study) -> list[Shown]:
    """One example of each screen, named for a file."""
    touches = {_named(touch): touch for condition in study.condition for touch in condition.touches}
    ways = {name: pacing(touch, study.touch) for name, touch in touches.items()}
    texts = {"right": "touch.right", "left": "touch.left"}
    texts |= {"place": "touch.smooth", "harder": "touch.smooth.harder"}
    score = ask_score(study.rating)
    called = PageState(chosen="7", operator_called=True, progress=(3, 7))
    trial = PageState(progress=(3, 7))
    return [
        ("wait", Notice(text="wait"), PageState()),
        ("welcome", Welcome(consent="C-2026-07"), PageState()),
        *(
            (f"instruction-{name}", Instruction(text=texts[name], touch=way.touch), trial)
            for name, way in ways.items()
        ),
        ("lead-in-left", lead_in(ways["left"], study.touch), replace(trial, passed_s=1.5)),
        ("lead-in-place", lead_in(ways["place"], study.touch), trial),
        ("pacing-right", ways["right"], replace(trial, passed_s=0.6)),
        ("pacing-left", ways["left"], replace(trial, passed_s=0.6)),
        (
            "feedback",
            ways["right"],
            replace(trial, passed_s=0.6, finger=OwnFinger(position_m=0.03, force=1.3, within=0.5)),
        ),
        ("lift", Notice(text="touch.end"), trial),
        ("remember", Instruction(text="remember"), PageState(progress=(1, 7))),
        ("change", ask_change("roughness"), trial),
        ("change-chosen", ask_change("places"), replace(trial, chosen="swapped")),
        ("score", score, trial),
        ("score-chosen", score, called),
        *own_questions(),
        ("interval-lead-in", lead_in(replace(ways["place"], interval=2), study.touch), trial),
        ("interval-question", ask_track("smoother", 2), replace(trial, chosen="second")),
        ("saved", score, PageState(chosen="7", button="saved", progress=(3, 7))),
        ("next-beam", Notice(text="wait.beam"), trial),
        ("next-touch", Notice(text="wait.touch"), trial),
        ("pause", Notice(text="pause"), trial),
        (
            "break",
            Instruction(text="break", after_s=60),
            replace(trial, passed_s=18, button="early"),
        ),
        ("thanks", Notice(text="thanks"), PageState()),
        ("stopped", Notice(text="stopped"), PageState()),
    ]


def too_wide(canvas: PsychopyCanvas, screen: Screen, wording: Wording) -> list[dict[str, Any]]:
    """Return the lines that are drawn wider than estimated."""
    found = []
    px_per_unit = canvas.look()["px_per_unit"]
    for text in page(screen, PageState(operator_called=True, progress=(99, 99)), wording):
        if isinstance(text, Text):
            lines = wrapped(text.text, text.size, text.box.width)
            for line, drawn in zip(lines, canvas.stimuli(text), strict=True):
                estimate = text_width(line, text.size) * px_per_unit
                if drawn.boundingBox[0] > estimate:
                    found.append({"line": line, "drawn": drawn.boundingBox[0], "taken": estimate})
    return found


def keep(picture: Image.Image, path: Path) -> None:
    """Write a picture of flat colours in few bytes."""
    colours = picture.convert("RGB").quantize(24, dither=Image.Dither.NONE)
    colours.save(path, optimize=True)


def main(language: str, folder: Path | None) -> None:
    """Draw, measure, and keep: all pages of a small screen, the fullest one of a large one."""
    study = parsed_study(template("paper"))
    wording = study_wording(study, language)
    canvas = PsychopyCanvas(Settings(wording=wording))
    screens = (
        *foreseen(parsed_study(template("extended") + OWN_QUESTIONS), consent="C-7"),
        *foreseen(parsed_study(TRACKS), consent=None),
        ask_score(Rating(minimum=0, maximum=100)),
    )
    wide = [line for screen in screens for line in too_wide(canvas, screen, wording)]
    plate = parsed_study(re.sub("(?m)^(path_in_)?picture *=.*$", "", template("plate")))
    rated, of_plate = ask_rating(plate.rating), study_wording(plate, language)
    wide += too_wide(canvas, rated, of_plate)
    shown = [(*each, wording) for each in pictures(study)]
    shown.append(("rating", rated, PageState(chosen="5", progress=(3, 22)), of_plate))
    for name, screen, view, words in shown if folder else []:
        canvas.draw(page(screen, view, words))
        canvas.flip()
        picture = ImageGrab.grab(xdisplay=os.environ["DISPLAY"])
        assert folder is not None
        if picture.width > 800 and name != "score-chosen":
            continue
        keep(picture, folder / f"{name}-{language}-{picture.width}.png")
    canvas.close()
    imported = [name for name in sys.modules if name.startswith("scipy.interpolate.")]
    print(json.dumps({"screens": len(screens) + 1, "too_wide": wide, "needless": imported}))


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]) if len(sys.argv) > 2 else None)
