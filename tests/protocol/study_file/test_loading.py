"""Study files: the built-in studies, and what is said about bad ones."""

import copy
import re
import tomllib
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from protocol.study.study import Study
from protocol.study_file.loading import (
    StudyError,
    ignored_tables,
    parsed_study,
    recovered,
    schema_problems,
    template,
)

PAPER = template("paper")
DIALECTS = {"dialects": lambda: ("board", "keysight"), "gauge dialects": lambda: ("gauge",)}
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
    with pytest.raises(ValueError, match="one of paper, extended, threshold, plate, got 'papr'"):
        template("papr")


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("max_voltage_v", "max_voltag_v", "unknown key, got 'max_voltag_v'; did you mean 'max_vol"),
        ("frequency = 0.98", "frequency_hz = 0.98", "at least 20, .*; frequency is relative to"),
        (
            "frequency = 0.98",
            "frequency = 23700",
            "most 10, got 23700; .*; frequency_hz is in Hz",
        ),
        (
            "frequency = 0.98",
            "frequency = 1, frequency_hz = 23700",
            "must not be given beside frequency_hz, got both; .* leave one out",
        ),
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
        (
            "[touch]\n",
            '[force_channel]\ngauge_dialect = "guage"\n[touch]\n',
            "gauge_dialect: must be one of 'gauge', got 'guage'; did you mean 'gauge'",
        ),
        (
            'device = "sim"',
            'device = "spy:///dev/null?file=thesis.tex"',
            r"study.toml:10: rig.device: must be sim, a serial port such as /dev/ttyACM0 or COM3 "
            r".touchbeam device list., socket://HOST:PORT or "
            r"rfc2217://HOST:PORT, without options, got 'spy:///dev/null.file=thesis.tex'$",
        ),
        ("[rating]", "[force_channel]\nrate_hz = 40\n[rating]", "must be at least 50, got 40"),
        ("seed = 1", "seed = 1.5", "study.seed: must be a whole number, got 1.5"),
        ("seed = 1", "seed = -1", "study.seed: must be at least 0, got -1"),
        ('order = "williams"', 'order = "latin"', "'williams', 'blocks', .* got 'latin'"),
        ("path_m = [0.010, 0.081]", "path_m = [0.081, 0.010]", "left to right, got .0.081"),
        ("to = 4", "to = 3", "rating.bands: must follow one another from 0 to 10, got 0-0, 1-3"),
        ("duration_s = 6", "duration_s = 0.4", "steeper than rig.ramp_v_per_s = 400 V/s, got 500"),
        ("duration_s = 6", "duration_s = 60", "rig.max_drive_s = 30 s, got 63 s"),
        ("max_slew_v_per_us = 40", "max_slew_v_per_us = 30", "= 30 V/us, got 30.44 V/us"),
        ('device = "sim"', "amplifier_gain = 20", "generator_max_vpp = 10 V peak.* got 20 V"),
        ('device = "sim"', "capacitance_nf = 2\nmax_current_ma = 50", "= 50 mA, got 60.87 mA"),
        ("participants = 9", "opposite_repeats = 1", "less than repeats = 1, got 1"),
        ("[rating]", "[texts.en]\nwelcom = 'Hi'\n[rating]", "'welcom'; did you mean 'welcome'"),
        ("[rating]", "[texts.zh]\nconsent = '{ref}'\n[rating]", "braces must be {reference}, got"),
        (
            "[rating]",
            "[texts.en]\nwelcome = ' '\n[rating]",
            "a text must not be blank, got ' '",
        ),
        (
            "[rating]",
            "[texts.en]\nscore = '\u202e?'\n[rating]",
            "score: a text must hold no control",
        ),
        (
            "[rating]",
            "[texts.en]\n'answer.same' = 'It became  Rougher '\n[rating]",
            "must differ, got 'It became  Rougher ' for answer.rougher and answer.same",
        ),
        (
            "[rating]",
            "[exclusions]\nmin_reaction_s = 20\nmax_reaction_s = 1\n[rating]",
            "min_reaction_s: must be less than max_reaction_s = 1, got 20",
        ),
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
        parsed_study(PAPER.replace(right, wrong, 1), dialects=DIALECTS)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("rig", "channel", "message"),
    [
        ('dialect = "keysight"', "rate_hz = 500", "rate_hz: needs a board or a gauge, and rig.dia"),
        ('device = "COM1"', "gauge = 'COM1'", "gauge: must have a port of its own, .* got 'COM1'"),
        (
            'device = "COM1"',
            "gauge = 'sim'\nrate_hz = 500",
            "gauge: is simulated, .* simulated device only, got rig.device = 'COM1'",
        ),
    ],
)
def test_what_cannot_be_recorded_is_refused(rig: str, channel: str, message: str) -> None:
    given = f"{rig}\namplifier_gain = 40\ngenerator_max_vpp = 12"
    text = PAPER.replace('device = "sim"', given, 1) + f"\n[force_channel]\n{channel}\n"
    with pytest.raises(StudyError, match=message):
        parsed_study(text)
    text = text.replace("'COM1'", "'COM2'").replace("'sim'", "'COM2'")
    parsed_study(text + "gauge = 'COM2'\n" * ("gauge" not in channel))


def test_a_dialect_is_a_name_where_nobody_says_which_there_are() -> None:
    rig = 'dialect = "rigol"\namplifier_gain = 20\ngenerator_max_vpp = 20'
    assert parsed_study(PAPER.replace('device = "sim"', rig, 1)).rig.dialect == "rigol"
    with pytest.raises(StudyError, match=r"rig\.dialect: must be a name of letters"):
        parsed_study(PAPER.replace('device = "sim"', 'dialect = "a b"', 1))
    with pytest.raises(
        StudyError, match=r"force_channel\.gauge_dialect: must be a name of letters"
    ):
        parsed_study(f"{PAPER}\n[force_channel]\ngauge_dialect = 'a b'\n")


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
        ("7" * 5000, r"study\.toml: file: .* nor a number have thousands of digits, got more"),
        ("7" * 4000, r"study\.toml: study\.seed: .* 64 bits, got one of 13288 bits; shorten it"),
        ("0x" + "f" * 5000, r"study\.toml: study\.seed: .* 64 bits, got one of 20000 bits"),
        ("9223372036854775808", r"study\.toml: study\.seed: .* 64 bits, got one of 64 bits"),
        ("[" * 17 + "]" * 17, r"study\.toml: file: nothing may be nested more than 16 deep, nor"),
        ("[" * 400 + "]" * 400, r"study\.toml: file: nothing may be nested more than 16 deep"),
        ("[" * 9999 + "]" * 9999, r"study\.toml: file: nothing may be nested more than 16 deep"),
        ("{a = " * 999 + "1" + "}" * 999, r"study\.toml: file: nothing may be nested more than"),
        ("1\n" + "a." * 40_000 + "a = 1", r"study\.toml: file: nothing may be nested more than 16"),
        ("1\n" + "'a' . " * 999 + "a = 1", r"study\.toml: file: nothing may be nested more than"),
        ("1\n[" + "a." * 999 + "a]", r"study\.toml: file: nothing may be nested more than 16"),
        (
            "[" + "1," * 100_000 + "]",
            r"study\.toml:7: study\.seed: must be a whole number, got \[1,",
        ),
        (
            "[" + "1," * 500_000 + "]",
            r"study\.toml: file: must have at most 262144 characters, got",
        ),
        ('"' + "[" * 99 + '"', r"study\.toml:7: study\.seed: must be a whole number, got '\[\["),
    ],
)
def test_what_no_reader_expects_is_one_line_all_the_same(wrong: str, message: str) -> None:
    with pytest.raises(StudyError, match=message) as caught:
        parsed_study(PAPER.replace("seed = 1", f"seed = {wrong}", 1))
    assert len(str(caught.value)) < 200


def test_dots_in_texts_and_comments_are_no_key() -> None:
    dotted = "1." * 99
    name = f'name = "{dotted[:60]}" # {dotted}'
    study = parsed_study(re.sub('name = ".*?"', name, PAPER, count=1))
    assert study.study.name == dotted[:60]


@pytest.mark.parametrize("place", ["[rig]", "[texts.en]", "[publication]"])
def test_no_more_problems_are_listed_than_anybody_reads(place: str) -> None:
    wrong = "".join(f"k{number} = 1\n" for number in range(9_000))
    text = PAPER if place in PAPER else f"{PAPER}\n{place}\n"
    with pytest.raises(StudyError, match=r".and 50 more: touchbeam check.$") as caught:
        parsed_study(text.replace(f"{place}\n", f"{place}\n{wrong}", 1))
    *listed, last = caught.value.problems
    assert len(listed) == 50
    assert str(last) == "file: at most 50 problems are listed, got more; correct these first"


def test_a_key_with_a_point_is_to_be_quoted() -> None:
    text = f'{PAPER}\n[texts.en]\ntouch.smooth = "Hello"\n'
    with pytest.raises(StudyError, match=r'texts\.en\.touch: .*; quote the key: "touch.smooth" ='):
        parsed_study(text)


def test_a_file_that_ends_too_soon_is_named_by_its_last_line() -> None:
    with pytest.raises(
        StudyError, match=r"study\.toml:2: .* got the line 'name = \[1,'; what is opened"
    ):
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
        ('"1 mm" = 0.001', '"1 mm" = "x"', "31: beams.\"1 mm\": must be a number, got 'x'"),
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


@pytest.mark.parametrize(
    "mistakes",
    [
        {"{ place": "{ duration = 2, place"},
        {'question = "': 'level = [1]\nquestion = "'},
        {'question = "': 'levels = [1, "2"]\nquestion = "'},
        {'expected = "': 'expectd = "', "{ place": "{ plaice"},
        {'kind = "': 'kind = "x', "watchdog_s": "watchdg_s"},
    ],
)
def test_mistakes_everywhere_do_not_hide_a_voltage(mistakes: dict[str, str]) -> None:
    """Also where nothing in a list is without a mistake."""
    text = PAPER.replace("ramp_to_v = 200", "ramp_to_v = 250")
    for right, wrong in mistakes.items():
        text = text.replace(right, wrong)
    with pytest.raises(StudyError) as caught:
        parsed_study(text)
    too_high = [problem for problem in caught.value.problems if problem.value == "250 V"]
    assert [(problem.path[1], problem.path[-1]) for problem in too_high] == [(2, "ramp_to_v")]


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
            inside = inside or (isinstance(holder, list) and part in range(len(holder)))
            holder = holder[part] if inside else None
        if isinstance(holder, dict):
            holder[place[-1]] = junk
            if junk == "delete":
                del holder[place[-1]]
    assert recovered(document, {}) is not None
    error = _error_of(document)
    if error is not None:
        assert 1 <= len(schema_problems(document, error)) <= error.error_count()


def _error_of(document: dict[str, Any]) -> ValidationError | None:
    try:
        Study.model_validate(document)
    except ValidationError as error:
        return error
    return None


def test_a_table_that_nothing_obeys_any_more_is_ignored_and_named() -> None:
    text = template("paper")
    older = text + "\n[forecast]\ngain_sd = -1\nunheard_of = 'x'\n"
    assert parsed_study(older) == parsed_study(text)
    assert ignored_tables(text) == ""
    assert ignored_tables(text + "# forecast\n") == ""
    said = "[forecast] (touchbeam power says how wide intervals will be)"
    assert ignored_tables(older) == said
    assert ignored_tables("[forecast") == "", "it is no study file"


def test_every_other_table_must_be_known() -> None:
    with pytest.raises(StudyError, match="unknown key, got 'forecasts'"):
        parsed_study(template("paper") + "\n[forecasts]\ngain_sd = 1\n")
