"""The section on detection: shares by condition, level, group and subject; its hypotheses."""

from dataclasses import replace
from datetime import UTC, datetime
from functools import cache

import pytest

from analysis.loading.study_data import StudyData
from analysis.loading.study_lock import StudyLock
from analysis.report.hypotheses import how_tested
from analysis.report.report import Report, report, report_html, report_json
from analysis.report.results import NOTICE, paragraphs
from analysis.report.sections.registration import NamedResult, named_results
from analysis.simulation import Simulation
from protocol.registration.registration import NOTICED
from protocol.study.study import Study
from protocol.study_file.loading import parsed_study, template
from tests.analysis.report.sections.test_registered import REGISTERED
from tests.analysis.reports import EXTENDED, ORIGIN, PAPER, plain_report
from tests.analysis.simulated_data import simulated_data

STUDIES = {
    "agrees": EXTENDED,
    "noticed": parsed_study(
        template("extended").replace('score_when = "agrees"', 'score_when = "noticed"')
    ),
    "paper": PAPER,
}


@cache
def simulated(study: str = "agrees") -> StudyData:
    return simulated_data(Simulation(study=STUDIES[study]), 6, 1)


def made(data: StudyData, study: Study = EXTENDED) -> Report:
    return report("a study", data, study, replace(ORIGIN, alone=True), shown=("detection",))


def test_its_counts_are_those_of_the_trials() -> None:
    trials = simulated().trials
    found = report_json(made(simulated()))["detection"]
    told = trials[trials["trial_kind"].eq("trial") & trials["condition"].eq("voltage")]
    voltage = next(each for each in found["conditions"] if each["condition"] == "voltage")
    assert voltage["hits"]["reported"] == told["change"].ne("same").sum()
    assert voltage["hits"]["trials"] == len(told)
    catch = trials[trials["trial_kind"].eq("catch")]
    assert voltage["false_alarms"]["trials"] == found["overall"]["false_alarms"]["trials"]
    assert voltage["false_alarms"]["trials"] == len(catch)
    assert sum(e["hits"]["trials"] for e in found["levels"] if e["condition"] == "voltage") == len(
        told
    )
    assert [each["participant"] for each in found["subjects"]] == list(
        trials["participant"].unique()
    )
    assert all(each["p"] <= each["p_holm"] for each in found["conditions"])
    assert found["groups"] == []


def test_groups_are_compared_with_their_own_catch_trials() -> None:
    trials = simulated().trials
    old = trials["participant"].isin(["P01", "P02", "P03"])
    group = old.map({True: "old", False: "young"})
    grouped = replace(simulated(), trials=trials.assign(group=group), with_alarmed=None)
    result = made(grouped)
    found = report_json(result)["detection"]["groups"]
    whole = [each for each in found if "condition" not in each]
    assert [each["group"] for each in whole] == ["old", "young"]
    catch = trials["trial_kind"].eq("catch")
    assert [each["false_alarms"]["trials"] for each in whole] == [
        (catch & old).sum(),
        (catch & ~old).sum(),
    ]
    page = report_html(result)
    assert '<th scope="row">voltage, old</th>' in page
    assert '<th scope="row">catch trials, young</th>' in page


def test_of_two_people_d_prime_has_no_interval_and_the_report_says_why() -> None:
    result = made(simulated_data(Simulation(study=EXTENDED), 2, 2))
    found = report_json(result)["detection"]["overall"]
    why = "two people do not tell how hits and false alarms go together"
    assert found["people"] == 2
    assert found["d_prime"] is not None
    for name in ("d_prime_interval", "criterion_interval"):
        assert (found[name], found[f"{name}_reason"]) == (None, why)
    assert f"No interval of d′ and criterion: {why}." in report_html(result)


def test_without_catch_trials_there_is_no_section() -> None:
    assert "detection" not in report_json(plain_report())
    result = made(simulated("paper"), PAPER)
    assert "detection" not in report_json(result)
    assert "Are the changes noticed?" not in report_html(result)


@pytest.mark.parametrize("study", ["agrees", "noticed"])
def test_its_hits_are_the_answers_in_either_direction(study: str) -> None:
    result = made(simulated(study), STUDIES[study])
    numbers = report_json(result)
    hits = {each["condition"]: each["hits"] for each in numbers["detection"]["conditions"]}
    for ways in numbers["directions"]:
        told = hits[ways["condition"]]
        assert ways["expected"] + ways["contrary"] == told["reported"]
        assert ways["same"] == told["trials"] - told["reported"]
    assert sum(ways["contrary"] for ways in numbers["directions"]) > 0
    assert "Are the changes noticed?" in report_html(result)


def test_hypotheses_on_noticing_are_those_of_studies_with_catch_trials() -> None:
    assert not any(NOTICED in name for name in how_tested(PAPER))
    assert [name for name in how_tested(EXTENDED) if NOTICED in name] == [
        NOTICED,
        *(f"{name} {NOTICED}" for name in EXTENDED.conditions),
    ]


def registered(*names: str) -> list[NamedResult]:
    first, *others = names
    settled = replace(REGISTERED, primary=first, secondary=tuple(others))
    when = datetime(2026, 5, 1, tzinfo=UTC)
    lock = StudyLock(registration=settled, utc=when, amendments=(), sessions=(), completed=6)
    return named_results(made(simulated()), lock)


def test_a_registered_hypothesis_takes_the_p_of_the_section() -> None:
    found = report_json(made(simulated()))["detection"]
    whole, *own = registered(NOTICED, *(f"{name} {NOTICED}" for name in EXTENDED.conditions))
    assert (whole.p, whole.supported) == (found["overall"]["p"], found["overall"]["p"] < 0.05)
    assert [each.p for each in own] == [each["p_holm"] for each in found["conditions"]]
    assert "d′ = " in whole.found
    (nothing,) = registered(f"nothing {NOTICED}")
    assert nothing.supported is None


def test_no_single_condition_is_told_where_the_question_does_not_hold() -> None:
    found = made(simulated())
    answer = dict(paragraphs(found))[NOTICE]
    assert "Noticed more often than catch trials: " in answer
    weak = replace(found)
    vars(weak)["questions"] = replace(
        found.questions, p_holm=dict.fromkeys(found.questions.p_holm, 0.2)
    )
    assert (
        "No single condition is told, because changes as a whole"
        in (dict(paragraphs(weak))[NOTICE])
    )
