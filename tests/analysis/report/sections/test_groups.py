"""The section on groups, the paragraph in front and the hypotheses about them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from analysis.loading.study_data import StudyData, Why, load_study_data
from analysis.loading.study_lock import StudyLock
from analysis.report.hypotheses import how_tested
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.results import GROUPS, TOGETHER, paragraphs
from analysis.report.sections.registration import marked, named_results
from analysis.statistics.groups import CLAIMED, SCORE
from device.friction.changes import LAW, RUNG
from protocol.journal.events import Answered, SessionOpened, TrialExcluded
from protocol.registration.registration import Registration, between
from protocol.study.factor import Group
from tests.analysis.chains import BEGAN, chain
from tests.analysis.reports import EXTENDED, ORIGIN, made, session_events

PLANNED = {"young": 7, "old": 5}
STUDY = EXTENDED.model_copy(
    update={"group": tuple(Group(name=name, size=size) for name, size in PLANNED.items())}
)
NOBODYS = 12
"""The participant who has no group."""


def grouped(rise: int, gone: str = "") -> StudyData:
    """Sessions of 12 people in groups and of one in none; the old score higher by `rise`.

    The first one's trials of the condition `gone` are excluded.
    """
    rng = np.random.default_rng(5)
    chains = []
    for number in range(13):
        first, *others = session_events(EXTENDED, number, rng)
        group = None if number == NOBODYS else "old" if number % 2 or number == 10 else "young"
        assert isinstance(first, SessionOpened)
        others = [
            replace(event, score=min(10, event.score + rise * (group == "old")))
            if isinstance(event, Answered) and event.score is not None
            else event
            for event in others
        ]
        excluded = [
            TrialExcluded(index=trial.index, reason="a noise")
            for trial in first.trials
            if trial.condition == gone and trial.kind == "trial" and not number
        ]
        chains.append(chain([replace(first, group=group), *others, *excluded]))
    return load_study_data(chains, rehearsals=False, rules=EXTENDED.exclusions)


def made_of(data: StudyData) -> Report:
    return report("a study", data, STUDY, replace(ORIGIN, alone=True), shown=("groups",))


@cache
def of_rise(rise: int) -> Report:
    return made_of(grouped(rise))


def test_a_study_without_groups_has_neither_section_nor_key_nor_paragraph() -> None:
    found = made()
    assert found.groups is None
    assert "groups" not in report_json(found)
    assert 'id="h-groups"' not in report_html(found)
    assert GROUPS not in dict(paragraphs(found))


def test_a_higher_group_is_found_and_told() -> None:
    found = of_rise(3)
    told = report_json(found)["groups"]
    assert told["people"] == [
        {"name": "young", "planned": 7, "took_part": 5, "analysed": 5},
        {"name": "old", "planned": 5, "took_part": 7, "analysed": 7},
    ]
    (pair,) = told["score"]["pairs"]
    assert (pair["a"], pair["b"], pair["n"]) == ("young", "old", [5, 7])
    assert pair["shift"] < -1
    assert pair["p_holm"] < 0.05
    answer = dict(paragraphs(found))[GROUPS]
    assert answer.startswith("Mean responses differed between groups")
    assert "old above young by" in answer
    together = dict(paragraphs(found))[TOGETHER]
    assert "This is what holds of six questions" in together
    # By one correction over seven questions less is left than over three.
    assert "slopes differ between groups" not in together
    assert "mean responses differ between groups (p" in together
    assert told["p_holm"][SCORE] == found.questions.p_holm[CLAIMED["score"]]
    page = report_html(found)
    assert 'id="h-groups"' in page
    assert "Without a group, and not compared: P13." in page
    figure = page.partition("Responses by group</title>")[2].partition("</svg>")[0]
    assert all(f">{name}<" in figure for name in (*PLANNED, *STUDY.conditions))


def test_groups_that_do_not_differ_are_not_said_to() -> None:
    found = of_rise(0)
    assert found.groups is not None
    assert not found.groups.holds(SCORE)
    assert found.groups.in_conditions == []
    answer = dict(paragraphs(found))[GROUPS]
    assert "Mean responses were not found to differ" in answer
    assert "Conditions in which" not in answer
    assert "between groups" not in dict(paragraphs(found))[TOGETHER]


def test_an_empty_cell_is_told_and_means_are_adjusted() -> None:
    """Of one of the young all trials of the last condition are excluded."""
    found = made_of(grouped(3, gone=EXTENDED.conditions[-1]))
    assert found.loaded.empty == {(0, 4): Why.EXCLUDED}
    adjusted = dict(paragraphs(found))[GROUPS]
    assert adjusted.startswith("Mean responses, adjusted for conditions without an answer, ")
    assert dict(paragraphs(of_rise(3)))[GROUPS].startswith("Mean responses differed")


def test_groups_are_compared_by_the_mean_response_of_each_person() -> None:
    """U and p by scipy, from the responses of report.json."""
    numbers = report_json(of_rise(3))
    groups = of_rise(3).loaded.groups
    means: dict[str, list[float]] = {"young": [], "old": []}
    for who, group in groups.items():
        own = [
            (row["condition"], row["response"])
            for row in of_rise(3).trial_records
            if row["subject"] == who and row["kind"] == "trial"
        ]
        cells = [
            np.mean([value for name, value in own if name == condition])
            for condition in numbers["table4"]["columns"]
        ]
        means[group].append(float(np.mean(cells)))
    test = mannwhitneyu(means["young"], means["old"], method="exact")
    (pair,) = numbers["groups"]["score"]["pairs"]
    assert (pair["u"], numbers["groups"]["score"]["p"]) == pytest.approx(
        (test.statistic, test.pvalue)
    )


@pytest.mark.parametrize(
    ("rise", "name", "supported"),
    [(3, "old above young", True), (3, "young above old", False), (0, "old above young", False)],
)
def test_a_registered_hypothesis_on_groups_is_judged(rise: int, name: str, supported: bool) -> None:
    hypothesis = between(*name.split(" above "))
    assert hypothesis in how_tested(STUDY)
    assert hypothesis not in how_tested(EXTENDED)
    registration = Registration(
        study="a study",
        study_sha256="1" * 64,
        primary=hypothesis,
        law=LAW,
        rung=RUNG,
        participants=12,
        sessions=1,
        touchbeam="1",
    )
    lock = StudyLock(registration=registration, utc=BEGAN, amendments=(), sessions=(), completed=13)
    (result,) = named_results(of_rise(rise), lock)
    assert result.supported is supported
    assert result.found.startswith("shift ")
    locked = replace(of_rise(rise), loaded=replace(of_rise(rise).loaded, lock=lock))
    assert f"{GROUPS} (registered: {hypothesis})" in dict(marked(locked))
