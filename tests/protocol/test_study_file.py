"""Study files: the built-in study, and what is said about bad ones."""

import pytest

from protocol.study_file import StudyError, parsed_study, template

PAPER = template("paper")


def test_the_paper_study_has_its_five_conditions() -> None:
    study = parsed_study(PAPER)
    assert study.conditions == ("frequency", "structure", "voltage", "direction", "pressure")
    assert [opening.kind for opening in study.opening] == ["baseline", "signal"]


def test_the_bands_cover_the_scale() -> None:
    bands = parsed_study(PAPER).rating.bands
    covered = [score for band in bands for score in range(band.first, band.last + 1)]
    assert covered == list(range(11))


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("max_voltage_v", "max_voltag_v", "unknown key, got 'max_voltag_v'; did you mean 'max_vol"),
        ("press = 1.5", "prss = 1.5", "'prss'; did you mean 'press'"),
        ("ramp_to_v = 200", "ramp_to_v = 201", "must not exceed .* = 200 V, got 201 V"),
        ("max_voltage_v = 200 ", "max_voltage_v = 400 ", "rig.max_voltage_v: .* 200, got 400"),
        ("frequency = 0.98", "frequency = 2", "must not exceed .* = 40000 Hz, got 48442 Hz"),
        ('beam = "1.5 mm"', 'beam = "2 mm"', "one of .beams., got '2 mm'; known: no bodies"),
        ('beam = "1 mm"        ', 'beam = "2 mm"       ', "touch.beam: .* got '2 mm'"),
        ('"swapped"', '"swappd"', "one of swapped, not swapped .* got 'swappd'"),
        ('name = "voltage"', 'name = "pressure"', "names must differ, got 'pressure'"),
        ("[study]", "[study", "must be TOML"),
        ("voltage_v = 100", "voltage_v = nan", "finite number, got nan"),
        ("path_m = [0.010, 0.081]", "path_m = [0.081, 0.010]", "left to right, got .0.081"),
    ],
)
def test_a_bad_study_is_refused_in_one_line(right: str, wrong: str, message: str) -> None:
    assert right in PAPER
    with pytest.raises(StudyError, match=message) as caught:
        parsed_study(PAPER.replace(right, wrong, 1))
    assert "\n" not in str(caught.value)


def test_all_problems_are_found_at_once() -> None:
    text = PAPER.replace("max_voltage_v", "max_volt").replace("score_when", "score_then")
    with pytest.raises(StudyError, match="and 1 more") as caught:
        parsed_study(text)
    assert [problem.where for problem in caught.value.problems] == [
        "rig.max_volt",
        "rating.score_then",
    ]
