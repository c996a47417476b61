"""Groups of participants: what a study file says of them, and the streams that they draw from."""

import pytest

from protocol.plan.plan import plan
from protocol.study_file.loading import StudyError, parsed_study, template

GROUPS = """
[[group]]
name = "young"
size = 8
[[group]]
name = "old"
size = 10
"""
# The template plans its own cohort.
STUDY = template("paper").replace("\nparticipants = 9 ", "\n# ")


def test_a_cohort_is_as_large_as_its_groups() -> None:
    study = parsed_study(STUDY + GROUPS)
    assert study.groups == ("young", "old")
    assert study.design.participants == 18
    assert study.of_group(None) is study


def test_each_group_draws_from_streams_of_its_own_and_leaves_the_study_its_own() -> None:
    alone, study = parsed_study(STUDY), parsed_study(STUDY + GROUPS)
    slots = range(40)
    young, old = ([plan(study.of_group(name), slot) for slot in slots] for name in study.groups)
    assert all(len(one.trials) == len(other.trials) for one, other in zip(young, old, strict=True))
    assert [one.sequence for one in young] != [other.sequence for other in old]
    assert [plan(study, slot) for slot in slots] == [plan(alone, slot) for slot in slots]


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (GROUPS.replace("old", "Young"), "names must differ by more than case and spaces"),
        (GROUPS.partition('[[group]]\nname = "old')[0], "group: must be 2 or more groups, got 1"),
        (GROUPS.replace("size = 10", "size = 0"), "group old, size: must be at least 1, got 0"),
        (
            GROUPS + 'when = { question = "humidity", at_least = 5 }',
            'group old, when: must not be given unless design.assign_groups = "by an answer"',
        ),
    ],
)
def test_what_groups_cannot_be_is_told(changed: str, told: str) -> None:
    with pytest.raises(StudyError) as refused:
        parsed_study(STUDY + changed)
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("design", "told"),
    [
        ("participants = 20", "design.participants: must be 18, as many as in the groups together"),
        ('assign_groups = "by an answer"', "group young, when: must be given where"),
    ],
)
def test_a_design_must_fit_its_groups(design: str, told: str) -> None:
    text = STUDY.replace("[design]", f"[design]\n{design}") + GROUPS
    with pytest.raises(StudyError) as refused:
        parsed_study(text)
    assert told in str(refused.value)


def test_no_group_is_assigned_at_random_where_there_is_none() -> None:
    text = STUDY.replace("[design]", '[design]\nassign_groups = "at random"')
    with pytest.raises(StudyError, match=r"group: must be 2 or more groups, got 0"):
        parsed_study(text)


def test_a_question_may_be_called_group_only_without_groups() -> None:
    asked = """
[[question]]
name = "group"
kind = "text"
when = "before"
text = { en = "Which group?", zh = "\u54ea\u4e00\u7ec4\uff1f" }
"""
    parsed_study(STUDY + asked)
    with pytest.raises(StudyError, match="a question must have a name of its own"):
        parsed_study(STUDY + asked + GROUPS)
