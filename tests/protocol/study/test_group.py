"""Groups of participants: what a study file says of them, and the streams that they draw from."""

from collections import Counter
from dataclasses import replace

import pytest

from protocol.assertions import assert_balanced
from protocol.plan.plan import cohort_plans, plan
from protocol.preview.preview import Prediction, preview, preview_record
from protocol.preview.text import preview_lines
from protocol.proof.trial_checks import by_group, cohort_problems
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


AGE = """
[[question]]
name = "age"
kind = "number"
when = "desk"
text = { en = "Age?", zh = "\u5e74\u9f84\uff1f" }
"""


def by_age(young: str, old: str, question: str = AGE) -> str:
    """A study whose groups follow from the age."""
    (first, last), design = GROUPS.split("\n[[group]]\n")[-2:], 'assign_groups = "by an answer"'
    whens = (f"when = {{ question = 'age', {rule} }}" for rule in (young, old))
    groups = [f"[[group]]\n{it}\n{when}\n" for it, when in zip((first, last), whens, strict=True)]
    return STUDY.replace("[design]", f"[design]\n{design}") + "".join(groups) + question


BY_LABELS = """
[[question]]
name = "age"
kind = "choice"
when = "desk"
text = { en = "Age?", zh = "\u5e74\u9f84\uff1f" }
labels = [
  { value = "less", en = "less", zh = "\u5c11" },
  { value = "same", en = "same", zh = "\u540c" },
  { value = "more", en = "more", zh = "\u591a" },
]
"""


@pytest.mark.parametrize(
    ("rules", "question", "told"),
    [
        (
            ("is = ['less', 'same']", "is = ['more', 'same']"),
            BY_LABELS,
            "group old, when: must not be met by an answer that leads to young, got 'same'",
        ),
        (
            ("at_most = 30", "at_least = 31"),
            AGE.replace('"age"', '"years"'),
            "must name a question of the operator's desk, got 'age'; known: years",
        ),
        (("at_most = 30", "at_least = 20"), AGE, "that leads to young, got 20 to 30"),
        (("at_most = 30", "at_most = 9"), AGE, "that leads to young, got 9"),
        (("at_most = 30", "at_least = 30.5, at_most = 30.9"), AGE, "at_most, within the numbers"),
        (
            ("at_most = 30", "at_least = 31"),
            AGE + "required = false\n",
            "group young, when: must name a question that cannot be skipped, got 'age'; leave",
        ),
    ],
)
def test_each_answer_leads_to_one_group(rules: tuple[str, str], question: str, told: str) -> None:
    with pytest.raises(StudyError) as refused:
        parsed_study(by_age(*rules, question))
    assert told in str(refused.value)


def test_an_answer_to_what_every_operator_is_asked_leads_to_one_group_too() -> None:
    text = by_age("at_most = 30", "at_least = 30", "").replace("'age'", "'humidity'")
    with pytest.raises(StudyError, match="an answer that leads to young, got 30"):
        parsed_study(text.replace("[design]", '[session]\noperator_asks = ["humidity"]\n[design]'))


@pytest.mark.parametrize(
    ("rules", "ends", "left"),
    [
        (("at_most = 30", "at_least = 30.5"), "", ""),
        (("at_most = 30", "at_least = 60"), "", "31 to 59"),
        (("at_most = 30", "at_least = 32"), "minimum = 18\nmaximum = 99\n", "31"),
        (
            ("at_least = 20, at_most = 30", "at_least = 31, at_most = 99"),
            "",
            "19 or less, 100 or more",
        ),
    ],
)
def test_answers_that_lead_to_no_group_are_told(
    rules: tuple[str, str], ends: str, left: str
) -> None:
    study = parsed_study(by_age(*rules, AGE + ends))
    model = Prediction(law="consistent", rung="none", contrast=lambda _: None)
    (*_, told) = [
        line for line in preview_lines(preview(study, 2), model) if "group is" in line
    ] or [""]
    assert told.removeprefix("Groups      no group is for people whose answer to age is ") == left


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


def test_a_preview_tells_groups_in_the_order_of_the_file() -> None:
    names = ["e", "d", "c", "b", "a"]
    study = parsed_study(STUDY + "".join(f'[[group]]\nname = "{it}"\nsize = 2\n' for it in names))
    model = Prediction(law="consistent", rung="none", contrast=lambda _: None)
    told = [
        line for line in preview_lines(preview(study, 10), model) if "2 participants of" in line
    ]
    assert [line.partition(" of ")[2][0] for line in told] == names


@pytest.mark.parametrize("number", [2, 3, 4, 5])
@pytest.mark.parametrize("conditions", [4, 5])
def test_orders_are_balanced_within_each_of_2_to_5_groups(number: int, conditions: int) -> None:
    """Each condition follows every other equally often, and comes equally often at each place."""
    cycle = conditions if conditions % 2 == 0 else 2 * conditions
    sizes = [cycle * (1 + group % 3) for group in range(number)]
    groups = "".join(
        f'[[group]]\nname = "{group}"\nsize = {size}\n' for group, size in enumerate(sizes)
    )
    *_, last = STUDY.rpartition("[[condition]]")
    text = STUDY if conditions == 5 else STUDY.removesuffix(f"[[condition]]{last}")
    study = parsed_study(text + groups)
    plans = cohort_plans(study, sum(sizes))
    assert cohort_problems(study, plans) == []
    assert_balanced(study, plans)
    found = by_group(plans)
    assert [len(found[group]) for group in study.groups] == sizes
    for group, size in zip(study.groups, sizes, strict=True):
        own = found[group]
        assert {each.slot for each in own} == set(range(size))
        for place in range(conditions):
            at_place = Counter(each.sequence[place] for each in own)
            assert set(at_place.values()) == {size // conditions}
    # A row that the proof counts for another group leaves both unbalanced.
    (first, *_), *others = found.values()
    moved = replace(first, group=others[0][0].group)
    assert cohort_problems(study, [moved if each is first else each for each in plans])


def test_a_preview_shows_the_balance_of_each_group() -> None:
    study = parsed_study(STUDY + GROUPS)
    model = Prediction(law="consistent", rung="none", contrast=lambda _: None)
    shown = preview(study, 18)
    lines = list(preview_lines(shown, model))
    first = next(number for number, line in enumerate(lines) if line.startswith("Carry-over"))
    counts = "counts differ by up to 1"
    advice = "use a multiple of 10 participants"
    assert lines[first] == (
        f"Carry-over  not balanced over 8 participants of young ({counts}): {advice}"
    )
    assert lines[first + 1] == "            balanced over 10 participants of old"
    record = preview_record(shown, model)
    assert [(each["name"], each["participants"]) for each in record["groups"]] == [
        ("young", 8),
        ("old", 10),
    ]
    assert [each["promised"] for each in record["groups"]] == [False, True]
    assert not record["carryover"]["promised"]
    assert [each["id"] for each in record["participants"]] == [f"P{n:02d}" for n in range(1, 19)]
    assert {each["group"] for each in record["participants"]} == {"young", "old"}
    alone = preview_record(preview(parsed_study(STUDY), 2), model)
    assert "groups" not in alone
    assert "group" not in alone["participants"][0]
