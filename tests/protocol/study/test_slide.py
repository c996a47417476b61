"""The sliding experiment in the study file: what it may say, and what a pass is."""

import pytest
from pydantic import ValidationError

from protocol.study.touch import Slide, SlidePass, Touch, TouchDefaults, touch_s


def test_the_default_is_the_papers_block_at_drives_around_the_resonance() -> None:
    slide = Slide()
    assert (slide.load_n, slide.voltage_v, slide.frequencies_hz) == (0.56, 100.0, (23_200.0,))
    assert slide.frequencies == (0.98, 0.99, 0.995, 1.0, 1.005, 1.01, 1.02)
    assert slide.passes == 8 + 3


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"frequencies": (), "frequencies_hz": ()}, "frequencies must hold some"),
        ({"repeats": 20, "speeds_m_s": (0.005, 0.01)}, r"at most 200 passes, got 326"),
        ({"speeds_m_s": (1.0,), "paths_m": ((0.01, 0.02),)}, r"0\.1 to 600 s, got 0\.01"),
        ({"speeds_m_s": (0.001,), "paths_m": ((0.0, 0.9),)}, r"0\.1 to 600 s, got 900"),
        ({"paths_m": ((0.08, 0.01),)}, "lead from left to right"),
        ({"directions": ("left", "left")}, "directions must hold no value twice, got left"),
        ({"directions": ()}, "at least 1 item"),
        ({"load_n": 56.0}, "less than or equal to 10"),
        ({"frequencies_hz": (2.32,)}, "greater than or equal to 20"),
    ],
)
def test_what_cannot_be_drawn_is_refused(given: dict[str, object], match: str) -> None:
    with pytest.raises(ValidationError, match=match):
        Slide.model_validate(given)


def test_the_block_touches_with_its_load_on_its_path() -> None:
    finger = Slide(load_n=0.7, beam="1 mm").finger(TouchDefaults(lead_in_s=1.5, beam="none"))
    assert (finger.force_n, finger.path_m, finger.lead_in_s) == (0.7, (0.010, 0.081), 1.5)
    assert finger.beam == "1 mm"
    assert Slide().finger(TouchDefaults(beam="none")).beam == "none"


def test_a_fixed_drive_is_relative_to_any_resonance() -> None:
    made = SlidePass(place="path", voltage_v=100, path_m=(0.02, 0.03), frequency_hz=24_000.0)
    assert made.at(25_000.0).frequency == pytest.approx(0.96)
    assert made.at(20_000.0).at(24_000.0).frequency == 1.0
    relative = Touch(place="path", voltage_v=100, frequency=0.98)
    assert relative.at(25_000.0) is relative


def test_a_pass_has_a_way_of_its_own() -> None:
    finger = TouchDefaults()
    made = SlidePass(place="path", voltage_v=0, path_m=(0.02, 0.03))
    assert touch_s(made, finger) == pytest.approx(0.010 / 0.04)
    assert touch_s(Touch(place="path", voltage_v=0), finger) == pytest.approx(0.071 / 0.04)
