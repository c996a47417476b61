"""`touchbeam check`: the preview, its JSON contract, and lists of every problem."""

import json
import math
import re
from pathlib import Path
from typing import Any

import pytest

from protocol.study.rules import SELECTS, Exclusions, selections
from protocol.study_file.loading import template, template_pictures
from tests.protocol.studies import OWN_QUESTIONS
from tests.runner.command_line import assert_matches, typed

TWO_BEAMS = """
[[condition]]
name = "a"
question = "roughness"
expected = "smoother"
touches = [{ place = "smooth", voltage_v = 100, beam = "1.5 mm" }]
[[condition]]
name = "b"
question = "roughness"
expected = "smoother"
touches = [{ place = "smooth", voltage_v = 100, beam = "1 mm" }]
"""
KINDS = {"baseline", "signal", "practice", "trial", "catch"}


def study(folder: Path, name: str = "paper", *changes: tuple[str, str]) -> str:
    text = template(name)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return str(folder)


def document(capsys: pytest.CaptureFixture[str]) -> Any:
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("name", "size", "balanced"), [("paper", 9, False), ("extended", 20, True)]
)
def test_the_json_keeps_its_contract(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, size: int, balanced: bool
) -> None:
    assert typed("check", study(tmp_path, name), "--json") == 0
    found = document(capsys)
    assert (found["ok"], found["problems"]) == (True, [])
    assert [person["id"] for person in found["participants"]][:2] == ["P01", "P02"]
    assert len(found["participants"]) == size
    assert found["carryover"]["balanced"] == balanced
    assert found["max_voltage_v"] == 200
    assert found["max_frequency_hz"] == 24_221
    assert (found["contrast_law"], found["contrast_rung"]) == ("consistent", "beam")
    for person in found["participants"]:
        assert person["duration_s"] > 60
        assert person["beam_swaps"] >= 3
        assert {trial["kind"] for trial in person["trials"]} <= KINDS
        for trial in person["trials"]:
            predicted = trial["predicted_contrast"]
            assert (predicted is None) == (trial["kind"] == "baseline")
            assert trial["kind"] != "catch" or predicted == 0


def test_the_cohort_may_be_of_another_size(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("check", study(tmp_path), "--participants", "10", "--json") == 0
    found = document(capsys)
    assert found["carryover"]["balanced"]
    assert {n for row in found["carryover"]["counts"] for n in row} == {0, 2}


def test_a_touch_without_its_own_beam_shows_the_studys(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    third = 'voltage_v = 100, beam = "1 mm" }', "voltage_v = 100 }"
    assert typed("check", study(tmp_path, "paper", third)) == 0
    assert "no bodies/1.5 mm/1 mm\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("channel", "said"),
    [
        ("rate_hz = 1000", "touch, 1000 samples/s by the board: 57% of 115,200 baud\nAmplitude"),
        ("rate_hz = 200\ngauge = 'sim'", "200 samples/s by the gauge: 43% of 115,200 baud\nAmp"),
        ("rate_hz = 1000\ngauge = 'sim'", "195% of 115,200 baud\n            (more than a seria"),
    ],
)
def test_what_is_recorded_is_shown_with_what_it_takes_of_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], channel: str, said: str
) -> None:
    place = study(tmp_path, "paper", ("[touch]", f"[force_channel]\n{channel}\n[touch]"))
    assert typed("check", place) == 0
    assert said in capsys.readouterr().out
    assert typed("check", place, "--json") == 0
    recorded = document(capsys)["recorded"]
    assert f"{recorded['line_share']:.0%}" in said
    typed("check", study(tmp_path, "paper"), "--json")
    assert "recorded" not in document(capsys), "nothing is recorded"


def test_a_sliding_experiment_is_shown_with_its_length(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = study(tmp_path, "paper", ("[touch]", "[slide]\nreferences = 1\n[touch]"))
    assert typed("check", place) == 0
    said = "Sliding     9 passes with touchbeam slide, 3.55 min"
    assert said in capsys.readouterr().out.splitlines()
    assert typed("check", place, "--json") == 0
    slide = document(capsys)["slide"]
    assert slide["duration_s"] == pytest.approx(9 * (0.5 + 4 + 2 + 3 + 14.2), abs=0.1)
    drives = [made["drive"] for made in slide["passes"]]
    assert drives[0] == "reference, 0 V"
    assert "23200 Hz" in drives
    typed("check", study(tmp_path, "paper"), "--json")
    assert "slide" not in document(capsys), "nothing is said of one"


RULES = """[exclusions]
max_false_alarms = 0.5
max_missing_scores = 0.25
min_reaction_s = 0.2
max_reaction_s = 8
min_trials = 3
[[opening]]"""


def test_it_says_what_each_rule_of_exclusion_selects(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = study(tmp_path, "paper", ("[[opening]]", RULES))
    assert typed("check", given, "--json") == 0
    rules = document(capsys)["exclusions"]
    assert [(rule["rule"], rule["limit"]) for rule in rules] == [
        ("max_false_alarms", 0.5),
        ("max_missing_scores", 0.25),
        ("min_reaction_s", 0.2),
        ("max_reaction_s", 8),
        ("min_trials", 3),
    ]
    assert {rule["rule"] for rule in rules} == SELECTS.keys() == Exclusions.model_fields.keys()
    assert typed("check", given) == 0
    said = " ".join(capsys.readouterr().out.split())
    for rule in rules:
        assert f"{rule['rule']} = {rule['limit']:g} {rule['selects']}" in said
    assert "0.25 counts trials without an answer; a participant who notices little is kept" in said
    assert typed("check", study(tmp_path)) == 0
    assert "counts trials" not in capsys.readouterr().out, "nothing of a study without rules"


def test_nothing_is_said_of_noticing_where_nobody_is_asked() -> None:
    (rule,) = selections(Exclusions(min_trials=3), asked=False)
    assert rule["selects"] == "counts answered trials, whatever the answers."


def test_a_check_forecasts_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("check", study(tmp_path)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert not any("Intervals" in line for line in lines)
    assert "Pred.: predicted change of ln(friction), positive in the expected" in " ".join(lines)
    assert typed("check", study(tmp_path), "--json") == 0
    assert "minutes_buy" not in document(capsys)


def test_the_preview_is_readable(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert typed("check", study(tmp_path, "extended")) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Plan of the first of 20 participants (session 1)"
    assert any("opposite" in line and "rougher" in line for line in lines)
    assert "Amplitude   up to 200 V (peak); limit 200 V" in lines
    assert "Carry-over  balanced over 20 participants" in lines
    assert lines[2].split()[4:6] == ["peak", "V"]
    assert any("right/left" in line for line in lines)
    assert any("no bodies/1.5 mm/1 mm" in line for line in lines)
    assert max(map(len, lines)) <= 90
    (session,) = [line for line in lines if line.startswith("Session ")]
    assert " 20 scored trials, " in session, "practice is not scored"


def test_conditions_that_never_follow_each_other_are_not_called_balanced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changes = [("[design]", "[design]\nrepeats = 2\ngroup_by_beam = 'session'")]
    text = template("paper").partition("[[condition]]")[0] + TWO_BEAMS
    (tmp_path / "study.toml").write_text(text.replace(*changes[0], 1), encoding="utf-8")
    assert typed("check", str(tmp_path), "--participants", "2", "--json") == 0
    found = document(capsys)["carryover"]
    assert (found["counts"], found["balanced"]) == ([[0, 0], [0, 0]], False)
    assert typed("check", str(tmp_path), "--participants", "2") == 0
    assert (
        "Carry-over  not balanced over 2 participants (no condition directly follows another "
        "within a block): this design cannot balance it" in capsys.readouterr().out
    )


def test_with_a_limit_on_beam_swaps_no_larger_cohort_is_suggested(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = study(tmp_path, "paper", ("[design]", "[design]\nmax_beam_swaps = 6"))
    assert typed("check", changed, "--participants", "9") == 0
    assert "this design cannot balance it" in capsys.readouterr().out


def test_columns_are_aligned_in_chinese_too(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = study(tmp_path, "paper", ('name = "voltage"', 'name = "电压"'))
    assert typed("check", changed) == 0
    rows = [row for row in capsys.readouterr().out.splitlines()[2:10] if "+0." in row]
    begins = {row.index("+0.") + sum(row.count(sign) for sign in "电压") for row in rows}
    assert len(begins) == 1


def test_the_highest_resonance_within_the_limits_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = study(tmp_path, "paper", ("max_slew_v_per_us = 40", "max_slew_v_per_us = 30.44"))
    assert typed("check", changed, "--json") == 0
    highest_hz = document(capsys)["max_resonance_hz"]
    assert highest_hz == pytest.approx(30.44e6 / (2 * math.pi * 200), abs=0.1)
    assert typed("check", changed) == 0
    assert f"above {highest_hz:.0f} Hz a limit would end the session" in capsys.readouterr().out
    run = ("run", changed, "--participant", "P01", "--ratings", "virtual", "--seed")
    assert typed(*run, "2") == 2
    errors = capsys.readouterr().err
    assert_matches(
        r"^touchbeam: the resonance of this beam is 242\d\d Hz: condition voltage", errors
    )
    assert "output off, read back" in errors
    assert typed("verify", changed, "--json") == 0
    (session,) = document(capsys)["sessions"]
    assert (session["state"], session["trials_answered"], session["chain_ok"]) == ("idle", 0, True)


GENERATOR = (
    "[rig]\n",
    '[rig]\ndialect = "keysight"\namplifier_gain = 20\ngenerator_max_vpp = 20\n',
)


def test_a_generator_has_the_resonance_that_is_kept_and_check_counts_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = study(tmp_path, "paper", GENERATOR)
    assert typed("check", changed) == 0
    missing = (
        "Resonance   a keysight device measures none: write it to calibration.json; above 31831"
    )
    assert missing in capsys.readouterr().out
    assert typed("check", changed, "--json") == 0
    assert document(capsys)["resonance"] == {"from": "missing", "hz": 24_221}
    kept = {"frequency_hz": 25_000.0, "tip_m_per_v": 9e-9}
    (tmp_path / "calibration.json").write_text(json.dumps(kept), encoding="utf-8")
    assert typed("check", changed) == 0
    shown = capsys.readouterr().out
    assert "Drive       up to 25000 Hz if the resonance is at 25000 Hz; limit 40000 Hz" in shown
    assert "Slew        up to 31.4 V/us; limit 40 V/us" in shown
    assert "Resonance   25000 Hz (calibration.json); above 31831 Hz a limit would end" in shown
    assert typed("check", changed, "--json") == 0
    found = document(capsys)
    assert found["resonance"] == {"from": "kept", "hz": 25_000}
    assert found["max_frequency_hz"] == 25_000
    assert found["max_slew_v_per_us"] == pytest.approx(2e-6 * math.pi * 25_000 * 200)
    # What a session would refuse is a problem now; a board measures, and does not look at it.
    kept["frequency_hz"] = 32_000.0
    (tmp_path / "calibration.json").write_text(json.dumps(kept), encoding="utf-8")
    assert typed("check", changed, "--json") == 2
    assert all(
        problem["hint"].endswith("at the resonance of calibration.json, 32000 Hz")
        for problem in document(capsys)["problems"]
    )
    assert typed("check", study(tmp_path)) == 0
    assert "Resonance   measured before the first touch; above" in capsys.readouterr().out


def test_where_every_drive_is_in_hz_no_resonance_is_too_high(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = Path(study(tmp_path))
    file = changed / "study.toml"
    text = re.sub(r"(, voltage_v = \d+)", r"\1, frequency_hz = 24200", template("paper"))
    file.write_text(re.sub(r", frequency = [\d.]+", "", text), encoding="utf-8")
    assert typed("check", str(changed)) == 0
    shown = capsys.readouterr().out
    assert "Drive       up to 24200 Hz; limit 40000 Hz" in shown
    assert "Resonance   measured before the first touch; no drive follows it" in shown
    assert typed("check", str(changed), "--json") == 0
    assert document(capsys)["max_resonance_hz"] is None


def test_check_says_what_of_a_language_is_read_in_english(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changed = Path(study(tmp_path, "paper"))
    assert typed("translate", changed, "fr") == 0
    file = changed / "texts" / "fr.toml"
    french = file.read_text(encoding="utf-8").replace('name = "English"', 'name = "French"')
    file.write_text(french.replace('saved = "', 'saved_ = "'), encoding="utf-8")
    assert typed("check", changed) == 2
    file.write_text("".join(line for line in french.splitlines(True) if line[:5] != "saved"))
    capsys.readouterr()
    assert typed("check", changed) == 0
    told = capsys.readouterr().out
    assert "texts/fr.toml lacks saved: read in English until they are added.\n" in told


def test_check_and_run_report_a_text_that_does_not_fit_with_all_other_problems(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long = "[texts.en]\nwelcome = '" + "word " * 400 + "'\n"
    changed = study(
        tmp_path, "paper", ("[rating]", f"{long}[rating]"), ("[design]", "[design]\nx = 1")
    )
    assert typed("check", changed) == 2
    errors = capsys.readouterr().err
    assert "unknown key, got 'x'" in errors
    assert "texts.en.welcome: a text must fit its place on the participant's screen" in errors
    file = tmp_path / "study.toml"
    file.write_text(file.read_text().replace("\nx = 1", ""))
    assert typed("run", changed, "--participant", "P01", "--ratings", "virtual") == 2
    assert "a text must fit its place" in capsys.readouterr().err
    assert not (tmp_path / "study.db").exists()


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("maximum = 7", "maximum = 1", "maximum: must be above minimum = 1, got 1"),
        ("maximum = 7", "maximum = 7\nstep = 100", "step: must divide the 6 from minimum"),
        ("maximum = 7", "maximum = 1e5", "step: a scale must have at most 660 steps"),
        ("at = 7", "at = 9", "labels: must be at places of the scale from 1 to 7, got 9"),
        ('value = "both"', "at = 3", "labels: must each have a value"),
        ('value = "both"', "value = 1", "value: must be a text, got 1"),
    ],
)
def test_a_question_that_cannot_be_drawn_is_refused_for_its_cause_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], before: str, after: str, message: str
) -> None:
    assert before in OWN_QUESTIONS
    text = template("paper") + OWN_QUESTIONS.replace(before, after, 1)
    (tmp_path / "study.toml").write_text(text, encoding="utf-8")
    assert typed("check", tmp_path) == 2
    lines = capsys.readouterr().err.splitlines()
    assert message in lines[0]
    assert not [line for line in lines if "fit its place" in line]


def test_a_study_file_instead_of_its_folder_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study(tmp_path)
    assert typed("check", tmp_path / "study.toml") == 2
    assert "study.toml: must be the folder that contains study.toml, got" in capsys.readouterr().err


def test_a_count_of_one_is_written_in_the_singular(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("check", study(tmp_path), "--participants", "1") == 0
    shown = capsys.readouterr().out
    assert shown.startswith("Plan of the first of 1 participant (session 1)\n")
    assert (
        "Carry-over  not balanced over 1 participant (counts differ by up to 1): use a multiple of "
        "10 participants" in shown
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("ramp_to_v = 200", "ramp_to_v = 201"), "got 201 V; amplitudes are peak"),
        (
            ("voltage_v = 100", "voltage_vpp = 200"),
            "unknown key, got 'voltage_vpp'; amplitudes are",
        ),
        (('beam = "1.5 mm"', 'beam = "2 mm"'), "the beam must be one of [beams], got '2 mm'"),
        (("participants = 9", "repeats = 2\nmax_beam_swaps = 3"), "may need 6 beam swaps"),
        (
            ("smooth_place_m = 0.0414", "smooth_place_m = 0.414"),
            "study.toml:24: touch.smooth_place_m: must lie on the beam, which ends at 0.1 m, "
            "got 0.414 m; that is 414 mm; the beam is 100 mm long",
        ),
        (
            ("path_m = [0.010, 0.081]", "path_m = [0.010, 0.2]"),
            "study.toml:23: touch.path_m.1: must lie on the beam, which ends at 0.1 m, got 0.2 m",
        ),
        (
            ("path_m = [0.010, 0.081]", "path_m = [10, 81]"),
            "study.toml:23: touch.path_m.0: must be at most 1, got 10; in m: 10 mm is 0.01",
        ),
    ],
)
def test_check_and_run_refuse_the_same(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: tuple[str, str],
    message: str,
) -> None:
    folder = study(tmp_path, "paper", change)
    for command in (("check", folder), ("run", folder, "--participant", "P1", "--ratings=virtual")):
        assert typed(*command) == 2
        captured = capsys.readouterr()
        assert message in captured.err
        assert captured.out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]


def test_every_problem_is_listed_by_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    changes = (
        ("ramp_to_v = 200", "ramp_to_v = 201"),
        ("watchdog_s", "watchdg_s"),
        ("0.081]", "0.1001]"),
    )
    folder = study(tmp_path, "paper", *changes)
    assert typed("check", folder) == 2
    first, second, third = capsys.readouterr().err.splitlines()
    assert "study.toml:17: rig.watchdg_s: unknown key" in first
    assert "study.toml:23: touch.path_m.1: must lie on the beam" in second
    assert "study.toml:79: condition voltage, touch 1: " in third
    assert typed("check", folder, "--json") == 2
    found = document(capsys)
    assert not found["ok"]
    assert [problem["line"] for problem in found["problems"]] == [17, 23, 79]
    assert found["problems"][0].keys() >= {"where", "rule", "value", "hint"}


def test_a_text_that_does_not_fit_the_participants_screen_is_listed_by_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = study(tmp_path, "paper", ('en = "no effect"', 'en = "imperceptible"'))
    assert typed("check", folder) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "rating.bands.0.en: a text must fit its place" in line
    assert "got 'imperceptible'; shorten it" in line
    assert ": rating" in line.split("study.toml:")[1]


@pytest.mark.parametrize(
    ("dialect", "shown"),
    [
        (
            "boards",
            "study.toml:11: rig.dialect: must be one of 'board', 'keysight', 'rigol' or 'siglent', "
            "got 'boards'; did you mean 'board'?",
        ),
        ("Keysight", "got 'Keysight'; did you mean 'keysight'?"),
    ],
)
def test_a_dialect_must_have_a_driver(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], dialect: str, shown: str
) -> None:
    folder = study(tmp_path, "paper", ("voltages_are", f'dialect = "{dialect}"\nvoltages_are'))
    assert typed("check", folder) == 2
    assert shown in capsys.readouterr().err
    assert typed("run", folder, "--participant", "P01", "--ratings", "virtual") == 2
    assert shown in capsys.readouterr().err


def test_conditions_without_a_question_are_shown_as_rated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, content in template_pictures("plate").items():
        (tmp_path / name).write_bytes(content)
    assert typed("check", study(tmp_path, "plate")) == 0
    shown = capsys.readouterr().out
    assert "Pred.: predicted ln(friction / that at 0 V), positive where friction rises;" in shown
    told = "1 to 7 (1: very smooth; 7: very rough), at once, also in catch trials"
    assert f"Score       {told}" in " ".join(shown.replace("\n            ", " ").splitlines())
    assert "expectation" not in shown
    assert typed("check", str(tmp_path), "--json") == 0
    trials = document(capsys)["participants"][0]["trials"]
    assert {each["expected"] for each in trials} == {None}
    predicted = {each["condition"]: each["predicted_contrast"] for each in trials if each["level"]}
    assert predicted == pytest.approx(
        {
            "20 V": math.log(0.55 / 0.6),
            "40 V": math.log(0.5 / 0.6),
            "60 V": math.log(0.43 / 0.6),
            "80 V": math.log(0.36 / 0.6),
            "100 V": math.log(0.3 / 0.6),
            None: None,
        }
    )
    assert {each["predicted_contrast"] for each in trials if each["kind"] == "catch"} == {0.0}


def test_a_study_of_another_surface_is_warned_of_what_it_leaves_as_for_the_papers_beam(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, pictures = template("plate"), template_pictures("plate")
    bare = re.sub("nominal_resonance_hz *= .*", "", text.partition("# What participants read")[0])
    for number, (written, warned) in enumerate(((text, False), (bare, True))):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "study.toml").write_text(written, encoding="utf-8")
        for name, content in pictures.items():
            (folder / name).write_bytes(content)
        assert typed("check", str(folder), "--json") == 0
        told = " ".join(document(capsys)["warnings"])
        texts = "give texts.en.welcome, texts.en.stopped, texts.zh.welcome, texts.zh.stopped"
        assert (texts in told) == warned
        assert ("near 24221 Hz, that of the paper's beam" in told) == warned


def test_the_preview_explains_what_stands_in_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, pictures = template("plate"), template_pictures("plate")
    asks = text.replace(
        'kind = "baseline"',
        'kind = "signal"\nquestion = "roughness"\nexpected = "smoother"',
    ).replace("voltage_v = 0, friction = 0.60", "voltage_v = 100, friction = 0.30")
    unknown = re.sub(r", friction = [\d.]+", "", text)
    of_answers = "where an answer is expected, its change, positive in the expected direction;"
    shown = []
    for number, written in enumerate((text, asks, unknown)):
        folder = tmp_path / str(number)
        folder.mkdir()
        (folder / "study.toml").write_text(written, encoding="utf-8")
        for name, content in pictures.items():
            (folder / name).write_bytes(content)
        assert typed("check", str(folder)) == 0
        shown.append(capsys.readouterr().out)
    assert [of_answers in each for each in shown] == [False, True, False]
    assert ["Pred.:" in each for each in shown] == [True, True, False]
    headings = [each.splitlines()[2].split() for each in shown]
    always = ["#", "block", "kind", "condition", "peak", "V", "drive"]
    assert headings == [[*always, "pred."], [*always, "pred.", "expected"], always]


def test_the_papers_beam_is_named_where_no_surface_is_described(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert typed("check", study(tmp_path, "paper")) == 0
    assert "Surface     the paper's beam; [surface] describes another" in capsys.readouterr().out


def plate_checked(folder: Path, *changes: tuple[str, str], options: tuple[str, ...] = ()) -> int:
    """Check the template plate with changes, in a folder with its picture."""
    for name, content in template_pictures("plate").items():
        (folder / name).write_bytes(content)
    return typed("check", study(folder, "plate", *changes), *options)


AT_REST = ", friction = 0.60"


@pytest.mark.parametrize(
    ("changes", "surface", "warned"),
    [
        ((), "friction as touches state it", ""),
        (((AT_REST, ""),), "friction as touches state it", "No touch at 0 V states its friction"),
        (
            (("voltage_v = 20, friction = 0.55", "voltage_v = 0, friction = 0.55"),),
            "friction as touches state it",
            "Touches at 0 V state different frictions, 0.55, 0.6:",
        ),
        (
            ((", friction = 0.43", ""),),
            "friction as touches state it, but in 60 V it does not",
            "",
        ),
        (
            tuple((f", friction = 0.{it}", "") for it in (60, 55, 50, 43, 36, 30)),
            "no touch states its friction: nothing is predicted",
            "",
        ),
    ],
)
def test_what_a_stated_surface_leaves_open_is_said(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    changes: tuple[tuple[str, str], ...],
    surface: str,
    warned: str,
) -> None:
    assert plate_checked(tmp_path, *changes) == 0
    lines = capsys.readouterr().out
    assert f"Surface     given, 100 mm long; {surface}\n" in lines
    told = " ".join(lines.split())
    assert warned in told
    assert ("Warning: " in told) == bool(warned)
    relative = "ln(friction / the mean of what touches state), positive"
    assert (relative in told) == ("No touch" in warned)


def test_friction_is_not_stated_where_levels_multiply_the_amplitude(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = 'name = "100 V"\n'
    assert plate_checked(tmp_path, (name, f"{name}levels = [1.0, 0.5]\n")) == 2
    rule = "friction: must not be stated where levels multiply the amplitude, got 0.3; leave it out"
    assert rule in capsys.readouterr().err
    unknown = (name, f"{name}levels = [1.0, 0.5]\n"), (", friction = 0.30", "")
    assert plate_checked(tmp_path, *unknown) == 0
