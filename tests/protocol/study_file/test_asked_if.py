"""A question that depends on an answer: when it is asked, and when it never could be."""

import re
from collections.abc import Mapping

import pytest

from protocol.study.study_question import Answer, AskedIf, facts_of_trial
from protocol.study_file.loading import StudyError, parsed_study, template

DEPENDENT = """
[[question]]
name = "gloves"
kind = "choice"
when = "before"
text = {{ en = "Do you wear gloves?", zh = "您戴手套吗？" }}
labels = [
  {{ value = "yes", en = "yes, I do", zh = "是的" }},
  {{ value = "no", en = "no, I do not", zh = "不是" }},
]
[[question]]
name = "sure"
kind = "number"
minimum = 0
maximum = 10
conditions = ["voltage"]
text = {{ en = "How sure are you?", zh = "您有多确定？" }}
[[question]]
name = "why"
kind = "text"
{when}
text = {{ en = "Why?", zh = "为什么？" }}
asked_if = {rule}
"""


def problems(rule: str, when: str = "") -> list[str]:
    with pytest.raises(StudyError) as refused:
        parsed_study(template("paper") + DEPENDENT.format(rule=rule, when=when))
    return [str(each) for each in refused.value.problems]


@pytest.mark.parametrize(
    ("rule", "when", "message"),
    [
        ('{ question = "glove", is = ["yes"] }', "", "asked_if: must name a question before this"),
        (
            '{ question = "why", is = ["yes"] }',
            "",
            "asked_if: must name a question before this one",
        ),
        ('{ question = "gloves", is = ["yess"] }', "", "must say `is`, of the answers to gloves"),
        ('{ question = "gloves" }', "", "must say `is`, of the answers to gloves, got nothing"),
        ('{ question = "gloves", at_least = 1 }', "", "must say `is`, of the answers to gloves"),
        (
            '{ question = "change", is = ["swapped"] }',
            'conditions = ["voltage"]',
            "to what its conditions ask, got 'swapped'; known: smoother, rougher, same",
        ),
        ('{ question = "noticed", is = ["maybe"] }', "", "to noticed, got 'maybe'; known: no, yes"),
        (
            '{ question = "score", at_least = 11 }',
            "",
            "within the numbers that answer score, got 11",
        ),
        ('{ question = "sure", at_most = -1 }', "", "within the numbers that answer sure, got -1"),
        ('{ question = "sure", at_least = 1.2, at_most = 1.8 }', "", "answer sure, got 1.2, 1.8"),
        ('{ question = "sure", is = ["1"] }', "", "must say at_least or at_most"),
        (
            '{ question = "sure", at_least = 3, at_most = 2 }',
            "",
            "at_least must not be above at_most, got 3, 2",
        ),
        ('{ question = "sure", at_least = 3 }', 'when = "after"', "when: must be 'trial' as that"),
        (
            '{ question = "noticed", is = ["yes"] }',
            'when = "block"',
            "when: must be 'trial' as that",
        ),
        ('{ question = "sure", at_least = 3 }', 'conditions = ["pressure"]', "share one with sure"),
        ('{ qestion = "sure", at_least = 3 }', "", "did you mean 'question'"),
    ],
)
def test_a_question_that_can_never_be_asked_is_refused(rule: str, when: str, message: str) -> None:
    assert any(re.search(re.escape(message), told) for told in problems(rule, when)), problems(
        rule, when
    )


@pytest.mark.parametrize(
    ("rule", "given", "asked"),
    [
        ({"is": ("yes",)}, {"q": "yes"}, True),
        ({"is": ("yes",)}, {"q": "no"}, False),
        ({"is": ("a", "b")}, {"q": ["c", "b"]}, True),
        ({"is": ("a",)}, {"q": None}, False),
        ({"is": ("a",)}, {}, False),
        ({"at_least": 5.0}, {"q": 5}, True),
        ({"at_least": 5.0}, {"q": 4.9}, False),
        ({"at_least": 2.0, "at_most": 3.0}, {"q": 3.1}, False),
        ({"at_least": 0.0}, {"q": None}, False),
    ],
)
def test_an_answer_decides(
    rule: Mapping[str, object], given: dict[str, Answer], asked: bool
) -> None:
    assert AskedIf.model_validate({"question": "q", **rule}).met_by(given) is asked


def test_a_trial_tells_what_was_noticed() -> None:
    assert facts_of_trial("roughness", "rougher", "smoother", None) == {
        "change": "rougher",
        "noticed": "yes",
        "agrees": "no",
        "score": None,
    }
    assert facts_of_trial("places", "not swapped", "swapped", None)["noticed"] == "no"
    assert facts_of_trial(None, None, None, None) == {}
