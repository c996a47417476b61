"""Pages: what they show, what they hide, and that every text fits."""

from dataclasses import replace
from itertools import combinations, pairwise, product
from typing import Literal, get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from protocol.errors import BadInput
from protocol.study.languages import FOLDER, built_in, built_in_codes
from protocol.study.participant_texts import Wording, study_wording, touch_text, worded_as_built
from protocol.study.rules import Band, Finger, Hand, Rating
from protocol.study.study import Study
from protocol.study.study_question import StudyQuestion, score_question
from protocol.study.touch import Direction, Touch, TouchDefaults
from protocol.study_file.loading import (
    TEMPLATES,
    parsed_study,
    template,
    template_pictures,
    with_digests,
    with_languages,
)
from runner.screens import (
    FingerPath,
    Instruction,
    Notice,
    OwnFinger,
    Pacing,
    ask_change,
    ask_score,
    lead_in,
    pacing,
)
from runner.window.elements import CANVAS, Dot, Outline, Text
from runner.window.messages import Settings
from runner.window.pages import fingers, page, targets
from runner.window.preflight import fit_problems, foreseen, study_window
from runner.window.question_pages import (
    SCALE_BOX,
    PageState,
    labelled,
    look,
    marked,
    nearest,
    score_x,
)
from tests.protocol.studies import TRACKS

PAPER = parsed_study(template("paper"))
RIGHT = Pacing(start_m=0.01, end_m=0.081, duration_s=1.775, force_n=0.5, direction="right")


def beam_x(place_m: float) -> float:
    """Where a place of the paper's beam lies across the canvas."""
    return -280 + 600 * place_m / 0.1


def wording(code: str) -> Wording:
    return study_wording(PAPER, code)


def study(**texts: str) -> Study:
    lines = "\n".join(f'"{key}" = "{value}"' for key, value in texts.items())
    return parsed_study(template("paper") + f"\n[texts.en]\n{lines}\n")


@pytest.mark.parametrize("name", TEMPLATES)
def test_every_text_of_the_built_in_studies_fits(name: str) -> None:
    digests = dict.fromkeys(template_pictures(name), "0" * 64)
    text = with_digests(template(name), "pictures", digests) if digests else template(name)
    assert list(fit_problems(parsed_study(text))) == []


@pytest.mark.parametrize("ticks", ["all", "bands", "ends"])
@pytest.mark.parametrize("bands", [(), PAPER.rating.bands])
def test_every_built_in_text_fits_whatever_is_touched(
    ticks: Literal["all", "bands", "ends"], bands: tuple[Band, ...]
) -> None:
    plain = parsed_study(template("paper"))
    first = plain.condition[0]
    touches = tuple(
        Touch(place=place, voltage_v=0, direction=direction, coverage=coverage, press=press)
        for place in get_args(Touch.model_fields["place"].annotation)
        for direction in get_args(Touch.model_fields["direction"].annotation)
        for coverage in get_args(Touch.model_fields["coverage"].annotation)
        for press in (1.0, 1.5)
    )
    every = plain.model_copy(
        update={
            "condition": (first.model_copy(update={"touches": touches}), *plain.condition[1:]),
            "rating": Rating(ticks=ticks, bands=bands),
        }
    )
    assert worded_as_built(every)
    assert list(fit_problems(every)) == []


@pytest.mark.parametrize("hand", get_args(Hand))
@pytest.mark.parametrize("finger", get_args(Finger))
def test_the_texts_name_the_hand_and_finger_of_the_study(hand: Hand, finger: Finger) -> None:
    lines = f'[session]\nhand = "{hand}"\nfinger = "{finger}"\n'
    study = parsed_study(template("paper") + lines)
    assert list(fit_problems(study)) == []
    for code in built_in_codes():
        texts, plain = study_wording(study, code).texts, built_in(code).texts
        named = plain[f"hand.{hand}"], plain[f"finger.{finger}"]
        assert all(name in texts["touch.right"] for name in named)
        assert plain[f"hand.{hand}"] in texts["touch.full"]
        assert not any("{hand}" in text or "{finger}" in text for text in texts.values())


@pytest.mark.parametrize("view", [PageState(), PageState(button="early")])
def test_every_page_but_the_last_has_a_button_that_calls_the_operator(view: PageState) -> None:
    for screen in foreseen(PAPER, consent=None):
        names = [target.name for target in targets(screen)]
        is_last = isinstance(screen, Notice) and screen.text in {"thanks", "stopped"}
        assert ("call" in names) is not is_last, screen
        texts = [e.text for e in page(screen, view, wording("en")) if isinstance(e, Text)]
        assert (wording("en").texts["button.call"] in texts) is not is_last, screen


def test_the_participant_sees_how_far_the_session_is() -> None:
    screen = ask_change("places")
    texts = [
        e.text
        for e in page(screen, PageState(progress=(3, 12)), wording("en"))
        if isinstance(e, Text)
    ]
    assert "Trial 3 of 12" in texts


@pytest.mark.parametrize(
    ("passed_s", "left"),
    [(0.0, "1:30"), (29.5, "1:01"), (30.0, "1:00"), (89.9, "0:01"), (90, None)],
)
def test_a_break_counts_down(passed_s: float, left: str | None) -> None:
    screen = Instruction(text="break", after_s=90)
    elements = page(screen, PageState(passed_s=passed_s), wording("en"))
    texts = [e.text for e in elements if isinstance(e, Text)]
    assert [text for text in texts if "left" in text] == ([f"Time left: {left}"] if left else [])


def test_numbers_of_answers_stand_in_a_column_of_their_own() -> None:
    elements = page(ask_change("roughness"), PageState(), wording("en"))
    numbers = [e for e in elements if isinstance(e, Text) and e.text.isdigit()]
    assert [number.text for number in numbers] == ["1", "2", "3"]
    assert len({number.box.x for number in numbers}) == 1


def test_the_chosen_score_is_the_largest_number_on_the_scale() -> None:
    elements = page(ask_score(Rating()), PageState(chosen="7"), wording("en"))
    numbers = [e for e in elements if isinstance(e, Text) and e.text.isdigit()]
    assert max(numbers, key=lambda number: number.size).text == "7"


def test_a_text_that_is_too_long_is_reported_with_its_place_in_the_study_file() -> None:
    long = "Touch it gently. " * 20
    (problem,) = fit_problems(study(**{"touch.smooth": long}))
    assert problem.path == ("texts", "en", "touch.smooth")
    assert problem.rule == "a text must fit its place on the participant's screen"
    assert problem.value == repr(long)
    assert problem.hint is not None
    start, _, most = problem.hint.rpartition(" ")
    assert start == f"shorten it from {len(long)} characters to about"
    assert list(fit_problems(study(**{"touch.smooth": long[: int(most)]}))) == []


def test_a_word_that_is_too_wide_for_its_band_is_reported() -> None:
    text = template("paper").replace('en = "no effect"', 'en = "imperceptible"')
    (problem,) = fit_problems(parsed_study(text))
    assert (problem.where, problem.value) == ("rating.bands.0.en", "'imperceptible'")


def test_a_band_of_a_languages_own_is_reported_in_its_file() -> None:
    english = (FOLDER / "en.toml").read_text(encoding="utf-8")
    german = english.replace('"no effect" = "no effect"', '"no effect" = "keine Wirkung"')
    text = template("paper").replace("[rating]", '[session]\nlanguages = ["en", "de"]\n\n[rating]')
    (problem,) = fit_problems(parsed_study(with_languages(text, {"de": german})))
    assert problem.path == ("languages", "de", "bands", "no effect")


def test_a_consent_reference_that_is_too_long_is_refused() -> None:
    study_window((), study(), Settings(wording=wording("en")), "C-2026-0042")
    with pytest.raises(BadInput, match=r"fit its place .* got 'Consent form: x{90}"):
        study_window((), study(), Settings(wording=wording("en")), "x" * 90)


SCALES = [(0, 10), (0, 100), (1, 7), (0, 1), (5, 105), (100, 199), (0, 660), (340, 1000)]
THIRDS = ("no effect", "very weak", "very effective")


def scale_of(minimum: int, maximum: int, ticks: str = "all") -> Rating:
    """A scale, with bands of about equal length if it is long enough."""
    ends = [minimum + third * (maximum + 1 - minimum) // 3 for third in range(4)]
    bands = [
        {"from": first, "to": beyond - 1, "en": name}
        for name, (first, beyond) in zip(THIRDS, pairwise(ends), strict=True)
    ]
    keys = {"minimum": minimum, "maximum": maximum, "ticks": ticks}
    return Rating.model_validate({**keys, "bands": bands if maximum - minimum > 1 else []})


def study_with(rating: Rating) -> Study:
    return PAPER.model_copy(update={"rating": rating})


@pytest.mark.parametrize("ticks", ["all", "bands", "ends"])
@pytest.mark.parametrize("ends", SCALES)
def test_every_scale_fits_the_page(ends: tuple[int, int], ticks: str) -> None:
    assert list(fit_problems(study_with(scale_of(*ends, ticks)))) == []


def test_a_scale_with_more_scores_than_the_screen_has_pixels_is_refused() -> None:
    (problem,) = fit_problems(study_with(Rating(minimum=1, maximum=662)))
    assert str(problem) == (
        "rating.maximum: must be at most 660 above minimum = 1, for the participant's screen, "
        "got 662"
    )


@pytest.mark.parametrize("ends", SCALES)
def test_a_press_where_a_score_lies_chooses_it(ends: tuple[int, int]) -> None:
    rating = scale_of(*ends)
    for score in range(rating.minimum, rating.maximum + 1):
        x = score_x(score, score_question(rating))
        assert SCALE_BOX.holds(x, SCALE_BOX.y)
        assert nearest(x, score_question(rating)) == score


@pytest.mark.parametrize(
    ("ends", "ticks", "labels"),
    [
        ((0, 10), "all", list(range(11))),
        ((1, 7), "all", list(range(1, 8))),
        ((0, 100), "all", list(range(0, 101, 10))),
        ((1, 100), "all", [1, *range(10, 101, 10)]),
        ((0, 100), "bands", [0, 32, 66, 100]),
        ((0, 100), "ends", [0, 100]),
        ((5, 105), "all", [5, *range(20, 91, 10), 105]),
        ((340, 1000), "all", [340, *range(500, 901, 100), 1000]),
    ],
)
def test_numbers_of_scores_stand_as_far_apart_as_they_need(
    ends: tuple[int, int], ticks: str, labels: list[int]
) -> None:
    rating = scale_of(*ends, ticks)
    assert labelled(score_question(rating), rating.bands) == labels
    assert set(labels) <= set(marked(score_question(rating), rating.bands))
    texts = {
        e.text for e in page(ask_score(rating), PageState(), wording("en")) if isinstance(e, Text)
    }
    assert {text for text in texts if text.isdigit()} == {str(score) for score in labels}


@pytest.mark.parametrize("ends", SCALES)
@pytest.mark.parametrize("language", built_in_codes())
def test_elements_stay_on_the_canvas_and_texts_do_not_overlap(
    language: str, ends: tuple[int, int]
) -> None:
    study = parsed_study(template("extended"))
    rating = study.rating if ends == (0, 10) else scale_of(*ends, "bands")
    paced = foreseen(parsed_study(TRACKS), consent=None)
    for screen in (*foreseen(study.model_copy(update={"rating": rating}), consent="C-7"), *paced):
        own = OwnFinger(position_m=0.05, force=1.0, within=0.5)
        view = PageState(operator_called=True, progress=(12, 12), finger=own)
        elements = page(screen, view, wording(language))
        rooms = [element.box for element in elements if isinstance(element, Text)]
        corners = [point for box in rooms for point in box.corners]
        corners += [
            point for each in elements if isinstance(each, Outline) for point in each.points
        ]
        assert all(abs(x) <= CANVAS[0] / 2 and abs(y) <= CANVAS[1] / 2 for x, y in corners)
        pressed = [target.box for target in targets(screen) if target.role in {"button", "call"}]
        for one, other in product(rooms, pressed):
            gap_x = abs(one.x - other.x) - (one.width + other.width) / 2
            gap_y = abs(one.y - other.y) - (one.height + other.height) / 2
            assert one == other or max(gap_x, gap_y) >= 5, (screen, one, other)
        for number, one in enumerate(rooms):
            for other in rooms[:number]:
                apart_x = abs(one.x - other.x) >= (one.width + other.width) / 2
                apart_y = abs(one.y - other.y) >= (one.height + other.height) / 2
                assert apart_x or apart_y, (screen, one, other)


@pytest.mark.parametrize(("language", "told"), [("en", "Second touch"), ("zh", "第二次触摸")])
def test_each_page_of_a_touch_that_is_asked_about_says_which_one_it_is(
    language: str, told: str
) -> None:
    cue = replace(RIGHT, interval=2)
    way = lead_in(cue, TouchDefaults())
    for screen in (Instruction(text="touch.right", touch=cue.touch), way, cue):
        plain = (
            replace(screen, touch=RIGHT.touch)
            if isinstance(screen, Instruction)
            else replace(screen, interval=0)
        )
        shown, before = (page(it, PageState(), wording(language)) for it in (screen, plain))
        beside = [each for each in shown if each not in before]
        assert [each.text for each in beside if isinstance(each, Text)] == [told]
        assert len(beside) == 2, "the text, and its mark"
        assert len(shown) == len(before) + 2


TOUCHES = st.builds(
    Touch,
    place=st.sampled_from(["path", "smooth"]),
    voltage_v=st.floats(0, 200),
    ramp_to_v=st.none() | st.floats(0, 200),
    frequency=st.floats(0.5, 1.5),
    direction=st.sampled_from(["right", "left"]),
    press=st.sampled_from([1.0, 1.5]),
    beam=st.none() | st.sampled_from(["no bodies", "1 mm"]),
    duration_s=st.none() | st.floats(1, 9),
)


@given(touch=TOUCHES, other=TOUCHES)
def test_pages_of_the_same_touch_are_the_same_whatever_the_device_does(
    touch: Touch, other: Touch
) -> None:
    same = other.model_copy(
        update={name: getattr(touch, name) for name in ("place", "direction", "press")}
    )
    seen = []
    for each in (touch, same):
        cue = pacing(each, TouchDefaults())
        instruction = Instruction(text=touch_text(each), touch=cue.touch)
        screens = (instruction, lead_in(cue, TouchDefaults()), cue)
        seen.append([page(screen, PageState(), wording("en")) for screen in screens])
    assert seen[0] == seen[1]


@pytest.mark.parametrize(
    ("passed_s", "shown"), [(0.0, "3"), (0.9, "3"), (1.1, "2"), (2.1, "1"), (2.9, "1"), (9.0, "1")]
)
def test_the_mark_rests_at_its_start_while_three_seconds_are_counted_down(
    passed_s: float, shown: str
) -> None:
    touch = Touch(place="path", voltage_v=100)
    cue = pacing(touch, TouchDefaults())
    elements = page(lead_in(cue, TouchDefaults()), PageState(passed_s=passed_s), wording("en"))
    assert _mark_x(elements) == _mark_x(page(cue, PageState(), wording("en")))
    texts = [element.text for element in elements if isinstance(element, Text)]
    assert [text for text in texts if text.isdigit()] == [shown]
    assert wording("en").texts["touch.right"] in texts


def test_a_study_may_hide_the_countdown() -> None:
    finger = TouchDefaults(countdown=False)
    screen = lead_in(pacing(Touch(place="path", voltage_v=100), finger), finger)
    texts = [e.text for e in page(screen, PageState(), wording("en")) if isinstance(e, Text)]
    assert not any(text.isdigit() for text in texts)


def test_the_sentence_of_the_instruction_stays_while_the_finger_moves() -> None:
    cue = pacing(Touch(place="path", voltage_v=100), TouchDefaults())
    texts = [e.text for e in page(cue, PageState(), wording("en")) if isinstance(e, Text)]
    assert {wording("en").texts[key] for key in ("touch.right", "touch.now")} <= set(texts)


@pytest.mark.parametrize("direction", ["right", "left"])
def test_the_mark_moves_at_the_sliding_speed_and_rests_at_the_end(direction: Direction) -> None:
    touch = Touch(place="path", voltage_v=100, direction=direction)
    cue = pacing(touch, TouchDefaults(sliding_speed_m_s=0.04))
    seen = [
        _mark_x(page(cue, PageState(passed_s=passed_s), wording("en"))) for passed_s in (0, 1, 9)
    ]
    assert abs(seen[1] - seen[0]) == pytest.approx(abs(beam_x(0.04) - beam_x(0.0)))
    ends = (beam_x(0.010), beam_x(0.081))
    ends = ends if direction == "right" else ends[::-1]
    assert (seen[0], seen[2]) == pytest.approx(ends)


def _mark_x(elements: tuple[object, ...]) -> float:
    (mark,) = [element for element in elements if isinstance(element, Dot)]
    return mark.x


@pytest.mark.parametrize(
    ("force", "position_m", "x"),
    [(0.0, 0.0, -160), (0.5, 0.05, -70), (1.0, 0.1, 20), (1.5, 0.2, 110), (9.0, -1.0, 200)],
)
def test_the_own_finger_is_shown_at_its_place_and_its_force_in_a_range(
    force: float, position_m: float, x: float
) -> None:
    own = OwnFinger(position_m=position_m, force=force, within=0.5)
    seen = page(RIGHT, PageState(finger=own), wording("en"))
    hidden = page(RIGHT, PageState(), wording("en"))
    added = [element for element in seen if element not in hidden]
    pressed, placed = [element for element in added if isinstance(element, Dot)]
    assert pressed.x == pytest.approx(x)
    assert placed.x == pytest.approx(beam_x(min(max(position_m, 0), 0.1)))
    bar, wanted = [element for element in added if isinstance(element, Outline)]
    assert wanted.points[0][0] == pytest.approx(-70)
    assert wanted.points[1][0] == pytest.approx(110)
    assert min(x for x, _ in bar.points) == pytest.approx(-160)


def test_several_fingers_are_drawn_where_they_touch_the_beam() -> None:
    way = FingerPath(start_m=0.09, end_m=0.09, several=True)
    assert [dot.x for dot in fingers(way, 0.0)] == pytest.approx(
        [beam_x(0.066), beam_x(0.082), beam_x(0.098)]
    )


@pytest.mark.parametrize(
    ("ticks", "scores"),
    [("all", list(range(11))), ("ends", [0, 10]), ("bands", [0, 1, 4, 5, 7, 8, 10])],
)
def test_the_study_determines_which_scores_have_ticks(ticks: str, scores: list[int]) -> None:
    rating = parsed_study(template("paper")).rating.model_copy(update={"ticks": ticks})
    assert marked(score_question(rating), rating.bands) == scores
    texts = {
        e.text for e in page(ask_score(rating), PageState(), wording("en")) if isinstance(e, Text)
    }
    assert {text for text in texts if text.isdigit()} == {str(score) for score in scores}


@pytest.mark.parametrize(
    ("maximum", "step", "ticks", "numbers"),
    [
        (10, 0.5, [n / 2 for n in range(21)], list(range(11))),
        (20, 1, list(range(21)), list(range(0, 21, 2))),
        (55, 1, list(range(56)), list(range(0, 56, 5))),
        (56, 1, [*range(0, 51, 5), 55, 56], [*range(0, 51, 5), 56]),
    ],
)
def test_every_step_has_a_tick_where_there_is_room_though_not_for_its_number(
    maximum: float, step: float, ticks: list[float], numbers: list[float]
) -> None:
    question = StudyQuestion(name="ease", kind="scale", minimum=0, maximum=maximum, step=step)
    assert (marked(question), labelled(question)) == (ticks, numbers)


def test_the_scale_has_no_mark_until_a_score_is_chosen() -> None:
    screen = ask_score(Rating())
    dots = [
        [e for e in page(screen, PageState(chosen=chosen), wording("en")) if isinstance(e, Dot)]
        for chosen in (None, "0", "10")
    ]
    assert [len(each) for each in dots] == [0, 1, 1]
    length = look(screen, wording("en"), {"px_per_unit": 1.0, "mm_per_px": None})
    assert dots[2][0].x - dots[1][0].x == length["length_px"]


def test_no_answer_stands_out_before_it_is_chosen() -> None:
    screen = ask_change("strength")
    boxes = [e for e in page(screen, PageState(), wording("en")) if isinstance(e, Outline)][:3]
    assert len({(box.fill, box.edge, box.width) for box in boxes}) == 1


def test_targets_for_fingers_are_large_and_apart() -> None:
    for screen in foreseen(parsed_study(template("paper")), consent=None):
        rooms = [target.box for target in targets(screen)]
        assert all(min(box.width, box.height) >= 60 for box in rooms)
        for one, other in combinations(rooms, 2):
            apart_x = abs(one.x - other.x) - (one.width + other.width) / 2
            apart_y = abs(one.y - other.y) - (one.height + other.height) / 2
            assert max(apart_x, apart_y) >= 16


def test_an_instruction_names_only_the_touch() -> None:
    assert replace(RIGHT, duration_s=9).touch == RIGHT.touch
