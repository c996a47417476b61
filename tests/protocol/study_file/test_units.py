"""Numbers of a study that only another unit explains, and what is said of them."""

import re

import pytest

from protocol.study_file.loading import StudyError, parsed_study, template

PAPER = template("paper")


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("contact_m = 0.010", "10", "touch.contact_m: must be at most 0.1, got 10; in m: 10 mm is"),
        ("contact_m = 0.010", "1e-9", "must be at least 0.001, got 1e-09; in m: 10 mm is 0.01"),
        ("sliding_speed_m_s = 0.04", "40", "at most 1, got 40; in m/s: 40 mm/s is 0.04"),
        ("hold_s = 2.0", "1e-9", "at least 0.1, got 1e-09; in s: 500 ms is 0.5"),
        ("hold_s = 2.0", "2000", "at most 600, got 2000; in s: 2000 ms is 2"),
        (
            "duration_s = 6",
            "6000",
            "touch 1, duration_s: must be at most 600, got 6000; in s: 6000",
        ),
        ("press = 1.5", "1e6", "touch 2, press: must be at most 10, got 1000000.0; relative to"),
        ("press = 1.5", "1e308", "touch 2, press: must be at most 10, got 1e+308; relative to"),
        ("frequency = 0.98", "0.001", "touch 1, frequency: must be at least 0.1, got 0.001; relat"),
        ("frequency = 0.98", "1e-300", "at least 0.1, got 1e-300; relative to the resonance: 1.0"),
        ("frequency = 0.98", "24221", "at most 10, got 24221; relative to the resonance: 1.0"),
        ("force_n = 0.5", "50", "touch.force_n: must be at most 10, got 50; in N: 50 g is 0.49033"),
        ("force_n = 0.5", "1e308", "must be at most 10, got 1e+308; in N: 50 g is 0.49033"),
        ('"1 mm" = 0.001', "1", 'beams."1 mm": must be at most 0.05, got 1; in m: 1 mm is 0.001'),
        (
            "nominal_resonance_hz = 24221",
            "24.221",
            "at least 1000, got 24.221; in Hz: 24.221 kHz i",
        ),
        ("max_frequency_hz = 40000", "40", "at least 1000, got 40; in Hz: 40 kHz is 40000"),
        ("ramp_v_per_s = 400", "0.4", "rig.ramp_v_per_s: must be at least 1, got 0.4"),
        (
            "smooth_place_m = 0.0414",
            "41.4",
            "smooth_place_m: must be at most 1, got 41.4; in m: 41",
        ),
    ],
)
def test_a_number_in_another_unit_is_refused_with_the_right_one(
    key: str, value: str, said: str
) -> None:
    assert key in PAPER
    name, _, _ = key.rpartition(" = ")
    text = PAPER.replace(key, f"{name} = {value}", 1)
    with pytest.raises(StudyError, match=re.escape(said)) as caught:
        parsed_study(text)
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize(
    ("section", "line", "said"),
    [
        ("rig", "capacitance_nf = 22000", "at most 10000, got 22000; in nF: 22000 pF is 22"),
        ("rig", "max_current_ma = 0.05", "at least 0.1, got 0.05; in mA: 0.05 A is 50"),
        ("rig", "generator_max_vpp = 10_000", "at most 100, got 10000; in V: 10000 mV is 10"),
        ("rig", "amplifier_gain = 20_000", "at most 1000, got 20000; volts out per volt in"),
        ("force_channel", "rate_hz = 5000", "at most 1000, got 5000; samples per second"),
        ("design", "break_s = 60_000", "at most 3600, got 60000; in s: 60000 ms is 60"),
        ("timing", "inter_trial_s = 2_000", "at most 600, got 2000; in s: 2000 ms is 2"),
        ("timing", "beam_swap_s = 60_000", "at most 3600, got 60000; in s: 60000 ms is 60"),
        ("exclusions", "min_reaction_s = 200", "at most 30, got 200; in s: 200 ms is 0.2"),
        ("exclusions", "max_reaction_s = 5_000", "at most 600, got 5000; in s: 5000 ms is 5"),
    ],
)
def test_a_number_that_is_not_in_the_template_has_its_range_as_well(
    section: str, line: str, said: str
) -> None:
    text = PAPER if f"[{section}]" in PAPER else f"{PAPER}\n[{section}]\n"
    with pytest.raises(StudyError, match=re.escape(said)) as caught:
        parsed_study(text.replace(f"[{section}]", f"[{section}]\n{line}"))
    assert len(caught.value.problems) == 1


def test_all_wrong_units_are_found_at_once() -> None:
    text = (
        PAPER.replace("[0.010, 0.081]", "[10, 81]")
        .replace("smooth_place_m = 0.0414", "smooth_place_m = 41.4")
        .replace('"1 mm" = 0.001', '"1 mm" = 1')
        .replace("ramp_to_v = 200", "ramp_to_v = 201")
    )
    with pytest.raises(StudyError, match="and 4 more") as caught:
        parsed_study(text)
    assert [problem.where for problem in caught.value.problems] == [
        "touch.path_m.0",
        "touch.path_m.1",
        "touch.smooth_place_m",
        'beams."1 mm"',
        "condition voltage, touch 1",
    ]


def test_a_press_that_fits_and_a_force_that_fits_may_be_too_much_together() -> None:
    text = PAPER.replace("force_n = 0.5", "force_n = 5").replace("press = 1.5", "press = 5")
    message = r"study.toml:96: condition pressure, touch 2: .* must not exceed 20 N, got 25 N; rel"
    with pytest.raises(StudyError, match=message):
        parsed_study(text)
