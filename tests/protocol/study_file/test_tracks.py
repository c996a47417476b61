"""What is wrong with a track is said in one line, with its place and a remedy."""

import pytest

from protocol.study_file.loading import StudyError, parsed_study, template

TEXT = template("threshold")


def refused(*changes: tuple[str, str]) -> str:
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new, 1)
    with pytest.raises(StudyError) as caught:
        parsed_study(text)
    assert len(caught.value.problems) == 1, caught.value.problems
    line = str(caught.value)
    place = int(line.split(":")[1])
    key = caught.value.problems[0].path[2] if len(caught.value.problems[0].path) > 2 else "track"
    assert str(key) in text.splitlines()[place - 1] or "[[track]]" in text.splitlines()[place - 1]
    return line.partition(": ")[2]


TASK = 'task = "two intervals"'
QUEST = 'method = "quest+"'
LEVELS = 'levels = { from = 4, to = 160, count = 41, spaced = "equal ratios" }'
STANDARD = 'standard = { place = "smooth", voltage_v = 0 }\n'
COMPARISON = 'comparison = { place = "smooth" }'
IN_HZ = 'comparison = { place = "smooth", sweep_to_hz = 24000 }'
GRID = "to = 158.11, count = 31"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            [(LEVELS, LEVELS.replace("160", "240"))],
            "track smallest amplitude, levels: the amplitude must not exceed rig.max_voltage_v = "
            "200 V, got 240 V; amplitudes are peak, not peak-to-peak: 240 V peak-to-peak is 120 V",
        ),
        (
            [(LEVELS, LEVELS.replace("from = 4", "from = 0"))],
            "track smallest amplitude, levels: must not begin or end at 0 in equal ratios, got 0; "
            'begin above 0, or write spaced = "equal steps"',
        ),
        (
            [(LEVELS, LEVELS.replace("from = 4", "from = 5e-324"))],  # 160 times over is no number
            "track smallest amplitude, levels: must be at least 2, and differ, got 1 level: "
            "4.94066e-324; give more levels, each once",
        ),
        (
            [(COMPARISON, IN_HZ)],
            "track smallest amplitude, comparison: must hold one drive relative to the resonance, "
            "got sweep_to_hz; leave ramp_to_v, sweep_to, sweep_to_hz and frequency_hz out",
        ),
        (
            [(LEVELS, "levels = { from = 4, to = 160 }")],
            "track smallest amplitude, levels: must have from, to and count, or values, got "
            'neither; such as { from = 5, to = 100, count = 27, spaced = "equal ratios" }',
        ),
        (
            [(LEVELS, "levels = { values = [5, 10, 5] }")],
            "track smallest amplitude, levels: must be at least 2, and differ, got 5, 10, 5; give "
            "more levels, each once",
        ),
        (
            [(STANDARD, 'standard = { place = "smooth", voltage_v = 50 }\n')],
            "track smallest amplitude, levels: must all be on one side of the standard at 50, and "
            "none there, got 4 to 160; where nothing differs no answer is right; catch trials have "
            "the standard",
        ),
        (
            [(STANDARD, 'standard = { place = "smooth" }\n')],
            'track smallest amplitude, standard: must give voltage_v, because axis = "voltage", '
            "got none; the levels are on one side of the standard's",
        ),
        (
            [(STANDARD, "")],
            'track smallest amplitude, standard: must be given where task = "two intervals", got '
            'nothing; such as standard = { place = "smooth", voltage_v = 0 }',
        ),
        (
            [(COMPARISON, 'comparison = { place = "smooth", voltage_v = 20 }')],
            "track smallest amplitude, comparison, voltage_v: must not give voltage_v, which axis "
            '= "voltage" fills in, got 20.0; leave it out; levels has the values',
        ),
        (
            [
                ('axis = "voltage"', 'axis = "frequency"'),
                (LEVELS, "levels = { from = 0.97, to = 1.03, count = 8 }"),
                (STANDARD, 'standard = { place = "smooth", voltage_v = 100, frequency = 0.96 }\n'),
                (COMPARISON, 'comparison = { place = "smooth", voltage_v = 100 }'),
            ],
            "track smallest amplitude, levels: must lie on one side of the resonance, together "
            "with the standard, got 0.97 to 1.03; friction is not monotone across 1.0: make a "
            "track of each side",
        ),
        (
            [("threshold_at = 0.75", "threshold_at = 0.4")],
            "track smallest amplitude, threshold_at: must lie above chance, 0.5 in two intervals, "
            "and below what lapses leave, 0.92, got 0.4; half-way from chance to 1 is 0.75, the "
            "default",
        ),
        (
            [("stop = { reversals = 12 }", "stop = { reversals = 40 }")],
            "track by a staircase, stop, reversals: cannot be reached: trials = 60 gives at most "
            "29, got 40; ask for fewer reversals, or give more trials",
        ),
        (
            [("threshold_at = 0.75", "stop = { reversals = 4 }")],
            'track smallest amplitude, stop, reversals: cannot be reached: method = "quest+" has '
            "none, got 4; leave it out",
        ),
        (
            [("threshold_at = 0.75", "stop = { interval_db = 0.5 }")],
            "track smallest amplitude, stop, interval_db: cannot be reached: neighbouring levels "
            "are 0.801 dB apart, got 0.5; give more levels, or a wider one",
        ),
        (
            [("step_db = [4, 4, 1]", "step_db = [4, 2.5, 1]")],
            "track by a staircase, step_db: must be whole steps of the levels, which are 1 dB "
            "apart, got 2.5 dB; nearest: levels = { from = 5, to = 158.11, count = 61 }",
        ),
        (
            [(GRID, "to = 160, count = 27")],
            "track by a staircase, step_db: must be whole steps of the levels, which are 1.158 dB "
            "apart, got 4 dB; nearest: levels = { from = 5, to = 158.114, count = 31 }",
        ),
        (
            [('rule = "3 down 1 up"\n', "")],
            "track by a staircase, rule: must be given for a staircase, got nothing; such as rule "
            '= "3 down 1 up", which converges to 0.794 correct',
        ),
        (
            [(LEVELS, "levels = { from = 50, to = 50, count = 1 }")],
            "track smallest amplitude, levels: must be at least 2, and differ, got 1 level: 50; "
            "give more levels, each once",
        ),
        (
            [(LEVELS, "levels = { from = 50, to = 50.0000000001, count = 200 }")],
            "track smallest amplitude, levels: must differ from each other by 1 in 1,000,000, and "
            "from the standard, got 50 to 50.0000000001; give fewer levels, or a wider range",
        ),
        (
            [(LEVELS, "levels = { from = 1e-300, to = 100, count = 20 }")],
            "track smallest amplitude, levels: must differ from each other by 1 in 1,000,000, and "
            "from the standard, got 1e-300 to 100; give fewer levels, or a wider range",
        ),
        (
            [('rule = "3 down 1 up"', 'rule = "2 down 2 up"')],
            "track by a staircase, rule: must converge to a share above 0.5 and below what lapses "
            'leave, got "2 down 2 up", 0.5000; more correct answers down, fewer errors up: such as '
            '"3 down 1 up", 0.794',
        ),
        (
            [('rule = "3 down 1 up"', 'rule = "1 up 3 down"')],
            'track by a staircase, rule: must be "N down M up", each from 1 to 9, such as "3 down '
            "1 up\", got '1 up 3 down'",
        ),
        (
            [("step_db = [4, 4, 1]", "step_db = [100]")],
            "track by a staircase, step_db: must be at most 30 dB, from the first level to the "
            "last, got 100 dB",
        ),
        (
            [("step_db = [4, 4, 1]", "step_levels = [400]")],
            "track by a staircase, step_levels: must be at most 30, from the first level to the "
            "last, got 400",
        ),
        (
            [("step_db = [4, 4, 1]", "step_levels = [1.5]")],
            "track by a staircase, step_levels 1: must be a whole number, got 1.5",
        ),
        (
            [("threshold_at = 0.75", "lapse = [0.5, 0.6]")],
            "track smallest amplitude, lapse: must be below 0.5, got 0.6; nobody measures a "
            "threshold with more",
        ),
        (
            [("threshold_at = 0.75", "lapse = [0.2, 0.3]")],
            "track smallest amplitude, lapse: must be below 0.25, so that the threshold's share "
            "can be reached, got 0.3; or write a lower threshold_at",
        ),
        (
            [(TASK, 'task = "yes or no"'), ("threshold_at = 0.75", "threshold_at = 0.01")],
            "track smallest amplitude, threshold_at: must lie above false alarms, 0.02, and below "
            "what lapses leave, 0.92, got 0.01; half-way from chance to 1 is 0.5, the default",
        ),
        (
            [("threshold_at = 0.75", "slope = [1, 1e300]")],
            "track smallest amplitude, slope 2: must be at most 1000000, got 1e+300",
        ),
        (
            [(COMPARISON, 'comparison = { place = "smooth", beam = "xx" }')],
            "track smallest amplitude, comparison: the beam must be one of [beams], got 'xx'; "
            "name it in [beams] with the spacing of its ciliary bodies in m, or leave it out",
        ),
        (
            [(QUEST, 'method = "constant"')],
            "track smallest amplitude, trials: must be a multiple of the 41 levels of constant "
            "stimuli, got 40; such as 41",
        ),
        (
            [(QUEST, 'method = "limits"')],
            'track smallest amplitude, task: must be "yes or no" where method = "limits", got '
            "'two intervals'; a series ends where the answer changes, and a guess would end it: "
            "take a staircase",
        ),
        (
            [(QUEST, QUEST + "\nstep_db = [1]")],
            "track smallest amplitude, step_db: is for staircases, got (1.0,); leave it out, or "
            'write method = "staircase"',
        ),
        (
            [("stop = { reversals", "start = 100\nstop = { reversals")],
            "track by a staircase, start: must be one of the levels, got 100.0; nearest: 99.761",
        ),
        (
            [('name = "by a staircase"', 'name = "Smallest amplitude"')],
            "track: names must differ by more than case and spaces, got 'Smallest amplitude' "
            "beside 'smallest amplitude'; rename one",
        ),
    ],
)
def test_a_wrong_track_is_told_with_its_place_and_a_remedy(
    changes: list[tuple[str, str]], said: str
) -> None:
    assert refused(*changes) == said


def test_of_a_track_that_cannot_be_read_only_that_is_told() -> None:
    first = TEXT[: TEXT.index("[[track]]", TEXT.index("[[track]]") + 1)]
    with pytest.raises(StudyError) as caught:
        parsed_study(first.replace(LEVELS, ""))
    (problem,) = caught.value.problems
    assert problem.path == ("track", 0, "levels")


def test_a_misspelt_key_of_a_track_hides_no_other_problem() -> None:
    text = TEXT.replace("trials = 40", "trails = 40").replace("to = 160", "to = 240")
    with pytest.raises(StudyError) as caught:
        parsed_study(text)
    said = [str(problem) for problem in caught.value.problems]
    assert any("did you mean 'trials'?" in line for line in said)
