"""Studies for tests: small ones by hand, and random ones that fit the schema."""

from typing import Any

from hypothesis import strategies as st

from protocol.study.study import Study

Document = dict[str, Any]

OWN_QUESTIONS = """
[[question]]
name = "pleasantness"
kind = "scale"
text = { en = "How pleasant was the last touch?", zh = "最后一次触摸有多舒适？" }
minimum = 1
maximum = 7
labels = [
  { at = 1, en = "very unpleasant", zh = "非常不舒适" },
  { at = 4, en = "neither", zh = "一般" },
  { at = 7, en = "very pleasant", zh = "非常舒适" },
]

[[question]]
name = "confidence"
kind = "analogue"
conditions = ["voltage", "pressure"]
text = { en = "How sure are you of your answer?", zh = "您对回答有多确定？" }
labels = [
  { at = 0, en = "a mere guess", zh = "纯属猜测" },
  { at = 100, en = "completely sure", zh = "完全确定" },
]

[[question]]
name = "sensations"
kind = "several"
when = "block"
text = { en = "What did you feel?", zh = "您感觉到了什么？" }
labels = [
  { value = "vibration", en = "vibration", zh = "振动" },
  { value = "warmth", en = "warmth", zh = "温热" },
  { value = "sticking", en = "sticking", zh = "粘滞" },
  { value = "slipping", en = "slipping", zh = "打滑" },
  { value = "none", en = "none of these", zh = "都没有" },
]

[[question]]
name = "hand"
kind = "choice"
when = "before"
sessions = "first"
text = { en = "Which hand do you write with?", zh = "您用哪只手写字？" }
labels = [
  { value = "left", en = "the left one", zh = "左手" },
  { value = "right", en = "the right one", zh = "右手" },
  { value = "both", en = "both", zh = "两只手" },
]

[[question]]
name = "age"
kind = "number"
when = "before"
sessions = "first"
text = { en = "How old are you?", zh = "您的年龄？" }
minimum = 18
maximum = 99
unit = "years"

[[question]]
name = "remarks"
kind = "text"
when = "after"
required = false
text = { en = "Is there anything that you would like to tell us?", zh = "您有什么想告诉我们的吗？" }
max_length = 120
"""
"""One question of each kind, to be appended to the paper's study."""


def small(conditions: int = 2, beams: int = 1, **design: object) -> Study:
    """A study of ramps on so many conditions, the last ones on other beams."""
    return Study.model_validate(small_document(conditions, beams, **design))


def small_document(conditions: int = 2, beams: int = 1, **design: object) -> Document:
    return {
        "study": {"name": "small"},
        "touch": {"beam": "b0"},
        "beams": {f"b{number}": 0.001 for number in range(beams)},
        "design": design,
        "timing": {"max_session_s": 14_400},
        "condition": [
            {
                "name": f"c{number}",
                "question": "roughness",
                "expected": "smoother",
                "touches": [
                    {
                        "place": "smooth",
                        "voltage_v": 0,
                        "ramp_to_v": 50 + number,
                        "beam": f"b{max(0, number - conditions + beams)}",
                    }
                ],
            }
            for number in range(conditions)
        ],
    }


def rated(conditions: int = 2, **design: object) -> Study:
    """A study whose conditions have no question: what is felt is scored at once."""
    document = small_document(conditions, 1, **design)
    for condition in document["condition"]:
        del condition["question"], condition["expected"]
    return Study.model_validate(document)


def unasked(text: str) -> str:
    """A study file without the questions of its conditions, and without what needs them."""
    opening, *conditions = text.split("[[condition]]")
    needs = ("max_false_alarms", "opposite_repeats", "score_when")
    asks = ("question =", "expected =")
    parts = [(opening, needs), *((condition, asks) for condition in conditions)]
    kept = (
        "\n".join(line for line in part.split("\n") if not line.startswith(out))
        for part, out in parts
    )
    return "[[condition]]".join(kept)


_SANE_TOUCH = st.fixed_dictionaries(
    {
        "place": st.sampled_from(["path", "smooth"]),
        "voltage_v": st.sampled_from([0, 60, 100, 160]),
    },
    optional={
        "ramp_to_v": st.sampled_from([0, 100, 160]),
        "frequency": st.sampled_from([0.9, 1.0]),
        "sweep_to": st.sampled_from([0.95, 1.0]),
        "direction": st.sampled_from(["right", "left"]),
        "coverage": st.sampled_from(["local", "full"]),
        "press": st.sampled_from([0.5, 1.5]),
        "beam": st.sampled_from(["a", "b", "c"]),
        "duration_s": st.sampled_from([1.0, 2.0]),
    },
)
_WILD_TOUCH = st.fixed_dictionaries(
    {"place": st.just("smooth"), "voltage_v": st.sampled_from([0, 100, 200, 201, 400])},
    optional={
        "ramp_to_v": st.sampled_from([100, 200, 230]),
        "frequency": st.sampled_from([1.5, 1.8]),
        "sweep_to": st.sampled_from([1.0, 1.7]),
        "beam": st.sampled_from(["a", "gone"]),
        "duration_s": st.sampled_from([0.2, 29.0, 40.0]),
    },
)
_ANSWERS = st.sampled_from(
    [("roughness", "smoother"), ("roughness", "rougher"), ("strength", "stronger"),
     ("strength", "same"), ("places", "swapped")]
)  # fmt: skip
_DESIGN = st.fixed_dictionaries(
    {},
    optional={
        "order": st.sampled_from(["williams", "blocks", "random", "fixed"]),
        "max_alike_in_row": st.integers(1, 6),
        "practice_trials": st.integers(0, 4),
        "catch_trials": st.integers(0, 3),
        "catch_apart": st.integers(1, 2),
        "group_by_beam": st.sampled_from(["no", "block", "session"]),
        "max_beam_swaps": st.integers(0, 90),
        "break_every_blocks": st.integers(0, 2),
    },
)
_WILD_RIG = st.fixed_dictionaries(
    {},
    optional={
        "max_voltage_v": st.sampled_from([100, 200]),
        "max_slew_v_per_us": st.sampled_from([20, 40]),
        "amplifier_gain": st.sampled_from([10.0, 40.0]),
        "max_drive_s": st.sampled_from([3, 30]),
    },
)


@st.composite
def documents(draw: st.DrawFn) -> Document:
    """Documents that fit the schema; some want what the rig or the design does not allow."""
    wild = draw(st.integers(0, 3)) == 0
    touch = _WILD_TOUCH | _SANE_TOUCH if wild else _SANE_TOUCH
    repeats = draw(st.sampled_from([1, 2, 4, 6]))
    levels = [[1.0], [0.5, 1.2][: min(repeats, 2)], [0.3, 0.3, 1.0] if wild else [1.1]]
    conditions = []
    for number in range(draw(st.integers(1, 5))):
        question, expected = draw(_ANSWERS)
        conditions.append(
            {
                "name": f"c{number}",
                "question": question,
                "expected": expected,
                "levels": draw(st.sampled_from(levels)),
                "touches": draw(st.lists(touch, min_size=1, max_size=3)),
            }
        )
    turned = draw(st.integers(0, min(2, repeats - 1)))
    return {
        "study": {"name": "drawn", "seed": draw(st.integers(0, 9))},
        "rig": draw(_WILD_RIG) if wild else {},
        "touch": {"beam": "a"},
        "beams": {"a": 0.001, "b": 0.0, "c": 0.0015},
        "design": {**draw(_DESIGN), "repeats": repeats, "opposite_repeats": turned},
        "timing": {"max_session_s": 14_400},
        "opening": [{"kind": "baseline", "touches": [{"place": "smooth", "voltage_v": 0}]}],
        "condition": conditions,
    }


TRACKS = """
[study]
name = "tracks"

[touch]
hold_s = 1.0

[session]
language = "en"

[design]
tracks = "interleaved"
track_block = 8

[[track]]
name = "stairs"
task = "two intervals"
method = "staircase"
axis = "voltage"
levels = { from = 10, to = 100, count = 11, spaced = "equal ratios" }
standard = { place = "smooth", voltage_v = 0 }
comparison = { place = "smooth" }
rule = "1 down 1 up"
step_levels = [1]
up_step_levels = [2]
trials = 9
stop = { reversals = 4 }
catch = 2
easy = 1

[[track]]
name = "felt"
task = "yes or no"
method = "constant"
axis = "voltage"
levels = { values = [20, 40, 80] }
standard = { place = "smooth", voltage_v = 0 }
comparison = { place = "smooth" }
trials = 6
catch = 2

[[track]]
name = "odd one"
task = "three intervals"
method = "quest+"
axis = "voltage"
levels = { from = 10, to = 100, count = 11, spaced = "equal ratios" }
standard = { place = "smooth", voltage_v = 0 }
comparison = { place = "smooth" }
trials = 7
feedback = true
"""
"""A study of three short tracks without conditions, one for each task."""
