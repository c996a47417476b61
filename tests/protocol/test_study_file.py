"""Study files: the built-in studies, and what is said about bad ones."""

import copy
import re
import tomllib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from protocol.salvage import salvaged
from protocol.schema_problems import schema_problems
from protocol.study import Study
from protocol.study_file import StudyError, parsed_study, template

PAPER = template("paper")
EXTENDED = template("extended")


def test_the_paper_study_has_its_five_conditions() -> None:
    study = parsed_study(PAPER)
    assert study.conditions == ("frequency", "structure", "voltage", "direction", "pressure")
    assert [opening.kind for opening in study.opening] == ["baseline", "signal"]
    assert study.design.repeats == 1


def test_the_extended_study_has_what_it_says() -> None:
    design = parsed_study(EXTENDED).design
    assert design.order == "williams"
    assert design.repeats * 5 >= 20
    assert min(design.practice_trials, design.catch_trials, design.opposite_repeats) > 0
    assert design.break_every_blocks > 0
    assert all(len(set(c.levels)) == 4 for c in parsed_study(EXTENDED).condition)


def test_the_bands_cover_the_scale() -> None:
    bands = parsed_study(PAPER).rating.bands
    covered = [score for band in bands for score in range(band.first, band.last + 1)]
    assert covered == list(range(11))


def test_an_unknown_template_is_refused() -> None:
    with pytest.raises(ValueError, match="one of paper, extended, got 'papr'"):
        template("papr")


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("max_voltage_v", "max_voltag_v", "unknown key, got 'max_voltag_v'; did you mean 'max_vol"),
        ("press = 1.5", "prss = 1.5", "pressure, touch 2, prss: .* 'prss'; did you mean 'press'"),
        ("ramp_to_v = 200", "ramp_to_v = 201", "must not exceed .* = 200 V, got 201 V"),
        ("max_voltage_v = 200 ", "max_voltage_v = 400 ", "max_voltage_v: must be at most 200, got"),
        ("frequency = 0.98", "frequency = 2", "must not exceed .* = 40000 Hz, got 48442 Hz"),
        ('beam = "1.5 mm"', 'beam = "2 mm"', "one of .beams., got '2 mm'; known: no bodies"),
        ('beam = "1 mm"        ', 'beam = "2 mm"       ', "touch.beam: .* got '2 mm'"),
        ('beam = "1 mm"        ', "#", "touch.beam: must be given when a touch names a beam"),
        ('"swapped"', '"swappd"', "one of swapped, not swapped .* got 'swappd'"),
        ('name = "voltage"', r'name = "vol\u001btage"', r"n 3, name: .* got 'vol.x1btage'"),
        ('name = "voltage"', r'name = "vol\u202etage"', "condition 3, name: must hold no control"),
        ('name = "voltage"', 'name = "pressure"', "names must differ, got 'pressure'"),
        (
            'name = "voltage"',
            'name = "Pressure"',
            "case and spaces, got 'pressure' beside 'Pressure",
        ),
        ('name = "voltage"', 'name = " pressure"', "got 'pressure' beside ' pressure'; rename one"),
        (
            'name = "voltage"',
            'name = "   "',
            "76: condition: a name must not be blank, got '   '; ",
        ),
        (
            'name = "paper"',
            'name = " "',
            "study.toml:6: study: a name must not be blank, got ' '; ",
        ),
        ('"1.5 mm" = 0.0015', '"1 MM" = 0.0015', "31: beams: .* got '1 mm' beside '1 MM'; rename"),
        ('"no bodies" = 0.0', '" " = 0.0', "study.toml:29: beams: a name must not be blank, got"),
        ("[study]", "[study", "study.toml:4: file: must be TOML"),
        ("voltage_v = 100", "voltage_v = nan", "must be a finite number, got nan"),
        ("voltage_v = 100", "voltage_v = -1", "must be at least 0, got -1"),
        (
            'device = "sim"',
            'dialect = "boards"',
            "'board' or 'keysight', got 'boards'; did you mean",
        ),
        ('device = "sim"', 'dialect = "Keysight"', "got 'Keysight'; did you mean 'keysight'.$"),
        (
            'device = "sim"',
            'dialect = "keysight"',
            r"study.toml:9: rig.amplifier_gain: must be given where rig.dialect = 'keysight', got",
        ),
        ("seed = 1", "seed = 1.5", "study.seed: must be a whole number, got 1.5"),
        ("seed = 1", "seed = -1", "study.seed: must be at least 0, got -1"),
        ('order = "williams"', 'order = "latin"', "'williams', 'blocks', .* got 'latin'"),
        ("path_m = [0.010, 0.081]", "path_m = [0.081, 0.010]", "left to right, got .0.081"),
        ("to = 4", "to = 3", "rating.bands: must follow one another from 0 to 10, got 0-0, 1-3"),
        ("duration_s = 6", "duration_s = 0.4", "steeper than rig.ramp_v_per_s = 400 V/s, got 500"),
        ("duration_s = 6", "duration_s = 60", "rig.max_drive_s = 30 s, got 60.5 s"),
        ("max_slew_v_per_us = 40", "max_slew_v_per_us = 30", "= 30 V/us, got 30.44 V/us"),
        ('device = "sim"', "amplifier_gain = 20", "generator_max_vpp = 10 V peak.* got 20 V"),
        ('device = "sim"', "capacitance_nf = 2\nmax_current_ma = 50", "= 50 mA, got 60.87 mA"),
        ("participants = 9", "opposite_repeats = 1", "less than repeats = 1, got 1"),
        ("[rating]", "[texts.en]\nwelcom = 'Hi'\n[rating]", "'welcom'; did you mean 'welcome'"),
        ("[rating]", "[texts.zh]\nconsent = '{ref}'\n[rating]", "braces must be {reference}, got"),
        ("[rating]", "[texts.zh]\nwelcome = '{'\n[rating]", "braces must be none, got '{'"),
        (
            "press = 1.5",
            "instruction = 'hard'",
            r"study.toml:96: condition pressure, touch 2: .* must have a text, got none for 'hard' "
            r"in en and zh; give it in \[texts.en\] and \[texts.zh\]$",
        ),
    ],
)
def test_a_bad_study_is_refused_in_one_line(right: str, wrong: str, message: str) -> None:
    assert right in PAPER
    with pytest.raises(StudyError, match=message) as caught:
        parsed_study(PAPER.replace(right, wrong, 1))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ('voltages_are = "peak"', 'voltages_are = "peak-to-peak"', "'peak-to-peak'; .* half of"),
        ("voltage_v = 100", "voltage_vpp = 200", "unknown key, got 'voltage_vpp'; .* half of"),
        ("voltage_v = 100", 'voltage_v = "200 Vpp"', "must be a number, got '200 Vpp'; .* half of"),
        ("voltage_v = 100", "voltage_v = 400", "got 400 V; .* 400 V peak-to-peak is 200 V"),
        ('device = "sim"', "amplifier_gain = 39", "got 10.2564 V; .* half of its peak-to-peak"),
    ],
)
def test_peak_to_peak_taken_for_peak_is_caught(right: str, wrong: str, message: str) -> None:
    with pytest.raises(StudyError) as caught:
        parsed_study(PAPER.replace(right, wrong, 1))
    found = "\n".join(map(str, caught.value.problems))
    with pytest.raises(AssertionError, match=message):
        raise AssertionError(found)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            "7" * 5000,
            r"study\.toml:7: file: .* fit into 64 bits, got one of 5000 digits; shorten it",
        ),
        ("7" * 4000, r"study\.toml:7: study\.seed: .* 64 bits, got one of 13288 bits; shorten it"),
        ("0x" + "f" * 5000, r"study\.toml:7: study\.seed: .* 64 bits, got one of 20000 bits"),
        ("9223372036854775808", r"study\.toml:7: study\.seed: .* 64 bits, got one of 64 bits"),
        ("[" * 17 + "]" * 17, r"study\.toml:7: file: nothing may be nested more than 16 deep, got"),
        ("[" * 400 + "]" * 400, r"study\.toml:7: file: nothing may be nested more than 16 deep"),
        ("[" * 9999 + "]" * 9999, r"study\.toml:7: file: nothing may be nested more than 16 deep"),
        ("{a = " * 999 + "1" + "}" * 999, r"study\.toml:7: file: nothing may be nested more than"),
        ("1\n" + "a." * 999 + "a = 1", r"study\.toml:8: file: nothing may be nested more than 16"),
        ("1\n[" + "a." * 999 + "a]", r"study\.toml:8: file: nothing may be nested more than 16"),
        ('"' + "[" * 99 + '"', r"study\.toml:7: study\.seed: must be a whole number, got '\[\["),
    ],
)
def test_what_no_reader_expects_is_one_line_all_the_same(wrong: str, message: str) -> None:
    with pytest.raises(StudyError, match=message) as caught:
        parsed_study(PAPER.replace("seed = 1", f"seed = {wrong}", 1))
    assert len(str(caught.value)) < 200


def test_a_file_that_ends_too_soon_is_named_by_its_last_line() -> None:
    with pytest.raises(StudyError, match=r"study\.toml:2: file: must be TOML, got .* end of docum"):
        parsed_study("[study]\nname = [1,\n\n")


def test_all_problems_are_found_at_once_with_their_lines() -> None:
    text = (
        PAPER.replace("max_voltage_v", "max_volt", 1)
        .replace("score_when", "score_then", 1)
        .replace("ramp_to_v = 200", "ramp_to_v = 201", 1)
        .replace('beam = "1.5 mm"', 'beam = "2 mm"', 1)
    )
    with pytest.raises(StudyError, match="and 3 more") as caught:
        parsed_study(text)
    found = [(problem.where, problem.line) for problem in caught.value.problems]
    lines = text.splitlines()
    assert [where for where, _ in found] == [
        "rig.max_volt",
        "rating.score_then",
        "condition structure, touch 2",
        "condition voltage, touch 1",
    ]
    for (_, line), part in zip(found, ["max_volt", "score_then", "2 mm", "201"], strict=True):
        assert line is not None
        assert part in lines[line - 1]


@pytest.mark.parametrize(
    ("right", "wrong", "line"),
    [
        ("[0.010, 0.081]", "[0.081, 0.01]", "23: touch.path_m: must lead from left to right, got"),
        ("force_n = 0.5", "force_n = -1", "20: touch.force_n: must be at least 0.01, got -1"),
        ("\nbeam = ", "\nbeem = ", "26: touch.beem: unknown key, got 'beem'; did you mean 'beam'?"),
        ('"1 mm" = 0.001', '"1 mm" = "x"', "31: beams.1 mm: must be a number, got 'x'"),
        ("participants = 9", "opposite_repeats = 1", "34: design.opposite_repeats: must be less"),
        ('"swapped"', '"swap"', "84: condition direction, expected: must be one of swapped, not"),
        ("to = 4", "to = 3", "39: rating.bands: must follow one another from 0 to 10, got 0-0, 1"),
        ("[rating]", "[texts]\nen = {welcome = 1}\n[rating]", "38: texts.en.welcome: must be a te"),
    ],
)
def test_one_mistake_is_one_problem_that_says_once_what_it_got(
    right: str, wrong: str, line: str
) -> None:
    assert right in PAPER
    with pytest.raises(StudyError, match=r"study\.toml:") as caught:
        parsed_study(PAPER.replace(right, wrong, 1))
    (found,) = [problem.located("study.toml") for problem in caught.value.problems]
    assert f"study.toml:{line}" in found
    assert found.count("got") == 1


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
        ('"1 mm" = 0.001', "1", "beams.1 mm: must be at most 0.05, got 1; in m: 1 mm is 0.001"),
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
        "beams.1 mm",
        "condition voltage, touch 1",
    ]


def test_a_press_that_fits_and_a_force_that_fits_may_be_too_much_together() -> None:
    text = PAPER.replace("force_n = 0.5", "force_n = 5").replace("press = 1.5", "press = 5")
    message = r"study.toml:96: condition pressure, touch 2: .* must not exceed 20 N, got 25 N; rel"
    with pytest.raises(StudyError, match=message):
        parsed_study(text)


def test_what_rests_on_a_broken_design_is_not_a_problem_of_its_own() -> None:
    with pytest.raises(StudyError, match=r"design\.repeats: must be a whole number, got '4'$"):
        parsed_study(EXTENDED.replace("\nrepeats = 4", "\nrepeats = '4'"))


def test_a_condition_keeps_its_name_where_something_else_is_wrong_with_it() -> None:
    text = PAPER.replace('"swapped"', '"swap"').replace('"right" }', '"right", duration_s = 50 }')
    with pytest.raises(StudyError, match="and 1 more") as caught:
        parsed_study(text)
    assert [problem.where for problem in caught.value.problems] == [
        "condition direction, expected",
        "condition direction, touch 1",
    ]


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        (
            "voltage_v = 0 }]",
            "voltage_v = 50 }]",
            r"study.toml:48: opening baseline, touch 1: a baseline must be without a signal, "
            r'got 50 V; write voltage_v = 0, or kind = "signal"$',
        ),
        ("voltage_v = 0 }]", "voltage_v = 0, ramp_to_v = 9 }]", "without a signal, got 9 V"),
        (
            "voltage_v = 100 }]",
            "voltage_v = 0 }]",
            r"study.toml:54: opening signal: a signal must be driven in at least one touch, "
            r"got 0 V throughout; give its touches a voltage_v",
        ),
    ],
)
def test_a_baseline_is_without_a_signal_and_a_signal_is_not(
    right: str, wrong: str, message: str
) -> None:
    assert right in PAPER
    with pytest.raises(StudyError, match=message):
        parsed_study(PAPER.replace(right, wrong, 1))


@pytest.mark.parametrize(
    "key", ['kind = "baseline"', 'kind = "signal"', "touches = [{ place", "voltage_v = 100 }]"]
)
def test_an_opening_that_is_not_known_is_not_called_undriven_or_driven(key: str) -> None:
    with pytest.raises(StudyError, match=r"study\.toml:\d+: opening") as caught:
        parsed_study(PAPER.replace(key, f"x{key}", 1))
    rules = " ".join(problem.rule for problem in caught.value.problems)
    assert "driven" not in rules
    assert "without" not in rules


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("ramp_to_v = 200", "ramp_to_v = 200.0000001", "= 200 V, got 200.0000001 V"),
        ("max_voltage_v = 200", "max_voltage_v = 199.99999999", "= 199.99999999 V, got 200 V"),
        ("max_voltage_v = 200", "max_voltage_v = 200.0000001", "at most 200, got 200.0000001"),
    ],
)
def test_what_exceeds_a_limit_by_a_hair_is_shown_to_exceed_it(
    right: str, wrong: str, message: str
) -> None:
    with pytest.raises(StudyError, match=message):
        parsed_study(PAPER.replace(right, wrong, 1))


def test_a_mistaken_key_is_named_first_and_nothing_is_named_twice() -> None:
    with pytest.raises(
        StudyError, match=r"unknown key, got 'voltage_vpp'; .* .and 1 more"
    ) as caught:
        parsed_study(PAPER.replace("voltage_v = 100", "voltage_vpp = 200", 1))
    assert [problem.line for problem in caught.value.problems] == [54, 54]


def _places(value: Any, above: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    inner: Any = value.items() if isinstance(value, dict) else ()
    inner = enumerate(value) if isinstance(value, list) else inner
    return [
        place for key, item in inner for place in [(*above, key), *_places(item, (*above, key))]
    ]


DOCUMENT = tomllib.loads(EXTENDED)
JUNK = st.sampled_from(["x", -1, 1e9, [], {}, True, float("nan"), [1, 2, 3], {"a": 1}, "delete"])


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(_places(DOCUMENT)), JUNK), min_size=1, max_size=3))
def test_whatever_is_broken_the_rest_is_still_looked_at(
    changes: list[tuple[tuple[Any, ...], Any]],
) -> None:
    document = copy.deepcopy(DOCUMENT)
    for place, junk in changes:
        holder: Any = document
        for part in place[:-1]:
            inside = isinstance(holder, dict) and part in holder
            inside = inside or (isinstance(holder, list) and part < len(holder))
            holder = holder[part] if inside else None
        if isinstance(holder, dict):
            holder[place[-1]] = junk
            if junk == "delete":
                del holder[place[-1]]
    assert salvaged(document) is not None
    error = _error_of(document)
    if error is not None:
        assert 1 <= len(schema_problems(document, error)) <= error.error_count()


def _error_of(document: dict[str, Any]) -> ValidationError | None:
    try:
        Study.model_validate(document)
    except ValidationError as error:
        return error
    return None
