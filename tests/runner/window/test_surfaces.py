"""How pages show each surface: a bar on its supports, a plain one, a picture, or words alone."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from device.beam.beam import Beam
from protocol.study.participant_texts import study_wording
from protocol.study.study import Study
from protocol.study_file.loading import StudyError, parsed_study, template
from protocol.study_file.text_checks import surface_problems
from runner.screens import (
    FingerPath,
    Instruction,
    LeadIn,
    OwnFinger,
    Pacing,
    ShownSurface,
    lead_in,
    pacing,
    shown_surface,
)
from runner.window.elements import CANVAS, FAINT, PALE, WHITE, Dot, Outline, Page, Picture, Text
from runner.window.messages import line_of, message_of, screen_of, show_message
from runner.window.pages import beam_ends, fingers, page, sketch
from runner.window.preflight import fit_problems, foreseen
from runner.window.question_pages import PageState
from tests.runner.study.test_pictures import png

PAPER = parsed_study(template("paper"))
TEXTS = study_wording(PAPER, "en").texts
GIVEN = {"kind": "given", "length_m": 0.12}
PICTURE = {**GIVEN, "picture": "plate.png", "path_in_picture": ((0.25, 0.5), (0.75, 0.5))}


def study_of(surface: dict[str, Any], **touch: Any) -> Study:
    """The paper's study on another surface, without a check of the whole."""
    given = Study.model_validate({**PAPER.model_dump(exclude_unset=True), "surface": surface})
    return given.model_copy(update={"touch": given.touch.model_copy(update=touch)})


def shown(supports: tuple[Any, Any] | None, **values: Any) -> ShownSurface:
    return ShownSurface(length_m=0.12, supports=supports, path_m=(0.01, 0.11), **values)


def way(surface: ShownSurface, **values: Any) -> FingerPath:
    return FingerPath(**{"start_m": 0.01, "end_m": 0.11, "surface": surface, **values})


def bar_of(elements: Page) -> tuple[float, float]:
    """The ends of the bar, which alone is filled as it is."""
    (bar,) = [each for each in elements if isinstance(each, Outline) and each.fill == PALE]
    return min(x for x, _ in bar.points), max(x for x, _ in bar.points)


def words_of(elements: Page) -> list[str]:
    return [each.text for each in elements if isinstance(each, Text)]


def test_a_study_without_a_surface_shows_the_papers_beam() -> None:
    surface, beam = shown_surface(PAPER, None), Beam()
    assert (surface.length_m, surface.supports) == (beam.length_m, beam.supports)
    assert surface.picture is None


@pytest.mark.parametrize(
    ("supports", "ends", "clamps", "triangles"),
    [
        (("clamped", "free"), (-280, 320), [-300], []),
        (("clamped", "clamped"), (-280, 280), [-300, 300], []),
        (("free", "clamped"), (-320, 280), [300], []),
        (("pinned", "pinned"), (-320, 320), [], [-320, 320]),
        (("clamped", "pinned"), (-280, 320), [-300], [320]),
        (("free", "free"), (-320, 320), [], []),
        (None, (-320, 320), [], []),
    ],
)
def test_each_end_of_a_bar_is_drawn_as_it_is_held(
    supports: Any, ends: tuple[float, float], clamps: list[float], triangles: list[float]
) -> None:
    surface = shown(supports)
    elements = sketch(way(surface), TEXTS)
    assert bar_of(elements) == beam_ends(surface) == ends
    words = [each for each in elements if isinstance(each, Text) and each.text == "clamp"]
    assert [word.box.x for word in words] == clamps
    held = [each for each in elements if isinstance(each, Outline) and each.fill == FAINT]
    boxes = [each for each in held if len(each.points) == 4]
    assert [sum(x for x, _ in box.points) / 4 for box in boxes] == clamps
    tips = [each.points[0] for each in held if len(each.points) == 3]
    assert tips == [(x, -17.0) for x in triangles]
    assert TEXTS["beam.you"] in words_of(elements)


def test_places_lie_along_the_length_of_the_surface() -> None:
    surface = shown(("free", "free"))
    assert [fingers(way(surface), part)[0].x for part in (0, 0.5, 1)] == pytest.approx(
        [-320 + 640 / 12, 0, 320 - 640 / 12]
    )


def test_several_fingers_lie_evenly_on_a_surface_that_is_shorter_than_they_are() -> None:
    surface = replace(shown(None), length_m=0.04)
    held = way(surface, start_m=0.03, end_m=0.03, several=True)
    assert [dot.x for dot in fingers(held, 0.0)] == pytest.approx([-240, -80, 80, 240])
    slid = way(surface, start_m=0.005, end_m=0.035, several=True)
    for part in (0.0, 0.5, 1.0):
        dots = fingers(slid, part)
        assert all(-320 <= dot.x <= 320 for dot in dots)
        assert [b.x - a.x for a, b in pairwise(dots)] == pytest.approx([160] * (len(dots) - 1))
    assert len(fingers(slid, 0.5)) == 4


def touched(study: Study, folder: Path | None, place: str) -> list[Any]:
    """The three pages of a touch at a place."""
    touches = [it for condition in study.condition for it in condition.touches]
    touch = next(it for it in touches if it.place == place)
    cue = pacing(touch, study.touch, surface=shown_surface(study, folder))
    return [Instruction(text=cue.text, touch=cue.touch), lead_in(cue, study.touch), cue]


def test_a_surface_without_a_picture_is_a_plain_bar(tmp_path: Path) -> None:
    study = study_of(GIVEN)
    for screen in touched(study, tmp_path, "path"):
        elements = page(screen, PageState(), study_wording(study, "en"))
        assert bar_of(elements) == (-320, 320)
        assert "clamp" not in words_of(elements)


@pytest.mark.parametrize(("size", "drawn"), [((400, 200), (424, 212)), ((720, 72), (720, 72))])
def test_marks_lie_on_the_path_in_the_picture(
    tmp_path: Path, size: tuple[int, int], drawn: tuple[float, float]
) -> None:
    Image.new("RGB", size).save(tmp_path / "plate.png")
    study = study_of(PICTURE, path_m=(0.02, 0.1), smooth_place_m=0.06)
    told, before, cue = touched(study, tmp_path, "path")
    for screen in (told, before, cue):
        elements = page(screen, PageState(), study_wording(study, "en"))
        (picture,) = [each for each in elements if isinstance(each, Picture)]
        assert (picture.name, picture.box.y) == ("plate.png", 26)
        # As the canvas fits it into its box.
        fits = min(picture.box.width / size[0], picture.box.height / size[1])
        assert (fits * size[0], fits * size[1]) == pytest.approx(drawn)
        assert TEXTS["beam.you"] not in words_of(elements)
    for part, across in ((0, -0.25), (0.5, 0), (1, 0.25)):
        rim, dot = fingers(cue, part)
        assert (rim.x, rim.y, rim.radius, rim.fill) == (dot.x, dot.y, dot.radius + 3, WHITE)
        assert (dot.x, dot.y) == pytest.approx((across * drawn[0], 26))
    _, held = fingers(touched(study, tmp_path, "smooth")[1], 0.0)
    assert (held.x, held.y) == pytest.approx((0, 26))


@pytest.mark.parametrize(
    "ends", [((0.1, 0.1), (0.9, 0.9)), ((0.5, 0.0), (0.5, 1.0)), ((0.9, 0.95), (0.1, 0.95))]
)
def test_everything_stays_on_the_canvas_wherever_the_path_lies(ends: Any) -> None:
    surface = shown(None, picture="plate.png", picture_shape=3.0, path_in_picture=ends)
    wording = study_wording(PAPER, "en")
    for start_m, end_m, several in ((0.01, 0.11, True), (0.11, 0.01, False), (0.01, 0.01, False)):
        cue = Pacing(
            start_m=start_m,
            end_m=end_m,
            several=several,
            harder=start_m == end_m,
            surface=surface,
            duration_s=1.0,
            force_n=0.5,
            direction="right",
        )
        finger = OwnFinger(position_m=9.0, force=1.0, within=0.5)
        elements = page(cue, PageState(passed_s=0.4, finger=finger), wording)
        points = [at for each in elements if isinstance(each, Outline) for at in each.points]
        points += [(each.x, each.y) for each in elements if isinstance(each, Dot)]
        assert all(abs(x) <= CANVAS[0] / 2 and abs(y) <= CANVAS[1] / 2 for x, y in points)
        # Below the words of the instruction and above those of the moment.
        on_it = [dot for dot in elements if isinstance(dot, Dot) and dot.y > -190]
        assert on_it
        assert all(-80 <= dot.y <= 132 for dot in on_it)


@pytest.mark.parametrize("surface", [{**GIVEN, "picture": "none"}, {**GIVEN, "picture": "a.png"}])
@pytest.mark.parametrize("place", ["path", "smooth"])
def test_without_marks_the_words_speak_of_none(
    tmp_path: Path, surface: dict[str, Any], place: str
) -> None:
    Image.new("RGB", (300, 200)).save(tmp_path / "a.png")
    study = study_of(surface)
    for code in ("en", "zh"):
        wording = study_wording(study, code)
        for screen in touched(study, tmp_path, place):
            finger = OwnFinger(position_m=0.05, force=1.0, within=0.5)
            elements = page(screen, PageState(), wording)
            assert not any(isinstance(each, Dot) for each in elements)
            pictures = [each.name for each in elements if isinstance(each, Picture)]
            assert pictures == ([] if surface["picture"] == "none" else ["a.png"])
            assert not [w for w in words_of(elements) if "mark" in w or "标记" in w]
            if isinstance(screen, LeadIn):
                assert "3" in words_of(elements)
            if isinstance(screen, Pacing):
                assert wording.texts["touch.now"] in words_of(elements)
                felt = page(screen, PageState(finger=finger), wording)
                assert len([each for each in felt if isinstance(each, Dot)]) == 1, "its force"


def test_a_text_of_the_studys_own_also_stands_where_nothing_is_marked() -> None:
    text = template("paper") + '\n[texts.en]\n"touch.smooth" = "Touch the dimple."\n'
    texts = study_wording(parsed_study(text), "en").texts
    assert shown(None, picture="none").text("touch.smooth", texts) == "Touch the dimple."
    assert shown(None).text("touch.smooth", texts) == "Touch the dimple."


@pytest.mark.parametrize("surface", [GIVEN, {**GIVEN, "picture": "none"}, PICTURE])
def test_texts_of_each_surface_fit_and_its_pages_reach_the_window(
    tmp_path: Path, surface: dict[str, Any]
) -> None:
    Image.new("RGB", (300, 200)).save(tmp_path / "plate.png")
    study = study_of(surface)
    assert list(fit_problems(study)) == []
    screens = foreseen(study, None, tmp_path)
    assert [screen_of(message_of(line_of(show_message(1, it)))) for it in screens] == [*screens]
    paths = [it.touch for it in screens if isinstance(it, Instruction) and it.touch]
    assert {path.surface.length_m for path in paths} == {0.12}


def test_a_place_beside_the_picture_is_refused() -> None:
    study = study_of(PICTURE, path_m=(0.05, 0.06), smooth_place_m=0.09)
    study = study.model_copy(update={"pictures": {"plate.png": "0" * 64}})
    said = [str(problem) for problem in surface_problems(study)]
    assert [line for line in said if "smooth_place_m" in line and "picture" in line] == [
        "touch.smooth_place_m: must lie in the picture, on the line of surface.path_in_picture, "
        "got 0.09"
    ]


def test_a_path_without_a_length_in_the_picture_is_refused() -> None:
    lines = 'kind = "given"\nlength_m = 0.12\npicture = "plate.png"\n'
    text = f"{template('paper')}\n[surface]\n{lines}path_in_picture = [[0.5, 0.5], [0.5, 0.5]]\n"
    with pytest.raises(StudyError, match="path_in_picture: must have two ends"):
        parsed_study(text)


def test_a_study_of_a_surface_names_a_picture_that_is_there(tmp_path: Path) -> None:
    (tmp_path / "plate.png").write_bytes(png())
    assert shown_surface(study_of(PICTURE), tmp_path).picture_shape > 0
    (problem,) = [it for it in surface_problems(study_of(PICTURE)) if it.where == "surface.picture"]
    assert "plate.png" in problem.value
