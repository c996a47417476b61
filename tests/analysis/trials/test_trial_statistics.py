"""Hits and false alarms count the same event, so that guessing is no discrimination."""

from itertools import product

import pandas as pd
import pytest

from analysis.estimates import NotEstimable
from analysis.loading.study_data import load_study_data
from analysis.report.report import report, report_json
from analysis.trials.trial_checks import Discrimination
from analysis.trials.trial_statistics import catch_answers
from protocol.study.study_question import ANSWERS, Question
from tests.analysis.reports import EXTENDED, ORIGIN, cohort


def row(
    kind: str, question: Question, expected: str, change: str, who: str = "P01"
) -> dict[str, str]:
    """A trial of `who`, as far as hits and false alarms are concerned."""
    return {
        "participant": who,
        "trial_kind": kind,
        "question": question,
        "expected": expected,
        "change": change,
    }


def told(rows: list[dict[str, str]], who: str = "P01") -> Discrimination:
    found = catch_answers(pd.DataFrame(rows)).subjects[who]
    assert isinstance(found, Discrimination)
    return found


@pytest.mark.parametrize(
    ("question", "expected", "unchanged"),
    [
        ("roughness", "smoother", "same"),
        ("strength", "stronger", "same"),
        ("places", "swapped", "not swapped"),
    ],
)
def test_who_gives_each_answer_as_often_discriminates_nothing(
    question: Question, expected: str, unchanged: str
) -> None:
    rows = [
        row(kind, question, expected if kind == "trial" else unchanged, answer)
        for kind, answer in product(("trial", "catch"), ANSWERS[question])
    ]
    found = told(rows)
    changes = len(ANSWERS[question]) - 1
    assert (found.hits.count, found.false_alarms.count) == (changes, changes)
    assert found.d_prime == 0


def test_a_change_in_the_other_direction_is_a_hit() -> None:
    found = told(
        [
            row("trial", "roughness", "smoother", "rougher"),
            row("trial", "roughness", "smoother", "same"),
            row("catch", "roughness", "same", "same"),
        ]
    )
    assert (found.hits.count, found.hits.trials, found.false_alarms.count) == (1, 2, 0)


def test_a_trial_that_expects_no_change_is_no_signal() -> None:
    rows = [
        row("trial", "roughness", "smoother", "smoother"),
        row("trial", "roughness", "same", "same"),
        row("catch", "roughness", "same", "same"),
    ]
    assert told(rows).hits.trials == 1


def test_pooled_trials_of_several_people_have_no_interval() -> None:
    rows = [
        row(kind, "roughness", expected, "smoother", who)
        for kind, expected in (("trial", "smoother"), ("catch", "same"))
        for who in ("P01", "P02")
    ]
    overall = catch_answers(pd.DataFrame(rows)).overall
    assert isinstance(overall, Discrimination)
    assert overall.hits.trials == 2
    assert isinstance(overall.hits.interval, NotEstimable)
    assert isinstance(overall.false_alarms.interval, NotEstimable)
    assert not isinstance(told(rows).hits.interval, NotEstimable)
    own = [entry for entry in rows if entry["participant"] == "P01"]
    alone = catch_answers(pd.DataFrame(own)).overall
    assert isinstance(alone, Discrimination)
    assert not isinstance(alone.hits.interval, NotEstimable)


def test_the_data_say_why_pooled_trials_have_no_interval() -> None:
    found = load_study_data(cohort(EXTENDED, 2), rehearsals=False)
    result = report("a study", found, EXTENDED, ORIGIN)
    answers = report_json(result)["checks"]["catch_trials"]
    assert answers["overall"]["false_alarms"]["interval"] is None
    assert "not independent" in answers["overall"]["false_alarms"]["interval_reason"]
    assert len(answers["subjects"]["P01"]["hits"]["interval"]) == 2
